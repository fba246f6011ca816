"""The steps of the journey, where they join."""

from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.errors import SampleError, ShotError
from lutforge.pipeline.sampling import gather_samples, sample_shots
from lutforge.samples.table import write_samples
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES
from tests.cases.samples import chart_140, made_samples, photograph_patches


def test_names_of_settings_become_those_of_selectors() -> None:
    profile = lf.calibrate(made_samples(style="Standard", balance=" Day/Light "), lf.CalibrationOptions(size=9))
    assert list(profile.styles) == ["standard"]
    assert list(profile.white_balances) == ["day-light"]
    render = profile.render("STANDARD/Day-Light")
    grey = np.array([[0.1, 0.18, 0.12]])
    np.testing.assert_allclose(render(grey), (grey * [1.8, 1.0, 1.5]) ** 0.45, atol=0.01)


def test_tables_and_shots_mix(tmp_path: Path) -> None:
    camera = nikon_d5100()
    settings = CameraSettings("standard", "daylight", camera.nominal_exposure_s)
    for folder in ("a", "b"):
        photograph(camera, SCENES["wall"](404, 608, 3), settings, tmp_path / folder, "same", jpeg_beside=False)
    made_samples(style="Standard", balance=" Day/Light ").save(tmp_path / "table.csv")
    sampled = gather_samples([tmp_path / "table.csv", tmp_path / "a", tmp_path / "b"])
    assert len(sampled.shots) == 2
    assert len({account.shot for account in sampled.shots}) == 2  # of one stem, told apart by their folders
    assert len(sampled.samples) == 300 + sum(account.kept for account in sampled.shots)


def test_a_bad_shot_is_left_out_and_named(tmp_path: Path) -> None:
    camera = nikon_d5100()
    settings = CameraSettings("standard", "daylight", camera.nominal_exposure_s)
    photograph(camera, SCENES["wall"](404, 608, 3), settings, tmp_path, "good", jpeg_beside=False)
    (tmp_path / "bad.nef").write_bytes(b"not a photograph")
    sampled = sample_shots([tmp_path])
    assert [account.shot for account in sampled.shots] == ["good"]
    assert len(sampled.left_out) == 1
    assert "bad.nef" in sampled.left_out[0]
    (tmp_path / "worse.nef").touch()
    with pytest.raises(ShotError, match=r"no usable shot: .*bad.nef.*worse.nef"):
        sample_shots([tmp_path / "bad.nef", tmp_path / "worse.nef"])


def test_a_table_that_is_named_twice_counts_once(tmp_path: Path) -> None:
    samples = photograph_patches(nikon_d5100(), chart_140()[:8], balances=("daylight",), stops=(-1,))
    write_samples(tmp_path / "a.csv", samples)
    (tmp_path / "again.csv").symlink_to(tmp_path / "a.csv")
    found = gather_samples([tmp_path / "a.csv", tmp_path / "." / "a.csv", tmp_path / "again.csv"])
    assert len(found.samples) == len(samples)


def test_nothing_given() -> None:
    with pytest.raises(SampleError, match="nothing given"):
        gather_samples([])


def test_what_is_neither_samples_nor_paths_is_refused_in_one_line() -> None:
    with pytest.raises(SampleError, match="not samples: give a SampleSet"):
        lf.calibrate(np.zeros((3, 3)))  # type: ignore[arg-type]


def test_records_print_without_their_arrays() -> None:
    rng = np.random.default_rng(4)
    raw = rng.uniform(0.02, 0.5, (120, 3))
    samples = lf.SampleSet.from_arrays(raw, np.sqrt(raw), camera="Made up", shot=np.repeat(["a", "b"], 60))
    profile = lf.calibrate(samples, lf.CalibrationOptions(size=5))
    assert repr(profile) == "CameraProfile(Made up: styles standard; white balances auto)"
    assert "array(" not in repr(lf.evaluate(profile, samples))
