"""The public names: all there, each one hop away, and importing the package is quick and light."""

import inspect
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import lutforge as lf
from lutforge.errors import SampleError, ShotError
from lutforge.pipeline.sampling import gather_samples, sample_shots
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from tests.cases.profiles import small_profile
from tests.cases.same_bytes import same_bytes
from tests.cases.samples import chart_140, made_samples, photograph_patches
from tests.conftest import CommandLine

NAMES = [name for name in dir(lf) if not name.startswith("_")]


def test_every_name_is_there_and_told_in_the_help() -> None:
    assert 18 <= len(NAMES) <= 24
    for name in NAMES:
        assert getattr(lf, name) is not None
        assert name in str(lf.__doc__)
    stubs = re.findall(r"    from \S+ import \w+ as (\w+)", inspect.getsource(lf))
    assert sorted(stubs) == sorted(NAMES)


def test_a_folder_takes_the_name_of_no_function() -> None:
    code = "import lutforge as lf, lutforge.reports, lutforge.grading; print(callable(lf.report), callable(lf.apply))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "True"]


def test_help_fits_on_three_screens() -> None:
    text = subprocess.check_output([sys.executable, "-c", "import lutforge; help(lutforge)"], encoding="utf-8")
    assert len(text.splitlines()) <= 3 * 50


def test_public_functions_say_what_they_take_give_and_raise() -> None:
    for name in NAMES:
        public = getattr(lf, name)
        if inspect.isfunction(public):
            text = inspect.getdoc(public) or ""
            assert "\nArgs:\n" in text and "\nReturns:\n" in text and "\nRaises:\n" in text, name
            for parameter in inspect.signature(public).parameters:
                assert f"\n    {parameter}: " in text, (name, parameter)


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(lf, "frobnicate")


def test_signatures_are_read_in_a_line() -> None:
    for name in NAMES:
        public = getattr(lf, name)
        members = [public, *(value for key, value in vars(public).items() if not key.startswith("_"))]
        for member in members if isinstance(public, type) else [public]:
            if inspect.isfunction(member):
                signature = str(inspect.signature(member))
                assert "_SupportsArray" not in signature, (name, member)
            if callable(member):
                assert inspect.getdoc(member), (name, member)


@pytest.mark.usefixtures("small_inverses")
def test_what_is_no_profile_setting_or_number_is_one_plain_line(tmp_path: Path) -> None:
    profile, colours = small_profile(), np.full((2, 3), 0.5)
    wrong: Any = None
    for call, says in (
        (lambda: profile.linearize(wrong), "None is not STYLE/WB"),
        (lambda: profile.refinish("standard/daylight", "vivid/daylight", ev=cast(Any, "a")), "within ±20 stops"),
        (lambda: lf.bake(profile.render("standard/daylight"), size=cast(Any, 5.5)), "5.5 nodes per axis"),
        (lambda: lf.bake(cast(Any, profile)), "a CameraProfile is no transform of colours"),
        (lambda: lf.bake(wrong, "look.clf"), "a NoneType is no transform of colours"),
        (lambda: lf.bake(profile.render("standard/daylight"), wrong), "None is no path"),
        (lambda: lf.evaluate(wrong, "samples.csv"), "None is not a profile"),
        (lambda: lf.evaluate(profile, wrong), "not samples: give a SampleSet"),
        (lambda: lf.calibrate("missing.csv"), "missing.csv: no such file"),
        (lambda: lf.calibrate(wrong), "not samples: give a SampleSet"),
        (lambda: lf.calibrate(cast(Any, profile)), "not samples: give a SampleSet"),
        (lambda: lf.calibrate("samples.csv", cast(Any, 17)), "17 are no options"),
        (lambda: lf.sample(cast(Any, 3)), "3 is no path"),
        (lambda: lf.response(wrong), "None is no path"),
        (lambda: lf.transform(wrong, "render"), "None is not a profile"),
        (lambda: lf.transform(profile, cast(Any, 7)), "unknown transform"),
        (lambda: lf.write_kit(wrong, "standard", tmp_path / "kit"), "None is not a profile"),
        (lambda: lf.report(wrong), "None is not a profile"),
        (lambda: lf.apply(wrong, "a.jpg", tmp_path), "None is no path"),
        (lambda: lf.load_profile(wrong), "None is no path"),
        (lambda: lf.load_transfer(wrong), "None is no path"),
        (lambda: lf.read_lut(wrong), "None is no path"),
        (lambda: lf.read_samples(wrong), "None is no path"),
        (lambda: lf.import_published(wrong), "None is no path"),
        (lambda: lf.build_config(cast(Any, profile)), "a config is of a list of profiles: [profile]"),
        (
            lambda: lf.write_config(cast(Any, profile), tmp_path / "ocio"),
            "a config is of a list of profiles: [profile]",
        ),
        (lambda: lf.build_config([]), "at least one camera profile"),
        (lambda: lf.build_config([str(tmp_path / "x.npz")]), "x.npz: no such profile"),
        (lambda: lf.SampleSet.from_arrays(np.zeros((0, 3)), np.zeros((0, 3)), camera="A", shot="a"), "none given"),
        (lambda: lf.SampleSet.from_arrays(colours, colours, camera=wrong, shot="a"), "column camera is None"),
        (lambda: lf.SampleSet.from_arrays(colours, colours, camera="A", shot=cast(Any, ["a", None])), "shot is None"),
    ):
        with pytest.raises(lf.LutForgeError, match=re.escape(says)):
            call()
    profile.save(tmp_path / "camera.npz")
    assert lf.build_config([tmp_path / "camera.npz"]).serialize() == lf.build_config([profile]).serialize()


