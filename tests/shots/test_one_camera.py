"""Files of several cameras are refused before any is decoded; those of one stay together, however they name it."""

from dataclasses import replace
from pathlib import Path

import pytest

from lutforge.errors import ShotError
from lutforge.pipeline.sampling import gather_samples, sample_by_reference, sample_shots
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import still_life
from tests.cases.samples import chart_140, photograph_patches
from tests.conftest import CommandLine

FIRST, SECOND = replace(nikon_d5100(), make="NIKON CORPORATION", model="NIKON D5100"), sigma_sd_merrill()


def _shoot(camera: SimulatedCamera, folder: Path, *names: str, jpeg_beside: bool = True) -> None:
    settings = CameraSettings(exposure_s=camera.nominal_exposure_s, preview_scale=1.0)
    for seed, name in enumerate(names):
        photograph(camera, still_life(232, 344, seed), settings, folder, name, jpeg_beside=jpeg_beside)


def _not_decoded(*arguments: object) -> None:
    raise AssertionError("a RAW file was decoded")


@pytest.fixture
def two_cameras(tmp_path: Path) -> Path:
    _shoot(FIRST, tmp_path, "a1", "a2")
    (tmp_path / "second").mkdir()
    _shoot(SECOND, tmp_path / "second", "b1", jpeg_beside=False)
    return tmp_path


def test_two_cameras_are_named_with_a_file_of_each_before_any_is_decoded(
    two_cameras: Path, monkeypatch: pytest.MonkeyPatch, lutforge: CommandLine
) -> None:
    monkeypatch.setattr("lutforge.shots.read.read_raw", _not_decoded)
    words = rf"2 cameras \(Nikon D5100: {two_cameras}/a1.dng and 1 more; {SECOND.name}: \S+b1.dng\).* folder of its own"
    with pytest.raises(ShotError, match=words):
        sample_shots(two_cameras)
    for command in ("calibrate", "sample"):
        assert (
            "files of 2 cameras" in lutforge(command, str(two_cameras), "-o", two_cameras / "out.npz", status=2).stderr
        )


def test_a_table_and_reference_files_are_of_one_camera_too(two_cameras: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lutforge.shots.read.read_raw", _not_decoded)
    table = two_cameras / "samples.csv"
    photograph_patches(SECOND, chart_140()[:40], balances=("daylight",)).save(table)
    with pytest.raises(ShotError, match=rf"{SECOND.name}: {table}; Nikon D5100: "):
        gather_samples([table, two_cameras / "a1.dng"])
    with pytest.raises(ShotError, match="2 cameras"):
        sample_by_reference([two_cameras / "a1.JPG"], two_cameras)


def test_one_body_whose_firmware_spells_it_otherwise_is_one_camera(tmp_path: Path) -> None:
    _shoot(FIRST, tmp_path, "a1")
    _shoot(replace(FIRST, make="Nikon", model="nikon D-5100"), tmp_path, "a2")
    samples = sample_shots(tmp_path).samples
    assert set(samples.camera) == set(samples.raw_camera) == {"Nikon D5100"} and len(set(samples.shot)) == 2


@pytest.mark.parametrize("beside", [True, False])
def test_a_file_without_a_camera_is_taken_for_the_others(tmp_path: Path, beside: bool) -> None:
    _shoot(FIRST, tmp_path, "a1")
    _shoot(replace(FIRST, make="", model=""), tmp_path, "a2", jpeg_beside=beside)
    sampled = sample_shots(tmp_path)
    assert set(sampled.samples.camera) == {"Nikon D5100"} and len(set(sampled.samples.shot)) == 2
    assert any("does not name its camera" in note for note in sampled.shots[1].file_notes)


def test_pictures_of_a_phone_among_raw_files_are_no_second_camera(tmp_path: Path) -> None:
    """Beside no RAW file, and under the name of one."""
    _shoot(FIRST, tmp_path, "a1", "a2", jpeg_beside=False)
    phone = tmp_path / "phone"
    phone.mkdir()
    _shoot(SECOND, phone, "IMG_1", "IMG_2")
    (phone / "IMG_1.JPG").rename(tmp_path / "IMG_1.JPG")
    (phone / "IMG_2.JPG").rename(tmp_path / "a2.JPG")
    for place in phone.iterdir():
        place.unlink()
    assert set(sample_shots(tmp_path).samples.camera) == {"Nikon D5100"}
