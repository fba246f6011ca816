"""Pairs of any two renderings: a known look is found from pictures before and after it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rawpy

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.errors import LutForgeError, SettingsError, ShotError
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import trusted_processor
from lutforge.model.camera_profile import load_profile
from lutforge.model.provenance import Developed
from lutforge.pipeline.calibration import calibrate as calibrate_profile
from lutforge.pipeline.pairing import raw_substitute, sample_pairs
from lutforge.pipeline.sampling import gather_samples
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_picture
from tests.conftest import CommandLine


def look(x: np.ndarray) -> np.ndarray:
    """Cooler, and with more contrast."""
    y = x**1.2 @ np.array([[0.95, 0.05, 0.0], [0.0, 1.0, 0.0], [0.0, 0.1, 0.9]]).T
    return np.asarray(np.clip(0.04 + 0.9 * y, 0.0, 1.0))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Six frames of coloured squares, before and after the look."""
    folder = tmp_path_factory.mktemp("pairs")
    rng = np.random.default_rng(8)
    for name in "abcdef":
        squares = rng.uniform(0.05, 0.95, (6, 8, 3))
        picture = np.kron(squares, np.ones((80, 80, 1)))
        for side, pixels in (("before", picture), ("after", look(picture))):
            (folder / side).mkdir(exist_ok=True)
            write_picture(folder / side / f"{name}.tif", kind="uint16", pixels=np.ascontiguousarray(pixels, np.float32))
    return folder / "before", folder / "after"


@pytest.mark.slow
def test_a_look_between_two_renderings(folders: tuple[Path, Path], tmp_path: Path, lutforge: CommandLine) -> None:
    before, after = folders
    output = tmp_path / "look.npz"
    lutforge("calibrate", "--pairs", before, after, "--from-space", "srgb", "-o", output)
    profile = load_profile(output)
    assert (profile.raw_space, profile.fed_to) == ("linear-srgb", "srgb")
    setting = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
    x = np.random.default_rng(9).uniform(0.1, 0.9, (500, 3))
    light = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    assert np.abs(profile.render(setting)(light) - look(x)).mean() < 0.004
    cube = tmp_path / "look.cube"
    run = lutforge("bake", output, "render", "--to", setting, "-o", cube, "--size", "33")
    assert "input: scene-referred srgb" in run.stderr
    assert np.abs(evaluate(trusted_processor(cube), x) - look(x)).mean() < 0.004  # from the pictures as they are


def test_raw_is_not_taken_for_what_a_program_developed(
    s40_samples: SampleSet, shared_data: Path, tmp_path: Path, lutforge: CommandLine
) -> None:
    """A profile of developed pictures, and RAW or its samples: each step says so."""
    profile = calibrate(s40_samples, CalibrationOptions(size=9))[0]
    developed = Developed("pictures in prophoto", "linear-prophoto")
    replace(profile, provenance=developed).save(tmp_path / "developed.npz")
    s40_samples.save(tmp_path / "samples.csv")
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    for words in (
        ("evaluate", "developed.npz", "samples.csv"),
        ("evaluate", "developed.npz", raw),
        ("report", "developed.npz", "samples.csv", "-o", "report.html"),
        ("config", "developed.npz", "-o", "ocio"),
        ("bake", "developed.npz", "render", "--to", "standard/auto", "-o", "look.dcp"),
    ):
        run = lutforge(*words, cwd=tmp_path, status=2)
        assert "pictures in prophoto" in run.stderr.splitlines()[-1]
    run = lutforge("apply", "developed.npz", raw, "--to", "standard/auto", "-o", "graded", cwd=tmp_path, status=2)
    assert "lutforge kit" in run.stderr


def test_the_space_of_a_developed_picture_is_exact(s40_samples: SampleSet) -> None:
    count = len(s40_samples.raw)
    developed = replace(
        s40_samples, raw=np.clip(s40_samples.raw * s40_samples.wb, 0.0, 1.0), wb=np.ones((count, 3)),
        raw_space=np.full(count, "linear-rec2020"), developer=np.full(count, "darktable 4.2.1"),
    )  # fmt: skip
    profile = calibrate_profile(developed, CalibrationOptions(size=9))
    codes = np.random.default_rng(2).uniform(0.2, 0.8, (50, 3))
    light = profile.linearize("standard/auto", "acescg")(codes)
    exact = profile.linearize("standard/auto")(codes) @ matrix_between("linear-rec2020", "acescg").T
    assert np.abs(light - exact).max() < 1e-4  # the published matrices are rounded


def test_what_does_not_fit_is_one_line(folders: tuple[Path, Path], tmp_path: Path) -> None:
    before, _ = folders
    with pytest.raises(SettingsError, match="known: "):
        sample_pairs(*folders, "no-such-space")
    with pytest.raises(ShotError, match="no such folder"):
        sample_pairs(before, tmp_path / "nothing", "srgb")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ShotError, match="no picture of one has the name of a picture of the other"):
        sample_pairs(before, tmp_path / "empty", "srgb")
    with pytest.raises(SettingsError, match="--developed-space"):
        raw_substitute(before, None)
    with pytest.raises(SettingsError, match="give both"):
        raw_substitute(None, "srgb")


def test_of_several_pictures_of_one_name_the_tiff_is_taken(folders: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "FRAME.TIF").write_bytes((folders[0] / "a.tif").read_bytes())
    (tmp_path / "frame.jpg").write_bytes(b"no picture")
    substitute = raw_substitute(tmp_path, developed_space="srgb")
    assert substitute is not None
    assert substitute(Path("frame.CR2")).pixels.shape == (480, 640, 3)


@pytest.mark.slow
def test_a_picture_of_any_size_or_turn_is_paired_and_a_crop_is_one_line(shared_data: Path, tmp_path: Path) -> None:
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    with rawpy.imread(str(raw)) as opened:
        whole = opened.postprocess(output_bps=16, use_camera_wb=True, no_auto_bright=True, user_flip=0) / 65535
    for name, pixels, fits in (
        ("turned, half size", np.rot90(whole)[::2, ::2], True),
        ("margins", whole[4:-4, 4:-4], True),
        ("cropped", whole[200:-200, 250:-250], False),
    ):
        (tmp_path / name).mkdir()
        write_picture(tmp_path / name / "CRW_0101.tif", kind="uint16", pixels=np.ascontiguousarray(pixels, np.float32))
        substitute = raw_substitute(tmp_path / name, developed_space="srgb")
        if fits:
            assert len(gather_samples([raw], substitute=substitute).samples) > 50, name
            continue
        with pytest.raises(LutForgeError) as raised:
            gather_samples([raw], substitute=substitute)
        (line,) = str(raised.value).splitlines()
        assert f"{pixels.shape[1]} × {pixels.shape[0]}, must be the whole frame" in line
