"""`check`: what is in a LUT file, who misreads it; and any bytes give a report or one clear line."""

import shutil
import subprocess
from itertools import product
from pathlib import Path

import numpy as np
import PIL.Image
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.input_and_output import input_and_output_of
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve, Matrix
from lutforge.luts.reading import read_lut, trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.transforms import TransformRequest
from tests.cases.pictures import lut_of_nodes
from tests.cases.profiles import small_profile

CLF, DEPTHS = "compCLFversion='3' id='a'", "inBitDepth='32f' outBitDepth='32f'"
LEVELS = (np.array([0.0, 0.125, 0.5, 1.0]),) * 3


def curved() -> Lut:
    """A valid LUT with a shaper of 9 entries."""
    return lut_of_nodes(LEVELS, grid(LEVELS) ** 0.5, size=9, title="a look", comments=("made up",))


def test_a_shaper_cube_names_its_victims(tmp_path: Path) -> None:
    report = check_lut(curved().write(tmp_path / "a.resolve.cube"))
    assert report.lut.summary == "Curve 9 → Cube 4³"
    assert report.readers["OpenColorIO, Nuke"] == "reads it"
    assert "shaper included" in report.readers["DaVinci Resolve"]
    assert report.readers["ffmpeg"] == "refuses it"
    assert report.readers["Kdenlive"].startswith("leaves the picture as it is")
    assert "wrong colours" in report.readers["OBS"]
    text = (tmp_path / "a.resolve.cube").read_text()
    silent = tmp_path / "silent.cube"
    silent.write_text("".join(line for line in text.splitlines(True) if "RANGE" not in line))
    assert "without a word" in check_lut(silent).readers["ffmpeg"]


def test_equal_numbers_of_raw_are_not_taken_for_grey(tmp_path: Path) -> None:
    falls = Cube(1.0 - grid(uniform_levels(5)))
    comments = input_and_output_of("render", "raw").comments
    files = [Lut((falls,), comments=lines).write(tmp_path / f"{len(lines)}.cube") for lines in ((), comments)]
    problems = [check_lut(file).problems for file in files]
    assert any("grey becomes darker" in problem for problem in problems[0])
    assert not any("grey becomes darker" in problem for problem in problems[1])


def test_figures_of_a_bad_cube(tmp_path: Path) -> None:
    cube = 1.2 - 1.4 * grid(uniform_levels(5))
    path = Lut((Cube(cube),)).write(tmp_path / "negative.cube")
    report = check_lut(path)
    assert (report.lowest, report.highest) == pytest.approx((-0.2, 1.2))
    assert report.falling == 1.0
    assert report.black == pytest.approx((1.2,) * 3, abs=1e-6)
    assert report.white == pytest.approx((-0.2,) * 3, abs=1e-6)
    assert any("darker" in problem for problem in report.problems)
    assert any("leave [0, 1]" in problem for problem in report.problems)
    assert any("17, 33 or 65" in verdict for verdict in report.readers.values())


