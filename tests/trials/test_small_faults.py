"""What strangers and farms ran into: exit statuses, words, what a failed run leaves behind, what a killed one does."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image
import pytest

from lutforge.apply.inputs import find_inputs
from lutforge.colour.rgb_spaces import adobe_rgb_profile
from lutforge.errors import ImageError, LutForgeError, SampleError
from lutforge.images.icc import to_srgb
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import write_samples
from tests.cases.pictures import write_picture
from tests.cases.profiles import small_profile
from tests.conftest import CommandLine
from tests.model.test_published_model import write_small


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    small_profile().save(tmp_path / "camera.npz")
    return tmp_path / "camera.npz"


def picture(path: Path) -> Path:
    """A JPEG of noise that does not tell its camera."""
    PIL.Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)).save(path)
    return path


def failed(run: "subprocess.CompletedProcess[str]", status: int = 2) -> str:
    """The one line of a failure."""
    assert run.returncode == status, (run.returncode, run.stdout, run.stderr)
    lines = run.stderr.strip().splitlines()
    assert len(lines) == 1, run.stderr
    return lines[0]


def test_commands_for_one_bad_picture(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    bad, out = picture(tmp_path / "bad.jpg"), tmp_path / "out"
    bad.write_bytes(bad.read_bytes()[:400])
    failed(lutforge("apply", profile, bad, "--from", "standard/daylight", "--to", "vivid/daylight", "-o", out,
                    "--print-commands"))  # fmt: skip
    assert not out.exists()


def test_a_failed_batch_leaves_no_folder(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    failed(lutforge("apply", profile, picture(tmp_path / "a.jpg"), "-o", out))
    assert not out.parent.exists()


@pytest.mark.parametrize("suffix", [".", "../../a.png", ".p/ng"])
def test_a_suffix_that_is_none(lutforge: CommandLine, profile: Path, tmp_path: Path, suffix: str) -> None:
    words = ("--from", "standard/daylight", "--to", "standard/tungsten", "-o", tmp_path / "out", "--suffix", suffix)
    assert "is no suffix of an image" in failed(lutforge("apply", profile, picture(tmp_path / "a.jpg"), *words))


def test_a_format_of_256_colours_is_refused(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    words = ("--from", "standard/daylight", "--to", "standard/tungsten", "-o", tmp_path / "out", "--suffix", ".gif")
    assert 'cannot write ".gif" images' in failed(lutforge("apply", profile, picture(tmp_path / "a.jpg"), *words))


def test_a_reason_that_pictures_share_is_printed_once(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    """The second picture that does not tell its settings points to the first; each is named."""
    first, second = (picture(tmp_path / f"{name}.jpg") for name in "ab")
    result = lutforge("apply", profile, first, second, "--to", "standard/tungsten", "-o", tmp_path / "out")
    lines = [line for line in result.stderr.splitlines() if str(second) in line]
    assert result.returncode == 1 and lines == [f"lutforge: {second}: as {first}"]


def test_an_empty_word_is_no_folder(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    picture(tmp_path / "here.jpg")
    told = failed(lutforge("apply", profile, "", "--from", "standard/daylight", "-o", tmp_path / "out", cwd=tmp_path))
    assert "empty word" in told


def test_an_empty_raw_file_is_called_empty(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    (tmp_path / "IMG_1.CR2").write_bytes(b"")
    assert "the file is empty" in failed(lutforge("apply", profile, tmp_path / "IMG_1.CR2", "-o", tmp_path / "out"))


def test_a_picture_that_is_cut_short_is_not_usable(lutforge: CommandLine, tmp_path: Path) -> None:
    whole, half, empty = picture(tmp_path / "a.jpg"), tmp_path / "b.jpg", tmp_path / "empty"
    half.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    empty.mkdir()
    assert "damaged or cut short" in failed(lutforge("inspect", half))
    both = lutforge("inspect", empty, half, whole)
    assert both.returncode == 2 and "96 × 64" in both.stdout and len(both.stderr.strip().splitlines()) == 2


def test_a_damaged_shaper_cube_is_not_blamed_for_a_title(lutforge: CommandLine, tmp_path: Path) -> None:
    curve = Curve(np.linspace(0, 1, 64)[:, None].repeat(3, 1) ** 0.5)
    path = Lut((curve, Cube(grid(uniform_levels(5)))), "a title").write(tmp_path / "x.resolve.cube")
    path.write_text(path.read_text().replace("LUT_3D_SIZE 5", "LUT_3D_SIZE 6"))
    told = failed(lutforge("apply", path, picture(tmp_path / "a.jpg"), "-o", tmp_path / "out"))
    assert "TITLE" not in told and "189 of 280 colours" in told


def test_plots_print_nothing_where_there_is_no_home(tmp_path: Path) -> None:
    environment = {**os.environ, "HOME": "/proc/nowhere", "MPLCONFIGDIR": "/proc/nowhere", "XDG_CACHE_HOME": "/proc/x"}
    code = "import lutforge.report.figures, matplotlib.pyplot"
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stderr == ""


def test_the_studio_does_not_start_on_an_empty_table(lutforge: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_bytes(b"")
    assert "the file is empty" in failed(lutforge("studio", tmp_path / "empty.csv", "--no-browser"))


def test_exposure_of_a_render_names_the_way_to_it(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.clf"
    told = failed(lutforge("bake", profile, "render", "--to", "standard/daylight", "--ev", 1, "-o", out))
    assert "--space" in told and "refinish" not in told


def test_a_picture_in_another_space_is_converted_for_what_is_for_srgb(
    lutforge: CommandLine, profile: Path, tmp_path: Path
) -> None:
    wide, deep = tmp_path / "wide.jpg", tmp_path / "deep.png"
    codes = np.full((8, 8, 3), (60, 140, 90), np.uint8)
    PIL.Image.fromarray(codes).save(wide, icc_profile=adobe_rgb_profile(), quality=95)
    spec = oiio.ImageSpec(8, 8, 3, oiio.UINT16)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(adobe_rgb_profile())}]"), adobe_rgb_profile())
    writer = oiio.ImageOutput.create(str(deep))
    assert writer is not None and writer.open(str(deep), spec)
    writer.write_image(codes / np.float32(255))
    writer.close()
    settings = ("--from", "standard/daylight", "--to", "vivid/tungsten")
    baked = lutforge("bake", profile, "refinish", *settings, "-o", tmp_path / "a.cube", "-o", tmp_path / "a.clf")
    assert baked.returncode == 0, baked.stderr
    for name, grade in (("cube", [tmp_path / "a.cube"]), ("clf", [tmp_path / "a.clf"]), ("profile", [profile])):
        chosen = settings if name == "profile" else ()
        run = lutforge("apply", *grade, wide, *chosen, "-o", tmp_path / name)
        assert run.returncode == 0 and "converted to sRGB" in run.stdout + run.stderr, run.stderr
        with PIL.Image.open(tmp_path / name / "wide.jpg") as picture:
            assert "icc_profile" not in picture.info
        run = lutforge("apply", *grade, deep, *chosen, "-o", tmp_path / name)
        assert run.returncode == 2 and "convert it to sRGB" in run.stderr.splitlines()[-1]
    straight = tmp_path / "srgb.png"
    PIL.Image.fromarray(to_srgb(codes, adobe_rgb_profile())).save(straight)
    assert lutforge("apply", tmp_path / "a.cube", straight, "-o", tmp_path / "cube").returncode == 0
    both = [np.asarray(PIL.Image.open(tmp_path / "cube" / file), dtype=float) for file in ("wide.jpg", "srgb.png")]
    assert np.abs(both[0] - both[1]).max() <= 3


@pytest.mark.skipif(not Path("/sys/kernel").is_dir(), reason="no folder in which nobody can make a file")
@pytest.mark.parametrize("words", [("demo", "-o", "/sys/kernel/out"), ("sample", ".", "-o", "/sys/kernel/a.csv")])
def test_outputs_are_tried_before_the_work(lutforge: CommandLine, words: tuple[str, ...], tmp_path: Path) -> None:
    assert "cannot be written to" in failed(lutforge(*words, cwd=tmp_path))


def test_a_published_model_in_a_folder_that_names_no_camera(lutforge: CommandLine, tmp_path: Path) -> None:
    folder = tmp_path / "Vis" / "fluorescent"
    folder.mkdir(parents=True)
    write_small(folder)
    told = failed(lutforge("import-nus", folder, "-o", tmp_path / "camera.npz"))
    assert '--camera "Nikon D40"' in told and "Vis" in told


def test_a_folder_graded_into_itself(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    picture(tmp_path / "in" / "a.jpg")
    told = failed(lutforge("apply", profile, "in", "--from", "standard/daylight", "-o", "in", cwd=tmp_path))
    assert "choose another output folder" in told and "no image" not in told


def test_a_link_that_leads_to_itself(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").symlink_to("b.jpg")
    (tmp_path / "b.jpg").symlink_to("a.jpg")
    assert "a.jpg" in failed(lutforge("apply", profile, tmp_path / "a.jpg", "--from", "standard/daylight", "-o", "out"))


def test_closed_streams_are_no_fault(profile: Path) -> None:
    words = f'"{sys.executable}" -m lutforge inspect "{profile}"'
    quiet = subprocess.run(f"{words} >&-", shell=True, capture_output=True, text=True, check=False)
    assert (quiet.returncode, quiet.stderr) == (0, "")
    assert subprocess.run(f"{words} >&- 2>&-", shell=True, check=False).returncode == 0


def test_files_in_the_wrong_place_are_called_what_they_are(
    lutforge: CommandLine, profile: Path, tmp_path: Path
) -> None:
    photo = picture(tmp_path / "a.jpg")
    said = failed(lutforge("apply", photo, profile, "--to", "vivid/daylight", "-o", tmp_path / "out"))
    assert "a picture; name the LUT, profile or config first" in said
    assert "a camera profile; name sample tables" in failed(lutforge("calibrate", profile, "-o", tmp_path / "b.npz"))


def test_a_picture_of_scene_linear_light_is_told_where_encoded_ones_are_graded(
    lutforge: CommandLine, profile: Path, tmp_path: Path
) -> None:
    write_picture(tmp_path / "a.exr", (16, 16), "half")
    words = ("--from", "standard/daylight", "--to", "vivid/daylight", "-o", tmp_path / "out")
    done = lutforge("apply", profile, tmp_path / "a.exr", picture(tmp_path / "a.jpg"), *words)
    assert done.returncode == 0
    assert done.stderr.count("holds scene-linear light, as a rule") == 1


def test_a_white_balance_that_no_shot_has_can_be_named_by_its_multipliers(
    lutforge: CommandLine, profile: Path, tmp_path: Path
) -> None:
    words = ("--from", "standard/daylight", "--to", "standard/candle", "-o", tmp_path / "out.cube")
    told = failed(lutforge("bake", profile, "refinish", *words))
    assert "multipliers of red, green and blue, such as 2.1,1,1.4" in told


def test_a_config_is_a_folder(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    told = failed(lutforge("config", profile, "-o", tmp_path / "ocio" / "config.ocio"))
    assert "a config is a folder" in told and not (tmp_path / "ocio").exists()


def test_tables_and_luts_on_a_full_disk(tmp_path: Path) -> None:
    """A limit of the size of a file stands for it, one within the directory that a TIFF ends with."""
    resource = pytest.importorskip("resource")
    colours = np.random.default_rng(0).uniform(0.1, 0.9, (500, 3))
    samples = SampleSet.from_arrays(colours, colours, camera="A", shot="a", white_balance="auto")
    cube = Lut((Cube(np.random.default_rng(0).uniform(size=(9, 9, 9, 3)), "trilinear"),))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4500, before[1]))
    try:
        for name in ("samples.npz", "samples.csv", "look.tif", "look.png"):
            with pytest.raises(LutForgeError, match=name) as told:
                write_samples(tmp_path / name, samples) if "samples" in name else cube.write(tmp_path / name)
            assert "disk full" in str(told.value) or "too large" in str(told.value)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_read_stops_a_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rights of the user who runs the tests may open every folder, so the system's answer is made up."""
    picture(tmp_path / "a.jpg")
    (tmp_path / "locked").mkdir()
    listed = os.scandir

    def scandir(folder: str) -> object:
        if Path(folder).name == "locked":
            raise PermissionError(13, "Permission denied", folder)
        return listed(folder)

    monkeypatch.setattr(os, "scandir", scandir)
    with pytest.raises(ImageError, match="locked: the folder cannot be read"):
        find_inputs([tmp_path], recursive=True)


