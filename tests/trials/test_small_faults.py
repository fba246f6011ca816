"""What strangers and farms ran into: exit statuses, words, and what a failed run leaves behind."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image
import pytest

import lutforge as lf
from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.errors import ImageError, LutForgeError, SampleError
from lutforge.grading.inputs import find_inputs
from lutforge.images.icc import to_srgb
from lutforge.images.read import Image
from lutforge.images.write import write_image
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_picture
from tests.cases.profiles import small_profile
from tests.conftest import CommandLine, Refused
from tests.model.test_profile_file import write_small


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    small_profile().save(tmp_path / "camera.npz")
    return tmp_path / "camera.npz"


def picture(path: Path) -> Path:
    """A JPEG of noise that does not tell its camera."""
    path.parent.mkdir(exist_ok=True)
    PIL.Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)).save(path)
    return path


@pytest.fixture
def folder(profile: Path, tmp_path: Path) -> Path:
    """A profile, and files and folders that something is wrong with."""
    whole = picture(tmp_path / "a.jpg").read_bytes()
    picture(tmp_path / "in" / "a.jpg")
    (tmp_path / "bad.jpg").write_bytes(whole[:400])
    (tmp_path / "link.jpg").symlink_to("knil.jpg")
    (tmp_path / "knil.jpg").symlink_to("link.jpg")
    for empty in ("IMG_1.CR2", "empty.csv"):
        (tmp_path / empty).touch()
    curve = Curve(np.linspace(0, 1, 64)[:, None].repeat(3, 1) ** 0.5)
    shaped = Lut((curve, Cube(grid(uniform_levels(5)))), "a title").write(tmp_path / "x.resolve.cube")
    shaped.write_text(shaped.read_text().replace("LUT_3D_SIZE 5", "LUT_3D_SIZE 6"))
    (tmp_path / "look.cube").write_text("LUT_3D_SIZE 2\n" + "0.5 0.5 0.5\n" * 8)
    (tmp_path / "nan.cube").write_text("LUT_3D_SIZE 2\n" + "0 0 0\n" * 7 + "1 nan 1\n")
    (tmp_path / "mac.cube").write_bytes(b"LUT_3D_SIZE 2\r" + b"0.5 0.5 0.5\r" * 8)
    (tmp_path / "look.dcp").write_bytes(b"IIRC\x08\0\0\0" + bytes(100))
    (tmp_path / "cut.webp").write_bytes(b"RIFF\x00\x01\x00\x00WEBPVP8 " + bytes(40))
    for name in ("Vis/fluorescent", "Nikon D40/fluorescent", "Nikon D40/sunny"):
        (tmp_path / name).mkdir(parents=True)
        write_small(tmp_path / name)
    return tmp_path


TO_TUNGSTEN = ("--from", "standard/daylight", "--to", "standard/tungsten", "-o", "out")
GRADED = ("apply", "camera.npz", "a.jpg", *TO_TUNGSTEN)
REFUSALS: dict[str, tuple[tuple[object, ...], tuple[str, ...]]] = {
    "commands for a bad picture": (("apply", "camera.npz", "bad.jpg", *TO_TUNGSTEN, "--print-commands"), ("bad.jpg",)),
    "nothing to tell the settings": (("apply", "camera.npz", "a.jpg", "-o", "new/out"), ("name the settings",)),
    "a dot": ((*GRADED, "--suffix", "."), ("is no suffix of an image",)),
    "a path": ((*GRADED, "--suffix", "../../a.png"), ("is no suffix of an image",)),
    "a folder": ((*GRADED, "--suffix", ".p/ng"), ("is no suffix of an image",)),
    "256 colours": ((*GRADED, "--suffix", ".gif"), ('cannot write ".gif" images',)),
    "an empty word": (("apply", "camera.npz", "", *TO_TUNGSTEN), ("empty word",)),
    "an empty RAW file": (("apply", "camera.npz", "IMG_1.CR2", "-o", "out"), ("the file is empty",)),
    "a damaged shaper": (("apply", "x.resolve.cube", "a.jpg", "-o", "out"), ("189 of 280 colours",)),
    "an empty table": (("studio", "empty.csv", "--no-browser"), ("the file is empty",)),
    "no name of a camera": (("import-nus", "Vis/fluorescent", "-o", "b.npz"), ('--camera "Nikon D40"', "Vis")),
    "a folder of models": (
        ("import-nus", "Nikon D40", "-o", "b.npz"),
        (str(Path("Nikon D40/fluorescent")), str(Path("Nikon D40/sunny"))),
    ),
    "a link to itself": (("apply", "camera.npz", "link.jpg", *TO_TUNGSTEN), ("link.jpg",)),
    "a picture first": (("apply", "a.jpg", "camera.npz", "-o", "out"), ("a picture; name the LUT, profile or config",)),
    "a profile for samples": (("calibrate", "camera.npz", "-o", "b.npz"), ("a camera profile; name sample tables",)),
    "an unknown white balance": (
        ("bake", "camera.npz", "refinish", "--from", "standard/daylight", "--to", "standard/candle", "-o", "out.cube"),
        ("multipliers of red, green and blue, such as 2.1,1,1.4",),
    ),
    "a damaged profile": (
        ("apply", "look.dcp", "a.jpg", "-o", "out"), ("`lutforge check` shows which programs read it",)
    ),
    "no number in a LUT": (("apply", "nan.cube", "a.jpg", "-o", "out"), ("not finite",)),
    "a device": (("apply", "look.cube", "a.jpg", "-o", "/dev/full"), ("/dev/full", "folder")),
    "a file for a folder": (("apply", "look.cube", "a.jpg", "-o", "bad.jpg"), ("bad.jpg", "folder")),
    "no place": (("apply", "look.cube", "a.jpg", "-o", "/proc/none"), ("/proc/none", "folder")),
    "no threads": (("apply", "look.cube", "a.jpg", "-o", "out", "--workers", "-3"), ("at least one thread",)),
    "no cluster": (("apply", "look.cube", "a.jpg", "-o", "out", "--scheduler", "x"), ("not the address of a Dask",)),
    "a damaged picture": (("apply", "look.cube", "cut.webp", "-o", "out"), ("cannot be read", "convert it to TIFF")),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSALS)
def test_what_is_wrong_is_one_line_and_leaves_nothing(refused: Refused, folder: Path, case: str) -> None:
    words, says = REFUSALS[case]
    line = refused(folder, *words)
    assert all(part in line for part in says), line


@pytest.mark.skipif(not Path("/sys/kernel").is_dir(), reason="no folder in which nobody can make a file")
@pytest.mark.parametrize("words", [("demo", "-o", "/sys/kernel/out"), ("sample", ".", "-o", "/sys/kernel/a.csv")])
def test_outputs_are_tried_before_the_work(refused: Refused, words: tuple[str, ...], tmp_path: Path) -> None:
    assert "cannot be written to" in refused(tmp_path, *words)


def test_a_reason_that_pictures_share_is_printed_once(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    """The second picture that does not tell its settings points to the first; each is named."""
    first, second = (picture(tmp_path / f"{name}.jpg") for name in "ab")
    words = (first, second, "--to", "standard/tungsten", "-o", tmp_path / "out")
    result = lutforge("apply", profile, *words, status=1)
    lines = [line for line in result.stderr.splitlines() if str(second) in line]
    assert lines == [f"lutforge: {second}: as {first}"]


def test_a_picture_that_is_cut_short_is_not_usable(lutforge: CommandLine, refused: Refused, tmp_path: Path) -> None:
    whole, half, empty = picture(tmp_path / "a.jpg"), tmp_path / "b.jpg", tmp_path / "empty"
    half.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    empty.mkdir()
    assert "damaged or cut short" in refused(tmp_path, "inspect", half)
    both = lutforge("inspect", empty, half, whole, status=2)
    assert "96 × 64" in both.stdout and len(both.stderr.strip().splitlines()) == 2


def test_plots_print_nothing_where_there_is_no_home(tmp_path: Path) -> None:
    environment = {**os.environ, "HOME": "/proc/nowhere", "MPLCONFIGDIR": "/proc/nowhere", "XDG_CACHE_HOME": "/proc/x"}
    code = "import lutforge.reports.figures, matplotlib.pyplot"
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stderr == ""


def test_a_picture_in_another_space_is_converted_to_srgb(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    wide, deep = tmp_path / "wide.jpg", tmp_path / "deep.png"
    codes = np.full((8, 8, 3), (60, 140, 90), np.uint8)
    PIL.Image.fromarray(codes).save(wide, icc_profile=adobe_rgb_profile(), quality=95)
    spec = oiio.ImageSpec(8, 8, 3, "uint16")
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(adobe_rgb_profile())}]"), adobe_rgb_profile())
    pixels = np.divide(codes, 255, dtype=np.float32)
    write_image(deep, pixels, Image(pixels, spec))
    settings = ("--from", "standard/daylight", "--to", "vivid/tungsten")
    lutforge("bake", profile, "refinish", *settings, "--size", 17, "-o", tmp_path / "a.cube", "-o", tmp_path / "a.clf")
    for name, grade in (("cube", [tmp_path / "a.cube"]), ("clf", [tmp_path / "a.clf"]), ("profile", [profile])):
        chosen = settings if name == "profile" else ()
        run = lutforge("apply", *grade, wide, *chosen, "-o", tmp_path / name)
        assert "converted to sRGB" in run.stdout + run.stderr, run.stderr
        with PIL.Image.open(tmp_path / name / "wide.jpg") as picture:
            assert "icc_profile" not in picture.info
        run = lutforge("apply", *grade, deep, *chosen, "-o", tmp_path / name, status=2)
        assert "convert it to sRGB" in run.stderr.splitlines()[-1]
    straight = tmp_path / "srgb.png"
    PIL.Image.fromarray(to_srgb(codes, adobe_rgb_profile())).save(straight)
    lutforge("apply", tmp_path / "a.cube", straight, "-o", tmp_path / "cube")
    both = [np.asarray(PIL.Image.open(tmp_path / "cube" / file), dtype=float) for file in ("wide.jpg", "srgb.png")]
    assert np.abs(both[0] - both[1]).max() <= 3


def test_closed_streams_are_no_fault(profile: Path) -> None:
    words = f'"{sys.executable}" -m lutforge inspect "{profile}"'
    quiet = subprocess.run(f"{words} >&-", shell=True, capture_output=True, text=True)
    assert (quiet.returncode, quiet.stderr) == (0, "")
    assert subprocess.run(f"{words} >&- 2>&-", shell=True).returncode == 0


@pytest.mark.parametrize(
    "closed", ["<&- 2>&-", *(pytest.param(words, marks=pytest.mark.slow) for words in ("<&- >&-", "<&- >&- 2>&-"))]
)
def test_pictures_are_graded_while_any_streams_are_closed(tmp_path: Path, closed: str) -> None:
    Lut((Cube(grid(uniform_levels(3)) ** 0.9),)).write(tmp_path / "look.cube")
    picture(tmp_path / "a.jpg")
    environment = {**os.environ, "PYTHONPATH": str(Path(lf.__file__).parents[1])}
    words = f'"{sys.executable}" -m lutforge apply look.cube a.jpg -o out {closed}'
    assert subprocess.run(words, shell=True, cwd=tmp_path, env=environment).returncode == 0
    assert (tmp_path / "out" / "a.jpg").is_file()


def test_scene_linear_is_told_where_encoded_is_graded(lutforge: CommandLine, profile: Path, tmp_path: Path) -> None:
    write_picture(tmp_path / "a.exr", (16, 16), "half")
    words = ("--from", "standard/daylight", "--to", "vivid/daylight", "-o", tmp_path / "out")
    done = lutforge("apply", profile, tmp_path / "a.exr", picture(tmp_path / "a.jpg"), *words)
    assert done.stderr.count("holds scene-linear light, as a rule") == 1


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
            with pytest.raises(LutForgeError, match=name) as raised:
                samples.save(tmp_path / name) if "samples" in name else cube.write(tmp_path / name)
            assert "disk full" in str(raised.value) or "too large" in str(raised.value)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("small_inverses")
@pytest.mark.parametrize("name", ["ocio", pytest.param("a.ocioz", marks=pytest.mark.slow)])
def test_a_config_on_a_full_disk_leaves_nothing(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, name: str
) -> None:
    resource = pytest.importorskip("resource")
    lf.write_config([small_profile()], tmp_path_factory.mktemp("first") / name)  # compiled kernels are files, too
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4_500, before[1]))
    try:
        with pytest.raises(LutForgeError, match=name):
            lf.write_config([small_profile()], tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_a_link_to_itself_among_pictures_fails_alone(lutforge: CommandLine, tmp_path: Path) -> None:
    Lut((Cube(grid(uniform_levels(3)) ** 0.9),)).write(tmp_path / "look.cube")
    for name in "abc":
        picture(tmp_path / "in" / f"{name}.jpg")
    (tmp_path / "in" / "loop.jpg").symlink_to("loop.jpg")
    output = lutforge("apply", "look.cube", "in", "-o", "out", cwd=tmp_path, status=1)
    assert sorted(path.name for path in (tmp_path / "out").glob("*.jpg")) == ["a.jpg", "b.jpg", "c.jpg"]
    assert "loop.jpg" in output.stderr


def test_a_folder_that_cannot_be_read_stops_a_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rights of the user who runs the tests may open every folder, so the system's answer is made up."""
    (tmp_path / "locked").mkdir()

    def iterdir(folder: Path) -> object:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", iterdir)
    with pytest.raises(ImageError, match="locked: the folder cannot be read"):
        find_inputs([tmp_path / "locked"], tmp_path / "out")


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