def test_a_falling_shaper_and_a_domain(tmp_path: Path) -> None:
    path = tmp_path / "a.cube"
    path.write_text("LUT_1D_SIZE 3\n0 0 0\n1 .9 1\n.5 1 1\n")
    assert any("falls at entry 3" in problem for problem in check_lut(path).problems)
    path.write_text("LUT_1D_SIZE 2\n0 0 0\n0 1 0\n")
    assert "the curve of red and blue is constant: all inputs become one" in check_lut(path).problems
    path.write_text("LUT_3D_SIZE 2\nDOMAIN_MIN -1 -1 -1\nDOMAIN_MAX 2 2 2\n" + "0 0 0\n" * 7 + "1 1 1\n")
    report = check_lut(path)
    assert report.domain == ((-1.0,) * 3, (2.0,) * 3)
    assert "refuses" in report.readers["darktable"]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.cube", "LUT_3D_SIZE 2\n0 0 0\n0 0 zero\n" + "0 0 0\n" * 6, 'line 3: "zero" is no number'),
        ("a.cube", "LUT_3D_SIZE 2\n0 0 0\n", "ends after 1 of 8 colours"),
        ("a.cube", "LUT_3D_SIZE 2\n" + "0 0 0\n" * 7 + "0 nan 0\n", 'line 9: "nan" is not finite'),
        ("a.csp", "CSPLUTV100\n3D\n2\n0 1\n", "the prelut of red is not"),
        ("a.spi3d", "SPILUT 1.0\n3 3\n2 2 2\n" + "5 0 0 0 0 0\n" * 8, "line 4: 5 0 0 is no node"),
        ("a.cube", 'TITLE "a"\nLUT_3D_SIZE 2\n0 0 0\n1 0 0\n0 1', "ends after 2 of 8 colours"),
        ("a.resolve.cube", "LUT_1D_SIZE 2\nLUT_3D_SIZE 2\n0 0 0\n1 1 1\n0 0 0\n", "ends after 3 of 10 colours"),
        ("a.clf", f"<ProcessList {CLF}><LUT1D {DEPTHS}><Array dim='2 1'>0\n", "ends before its last element"),
        ("a.clf", f"<ProcessList {CLF}><LUT1D {DEPTHS}><Array di", "ends before its last element"),
        ("a.clf", "<ProcessList id='a'><LUT3D><Array dim='9999 2 2 3'>", "At line 1"),
        ("a.clf", f"<ProcessList {CLF}><LUT3D {DEPTHS}><Array dim='9999 2 2 3'/></LUT3D></ProcessList>", "9999 2 2 3"),
        ("a.clf", f"<ProcessList {CLF}><LUT1D {DEPTHS}><Array dim='2 1'>0</Array></LUT1D></ProcessList>", "found 1"),
        ("a.vlt", "LUT_3D_SIZE 17\n0 0 0.5\n", "4913 rows after it"),
        # OpenColorIO 2.6 would look for the end of metadata for ever, and take memory with each line.
        ("a.csp", "CSPLUTV100\n3D\n\nBEGIN METADATA\nx\n", "no END METADATA"),
        ("a.png", "\x89PNG", "neither a PNG"),
        ("a.png", "", "empty"),
        ("a.doc", "x", "no LUT format"),
    ],
)
def test_errors_name_line_text_and_cause(tmp_path: Path, name: str, text: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LutError) as caught:
        check_lut(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    for other, why in ((path.with_name("none.cube"), "no such file"), (tmp_path, "is a folder, not a LUT")):
        with pytest.raises(LutError, match=why):
            check_lut(other)


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("a.cube", "LUT_3D_SIZE 2\nDOMAIN_MIN 1 1 1\nDOMAIN_MAX 0 0 0\n"),
        ("a.cube", "LUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE 1 0\n"),
        ("a.spi1d", "Version 1\nFrom 1 0\nLength 2\nComponents 3\n{\n"),
    ],
)
def test_a_range_that_runs_backwards_is_refused_by_check_and_by_apply(tmp_path: Path, name: str, header: str) -> None:
    rows = "".join(f"{n & 1} {n >> 1 & 1} {n >> 2}\n" for n in range(8))
    (tmp_path / name).write_text(header + (rows if "cube" in name else "0 0 0\n1 1 1\n}\n"))
    for read in (check_lut, trusted_processor):
        with pytest.raises(LutError, match="runs backwards"):
            read(tmp_path / name)


def test_houdini_cdls_and_parametric_operations_are_read_as_opencolorio_applies_them(tmp_path: Path) -> None:
    (tmp_path / "a.cc").write_text(
        "<ColorCorrection id='a'><SOPNode><Slope>1.1 1 0.9</Slope><Offset>0.02 0 -0.02</Offset><Power>1.2 1 0.8</Power>"
        "</SOPNode><SatNode><Saturation>1.3</Saturation></SatNode></ColorCorrection>"
    )
    ops = f"<Log style='log2' {DEPTHS}/><Exponent style='basicMirrorFwd' {DEPTHS}><ExponentParams exponent='1.5'/>"
    (tmp_path / "a.clf").write_text(f"<ProcessList {CLF}>{ops}</Exponent></ProcessList>")
    (tmp_path / "a.lut").write_text(
        "Version 3\nFormat any\nType 3D+1D\nFrom 0 1\nTo 0 1\nBlack 0\nWhite 1\nLength 2 3\n"
        "LUT:\nPre {\n0\n.3\n1\n}\n3D {\n"
        + "".join(f"{n & 1} {n >> 1 & 1} {n >> 2}\n" for n in range(8)) + "}\n"
    )  # fmt: skip
    # Houdini may close a table behind its last number.
    head = "Version 1\nFormat any\nType C\nFrom 0 1\nTo 0 1\nBlack 0\nWhite 1\nLength 4\n"
    (tmp_path / "b.lut").write_text(f"{head}LUT:\nRGB {{\n0\n.5\n.8\n1 }}\n")
    x = np.random.default_rng(0).random((1000, 3)) + 0.01
    for path in tmp_path.iterdir():
        expected = evaluate(trusted_processor(path), x)
        np.testing.assert_allclose(read_lut(path)(x), expected, atol=2e-3, err_msg=path.name)
        assert check_lut(path).readers["OpenColorIO, Nuke"] == "reads it"