def test_what_opencolorio_makes_of_a_damaged_lut_is_told(lutforge: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "mac.cube").write_bytes(b"LUT_3D_SIZE 2\r" + b"0.5 0.5 0.5\r" * 8)
    (tmp_path / "look.dcp").write_bytes(b"IIRC\x08\0\0\0" + bytes(100))
    words = (picture(tmp_path / "a.jpg"), "-o", tmp_path / "out")
    assert "save it with line feeds" in failed(lutforge("apply", tmp_path / "mac.cube", *words))
    assert "`lutforge check` shows which programs do" in failed(lutforge("apply", tmp_path / "look.dcp", *words))


def test_a_picture_that_cannot_be_opened_is_told_in_a_short_line(lutforge: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "look.cube").write_text("LUT_3D_SIZE 2\n" + "0.5 0.5 0.5\n" * 8)
    (tmp_path / "cut.webp").write_bytes(b"RIFF\x00\x01\x00\x00WEBPVP8 " + bytes(40))
    told = failed(lutforge("apply", tmp_path / "look.cube", tmp_path / "cut.webp", "-o", tmp_path / "out"))
    assert "cannot be read as an image" in told and "convert it to TIFF" in told


@pytest.mark.parametrize(
    ("raw", "srgb", "says"),
    [
        (0.5, 128.0, "divide 8-bit JPEG values by 255"),
        (8000.0, 0.5, "subtract the black level"),
        (np.nan, 0.5, "finite"),
    ],
)
def test_arrays_of_other_units_are_refused_as_tables_are(raw: float, srgb: float, says: str) -> None:
    first = np.full((2, 3), 0.5)
    linear, encoded = np.vstack([first, np.full((1, 3), raw)]), np.vstack([first, np.full((1, 3), srgb)])
    with pytest.raises(SampleError, match=f"row 2: .*{says}"):
        SampleSet.from_arrays(linear, encoded, camera="A", shot="a")


def test_a_folder_of_published_models_is_answered_by_those_in_it(lutforge: CommandLine, tmp_path: Path) -> None:
    for name in ("Nikon D40/fluorescent", "Nikon D40/sunny"):
        (tmp_path / name).mkdir(parents=True)
        write_small(tmp_path / name)
    told = failed(lutforge("import-nus", "Nikon D40", "-o", "camera.npz", cwd=tmp_path))
    assert str(Path("Nikon D40/fluorescent")) in told and str(Path("Nikon D40/sunny")) in told