@pytest.mark.slow
def test_bake_reports_what_the_command_reports(tmp_path: Path, lutforge: CommandLine) -> None:
    profile = small_profile()
    profile.save(tmp_path / "camera.npz")
    words = ("bake", "camera.npz", "refinish", "--from", "standard/daylight", "--to", "standard/3200K", "--for", "nuke")
    run = lutforge(*words, "-o", "a.cube", "-o", "a.clf", cwd=tmp_path)
    transform = profile.refinish("standard/daylight", "standard/3200K")
    lut = lf.bake(transform, [tmp_path / "b.cube", tmp_path / "b.clf"], program="nuke")
    output = "\n".join(map(str, lut.files)).replace(f"{tmp_path}{os.sep}b", "a")
    assert run.stdout.strip() == output
    assert run.stderr.strip().splitlines()[-1].endswith(lut.notes[-1].replace(f"{tmp_path}{os.sep}b", "a"))
    for suffix in (".cube", ".clf"):
        assert same_bytes(tmp_path / f"a{suffix}", tmp_path / f"b{suffix}")
    assert transform.purpose.title in str(lut)


def test_a_representation_is_short(tmp_path: Path) -> None:
    profile = small_profile()
    transform = profile.render("standard/daylight")
    samples = lf.SampleSet.from_arrays(np.full((50, 3), 0.5), np.full((50, 3), 0.5), camera="A", shot="a")
    baked = lf.bake(transform, tmp_path / "look.cube", size=5)
    for value in (profile, transform, samples, baked, lf.read_lut(tmp_path / "look.cube"), baked.ops):
        assert len(repr(value)) < 1000, type(value)
    for value in (profile, transform, samples, baked):
        assert len(repr(value)) < 200, type(value)


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
    samples.save(tmp_path / "a.csv")
    (tmp_path / "again.csv").symlink_to(tmp_path / "a.csv")
    found = gather_samples([tmp_path / "a.csv", tmp_path / "." / "a.csv", tmp_path / "again.csv"])
    assert len(found.samples) == len(samples)


@pytest.mark.slow
def test_a_folder_beside_its_own_table_counts_once(tmp_path: Path) -> None:
    camera = nikon_d5100()
    for name in ("first", "second"):
        seconds = camera.nominal_exposure_s / (1 if name == "first" else 2)
        settings = CameraSettings("standard", "daylight", seconds)
        photograph(camera, SCENES["wall"](404, 608, 3), settings, tmp_path, name)
    sampled = sample_shots([tmp_path]).samples
    sampled.save(tmp_path / "both.csv")
    sampled.select(sampled.shot == "first").save(tmp_path / "one.csv")
    edited = sampled.select(np.flatnonzero(sampled.shot == "first")[:-1])
    other = replace(edited, srgb=edited.srgb[:, ::-1])  # of the same name, and another photograph
    other.save(tmp_path / "other.csv")
    for tables, more in ((["both.csv"], 0), (["one.csv", "both.csv"], 0), (["other.csv"], len(other))):
        paths = [tmp_path / table for table in tables]
        assert len(gather_samples([*paths, tmp_path]).samples) == len(sampled) + more
        assert len(gather_samples([*paths, tmp_path / "both.csv"]).samples) == len(sampled) + more


def test_nothing_given() -> None:
    with pytest.raises(SampleError, match="nothing given"):
        gather_samples([])