def test_what_no_operation_holds_is_said_and_not_dropped(tmp_path: Path) -> None:
    path = tmp_path / "a.ctf"
    table = " ".join(f"{v} {v**2} {v**3}" for v in np.linspace(0, 1, 9))
    curve = f"<LUT1D {DEPTHS} hueAdjust='dw3'><Array dim='9 3'>{table}</Array></LUT1D>"
    path.write_text(f"<ProcessList version='1.4' id='a'>{curve}</ProcessList>")
    for read in (read_lut, check_lut):
        with pytest.raises(LutError, match="a curve that keeps hues, for which no figures can be reported"):
            read(path)


def test_a_table_of_half_floats_has_its_own_value_at_zero_and_figures_of_0_to_1(tmp_path: Path) -> None:
    """The entry of negative zero is another."""
    halves = np.nan_to_num(np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float64), posinf=0, neginf=0)
    table = np.where(np.signbit(halves), 0.0, 0.2 + 0.5 * np.minimum(halves, 1.0))
    rows = "\n".join(f"{value:.6f}" for value in table)
    operations = f"<LUT1D {DEPTHS} halfDomain='true'><Array dim='65536 1'>{rows}</Array></LUT1D>"
    (tmp_path / "a.clf").write_text(f"<ProcessList {CLF}>{operations}</ProcessList>")
    np.testing.assert_allclose(read_lut(tmp_path / "a.clf")(np.array([[0.0] * 3, [1.0] * 3])), [[0.2] * 3, [0.7] * 3])
    report = check_lut(tmp_path / "a.clf")
    np.testing.assert_allclose([report.black, report.white], [[0.2] * 3, [0.7] * 3], atol=1e-6)


def test_channels_are_exchanged_by_the_whole_lut_alone(tmp_path: Path) -> None:
    """A cube that exchanges two channels between matrices that exchange them, too."""
    exchange = np.eye(3)[[2, 1, 0]]
    cube = Cube(grid(uniform_levels(3))[..., ::-1])
    Lut((Matrix(exchange), cube)).write(tmp_path / "a.clf")
    Lut((cube,)).write(tmp_path / "b.clf")
    assert not check_lut(tmp_path / "a.clf").problems
    assert "channels are exchanged" in " ".join(check_lut(tmp_path / "b.clf").problems)


def test_blenders_spi3d_begins_in_lower_case(tmp_path: Path) -> None:
    nodes = [f"{r} {g} {b}" for r, g, b in product((0, 1), repeat=3)]
    rows = [f"{node} {node}" for node in nodes]
    (tmp_path / "filmic.spi3d").write_text("\n".join(["spilut 1.0", "3 3", "2 2 2", *rows, ""]))
    cube = read_lut(tmp_path / "filmic.spi3d").cube
    assert cube is not None
    np.testing.assert_array_equal(cube.values, np.stack(np.meshgrid(*[[0.0, 1.0]] * 3, indexing="ij"), axis=-1))


SUFFIXES = (".cube", ".resolve.cube", ".clf", ".ctf", ".csp", ".3dl", ".spi1d", ".spi3d", ".png", ".vlt")


@pytest.mark.parametrize(
    "kind", ["linearize", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("render", "refinish"))]
)
def test_no_file_of_ours_is_alarming(tmp_path: Path, kind: str) -> None:
    """Rounding to integers, and the fit of a coarse cube near white, are no faults of a picture."""
    small_profile().save(tmp_path / "camera.npz")
    ends = {
        "render": (None, "standard/daylight"),
        "linearize": ("standard/daylight", None),
        "refinish": ("standard/daylight", "vivid/tungsten"),
    }
    suffixes = [
        suffix for suffix in SUFFIXES if kind != "linearize" or suffix in (".cube", ".clf", ".csp", ".spi1d", ".spi3d")
    ]
    files = [tmp_path / f"{kind}{suffix}" for suffix in suffixes if suffix != ".spi3d"]
    bake_files(tmp_path / "camera.npz", TransformRequest(kind, *ends[kind]), files)
    written = [tmp_path / f"{kind}{suffix}" for suffix in suffixes]
    assert {str(path): check_lut(path).problems for path in written} == {str(path): () for path in written}


def test_grey_alarms_from_a_tenth_of_a_code_for_each_code(tmp_path: Path) -> None:
    levels = np.linspace(0, 1, 257)
    for slope, alarms in ((-0.02, False), (-0.2, True)):
        bent = np.where(levels < 0.5, levels, np.where(levels < 0.53, 0.5 + slope * (levels - 0.5), levels - 0.03))
        size = 65
        tone = np.interp(np.linspace(0, 1, size), levels, bent)
        nodes = np.stack(np.meshgrid(tone, tone, tone, indexing="ij"), axis=-1)
        problems = check_lut(Lut((Cube(nodes),)).write(tmp_path / "a.cube")).problems
        assert any("grey becomes darker" in text for text in problems) == alarms


def test_a_half_of_a_pair_is_called_so_and_a_vlt_names_its_cameras(tmp_path: Path) -> None:
    path = lut_of_nodes(LEVELS, grid(LEVELS) ** 0.5, size=9).write(tmp_path / "a.spi3d")
    for half in (path, path.with_suffix(".spi1d")):
        words = " ".join(report_lines(check_lut(half)))
        assert "one half of a pair" in words and "a.spi1d and then a.spi3d" in words
    path.with_suffix(".spi1d").unlink()
    assert "of a pair" not in " ".join(report_lines(check_lut(path)))
    words = " ".join(report_lines(check_lut(Lut((Cube(NODES),)).write(tmp_path / "a.vlt"))))
    assert "Lumix" in words and "VariCam" in words


NODES = grid(uniform_levels(17))


def through_ffmpeg(path: Path) -> tuple[Array, Array] | None:
    """8-bit colours in [0, 1] and what ffmpeg makes of them; None where it refuses the file."""
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    codes = np.random.default_rng(0).integers(0, 256, (1, 2000, 3), dtype=np.uint8)
    PIL.Image.fromarray(codes).save(path.with_name("in.png"))
    command = ["ffmpeg", "-v", "error", "-y", "-i", "in.png", "-vf"]
    command += [f"format=gbrp,lut3d={path.name}:interp=tetrahedral", "-pix_fmt", "rgb24", "out.png"]
    if subprocess.run(command, cwd=path.parent, capture_output=True).returncode != 0:
        return None
    return codes[0] / 255.0, np.asarray(PIL.Image.open(path.with_name("out.png")))[0] / 255.0


@pytest.mark.parametrize("knots", [np.linspace(0, 1, 64), np.array([0, 0.05, 0.2, 0.5, 1]), np.linspace(0, 1, 8192)])
def test_bent_preluts_in_ffmpeg(knots: Array, tmp_path: Path) -> None:
    curve = Curve((knots**0.45)[:, None].repeat(3, 1), inputs=knots[:, None].repeat(3, 1))
    lut = Lut((curve, Cube(NODES)))
    path = lut.write(tmp_path / "a.csp")
    tried = through_ffmpeg(path)
    assert tried is not None
    off = 255 * np.abs(tried[1] - lut(tried[0])).max()
    words = check_lut(path).readers["ffmpeg"]
    assert words != "reads it" or off < 5, (words, off)


@pytest.mark.parametrize(("format", "size"), [("flame", 17), ("flame", 33), ("lustre", 17), ("lustre", 33)])
def test_baked_3dl_files_in_ffmpeg(format: str, size: int, tmp_path: Path) -> None:
    config = OCIO.Config.CreateRaw()
    for name, transform in (("in", OCIO.MatrixTransform()), ("out", OCIO.ExponentTransform(value=[0.5, 0.5, 0.5, 1]))):
        config.addColorSpace(OCIO.ColorSpace(name=name, fromReference=transform))
    baker = OCIO.Baker()
    baker.setConfig(config)
    baker.setInputSpace("in")
    baker.setTargetSpace("out")
    baker.setFormat(format)
    baker.setCubeSize(size)
    path = tmp_path / "a.3dl"
    path.write_text(baker.bake())
    tried = through_ffmpeg(path)
    right = tried is not None and 255 * np.abs(tried[1] - read_lut(path)(tried[0])).max() < 2
    assert (check_lut(path).readers["ffmpeg"] == "reads it") == right


def test_wide_outputs_have_no_limits(tmp_path: Path) -> None:
    lines = report_lines(check_lut(Lut((Cube(NODES * 2042 - 2030),)).write(tmp_path / "a.cube")))
    assert not any("at a limit" in line for line in lines)
