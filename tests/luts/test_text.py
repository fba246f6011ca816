"""Tables of text: every word is a whole number, or the file is refused with the line; what is unusual is said."""

import re
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from lutforge.errors import LutError
from lutforge.grading.grade import LutRecipe
from lutforge.luts.check import check_lut
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Matrix
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from tests.cases.lut_texts import PRELUTS, SOUND, table
from tests.conftest import CommandLine


def write(folder: Path, name: str, text: str) -> Path:
    """A file in a folder of its own: the two halves of a pair stand alone."""
    path = folder / name
    path.write_text(text, encoding="utf-8", newline="")
    return path


def messages(path: Path) -> tuple[str, str]:
    """What `check` and `apply` say of a file, be it a refusal or problems."""
    try:
        checked = "; ".join(check_lut(path).problems)
    except LutError as error:
        checked = str(error)
    try:
        applied = "; ".join(LutRecipe(path).grade(Path()).notes)
    except LutError as error:
        applied = str(error)
    return checked, applied


@pytest.mark.parametrize("name", SOUND)
def test_sound_tables_are_read_without_a_word(tmp_path: Path, name: str) -> None:
    checked, applied = messages(write(tmp_path, name, SOUND[name]))
    assert checked == applied.replace(f"{tmp_path / name}: ", "") == ""


WORDS = {
    "0,5": "decimal comma",
    "0.5x": "is no number",
    "1e": "is no number",
    "0x1": "is no number",
    "nan": "not finite",
}
"""Words that begin like numbers, or are numbers that no table holds, and what is said of them."""


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("name", SOUND)
def test_a_word_that_is_no_whole_number_is_refused_by_its_line(tmp_path: Path, name: str, word: str) -> None:
    """The last number of the file's table, and one in the middle."""
    text = SOUND[name]
    for mark in ("1.0", "0.5", "1023\n", "255\n", "4095\n"):
        if mark.strip() not in text:
            continue
        at = text.rindex(mark)
        path = write(tmp_path, name, text[:at] + word + text[at + len(mark.strip()) :])
        for message in messages(path):
            assert WORDS[word] in message, (mark, message)
            assert f"line {text[:at].count(chr(10)) + 1}" in message
            assert str(path) in message


def without_last_row(text: str) -> str:
    rows = text.splitlines(keepends=True)
    last = max(n for n, row in enumerate(rows) if row[0].isdecimal())
    return "".join(rows[:last] + rows[last + 1 :])


def with_last_row_twice(text: str) -> str:
    rows = text.splitlines(keepends=True)
    last = max(n for n, row in enumerate(rows) if row[0].isdecimal())
    return "".join(rows[: last + 1] + rows[last:])


def with_a_word_more(text: str) -> str:
    rows = text.splitlines(keepends=True)
    last = max(n for n, row in enumerate(rows) if row[0].isdecimal())
    return "".join([*rows[:last], rows[last].rstrip("\n") + " 0\n", *rows[last + 1 :]])


def with_a_word_less(text: str) -> str:
    rows = text.splitlines(keepends=True)
    last = max(n for n, row in enumerate(rows) if row[0].isdecimal())
    return "".join([*rows[:last], " ".join(rows[last].split()[:-1]) + "\n", *rows[last + 1 :]])


CUTS = (without_last_row, with_last_row_twice, with_a_word_more, with_a_word_less)


@pytest.mark.parametrize("spoil", CUTS, ids=lambda function: function.__name__)
@pytest.mark.parametrize("name", [name for name in SOUND if name != "a.cc"])
def test_rows_are_as_many_and_as_long_as_the_file_says(tmp_path: Path, name: str, spoil: Callable[[str], str]) -> None:
    for message in messages(write(tmp_path, name, spoil(SOUND[name]))):
        assert str(tmp_path / name) in message, message


@pytest.mark.parametrize("top", [255, 1023, 4095, 65535])
@pytest.mark.parametrize(
    "name", ["a.cube", "1d.cube", "a.itx", "a.csp", "curve.spi1d", "a.spi3d", "a.cub", "a.vf", "a.clf"]
)
def test_codes_for_numbers_from_0_to_1_are_a_problem_for_check_and_for_apply(
    tmp_path: Path, name: str, top: int
) -> None:
    text = SOUND[name]
    before = ("DOMAIN_MAX 1.0 1.0 1.0", PRELUTS, "From 0.0 1.0", "# Cube", "<LUT3D")
    head = max([0, *(text.find(mark) + len(mark) for mark in before if mark in text)])
    spoilt = text[:head] + text[head:].replace("1.0", f"{top}").replace("0.5", f"{top // 2}")
    for message in messages(write(tmp_path, name, spoilt)):
        assert f"run to {top}, as codes" in message, message


@pytest.mark.parametrize("top", [100, 127, 255, 1023, 16383, 32767])
@pytest.mark.parametrize("name", ["a.cube", "a.csp", "a.spi3d", "a.cub", "a.vf", "a.clf", "curve.spi1d"])
def test_codes_with_decimals_are_codes(tmp_path: Path, name: str, top: int) -> None:
    text = SOUND[name]
    before = ("DOMAIN_MAX 1.0 1.0 1.0", PRELUTS, "From 0.0 1.0", "# Cube", "<LUT3D")
    head = max([0, *(text.find(mark) + len(mark) for mark in before if mark in text)])
    codes = {"0.0": f"{0.313 * top:.4f}", "0.5": f"{0.607 * top:.4f}", "1.0": f"{top}.0"}
    spoilt = text[:head] + re.sub(r"\b[01]\.[05]\b", lambda word: codes[word[0]], text[head:])
    for message in messages(write(tmp_path, name, spoilt)):
        assert f"run to {top}, as codes" in message, message


@pytest.mark.parametrize("code", [1, 255, 1023])
@pytest.mark.parametrize(("name", "top"), [("a.vlt", 4095), ("discreet.lut", 1023), ("a.m3d", 1023)])
def test_codes_of_fewer_bits_than_the_file_states_are_a_problem(tmp_path: Path, name: str, top: int, code: int) -> None:
    """Numbers from 0 to 1, or codes of 8 or 10 bits, in a file whose white is a higher code: all is dark."""
    if code == top:
        pytest.skip("these are the codes that the file should hold")

    def scaled(line: str) -> str:
        *place, r, g, b = line.split()
        return " ".join([*place, *(str(round(int(value) * code / white)) for value in (r, g, b))])

    lines = SOUND[name].splitlines()
    if name == "discreet.lut":
        lines = [lines[0], *(f"{int(line) * code / top:.5f}" for line in lines[1:])]
    else:
        white = max(int(line.split()[-1]) for line in lines if line[:1].isdecimal())
        lines = [scaled(line) if line[:1].isdecimal() else line for line in lines]
    for message in messages(write(tmp_path, name, "\n".join(lines) + "\n")):
        assert f"its numbers run to {code}, " in message and f"where {top} is white: all is dark" in message


@pytest.mark.parametrize(("highest", "advice"), [(235, "by 255"), (940, "by 1023"), (100, "by the code of white")])
def test_the_code_of_white_is_named_where_the_numbers_come_near_it(tmp_path: Path, highest: int, advice: str) -> None:
    path = write(
        tmp_path, "a.cube", SOUND["a.cube"].replace("1.0 1.0 1.0\n0", "1 1 1\n0").replace("1.0\n", f"{highest}\n")
    )
    assert advice in messages(path)[0]


@pytest.mark.parametrize(
    ("name", "size", "spoilt"),
    [
        ("a.cube", "LUT_3D_SIZE 2", "LUT_3D_SIZE 2.7"),
        ("a.itx", "LUT_3D_SIZE 2", "LUT_3D_SIZE 2.7"),
        ("1d.cube", "LUT_1D_SIZE 3", "LUT_1D_SIZE 3.2"),
        ("curve.spi1d", "Length 3", "Length 3.5"),
        ("a.csp", "\n2 2 2\n", "\n2.5 2 2\n"),
        ("a.csp", "\n\n2\n", "\n\n2.5\n"),
        ("a.spi3d", "\n2 2 2\n", "\n2 2 2.5\n"),
        ("a.vf", "grid_size 2 2 2", "grid_size 2.5 2 2"),
    ],
)
def test_sizes_are_whole_numbers(tmp_path: Path, name: str, size: str, spoilt: str) -> None:
    assert size in SOUND[name]
    for message in messages(write(tmp_path, name, SOUND[name].replace(size, spoilt, 1))):
        assert "is no whole number" in message


@pytest.mark.parametrize("name", ["a.cube", "a.spi3d", "a.clf"])
@pytest.mark.parametrize("top", [55.0, 16291.0])
def test_scene_linear_light_is_not_taken_for_codes(tmp_path: Path, name: str, top: float) -> None:
    """As a table has it that decodes a log space."""
    source = Lut((Cube(np.expm1(grid(uniform_levels(9)) * np.log(1.0 + 100.0 * top)) / 100.0),)).write(
        tmp_path / f"source{Path(name).suffix}"
    )
    for message in messages(source):
        assert "as codes" not in message


@pytest.mark.parametrize("gain", [2.0, 8.0])
def test_a_gain_of_whole_stops_is_not_taken_for_codes(tmp_path: Path, gain: float) -> None:
    for message in messages(Lut((Matrix(gain * np.eye(3)),)).write(tmp_path / "a.clf")):
        assert "as codes" not in message


@pytest.mark.parametrize("top", [255, 1023])
def test_inputs_in_codes_are_a_problem(tmp_path: Path, top: int) -> None:
    text = SOUND["a.cube"].replace("DOMAIN_MAX 1.0 1.0 1.0", f"DOMAIN_MAX {top} {top} {top}")
    for message in messages(write(tmp_path, "a.cube", text)):
        assert f"its inputs run to {top}, as codes" in message


def test_a_cube_of_zeros_and_ones_alone_is_a_problem(tmp_path: Path) -> None:
    corners = [[int(index > 1) for index in node] for node in product(range(4), repeat=3)]
    rows = "".join(f"{r} {g} {b}\n" for b, g, r in corners)
    for message in messages(write(tmp_path, "a.cube", "LUT_3D_SIZE 4\n" + rows)):
        assert "100 % of the nodes are at a limit" in message


WRITTEN: dict[str, tuple[Callable[[str], bytes], str]] = {
    "a mark": (lambda text: b"\xef\xbb\xbf" + text.encode(), "byte order mark"),
    "UTF-16": (lambda text: text.encode("utf-16"), "UTF-16"),
    "UTF-16, the other way": (lambda text: b"\xfe\xff" + text.encode("utf-16-be"), "UTF-16"),
    "UTF-32": (lambda text: text.encode("utf-32"), "UTF-32"),
    "UTF-16 without a mark": (lambda text: text.encode("utf-16-le"), "UTF-16"),
    "carriage returns": (lambda text: text.replace("\n", "\r").encode(), "carriage returns alone"),
    "both line ends": (lambda text: text.replace("\n", "\r\n").encode(), ""),
    "the end of a DOS file": (lambda text: text.encode() + b"\x1a", "bytes that are no text"),
}


@pytest.mark.parametrize("way", WRITTEN)
@pytest.mark.parametrize(
    "name", ["a.cube", "shaper.cube", "a.3dl", "a.csp", "curve.spi1d", "a.spi3d", "a.cub", "a.vlt"]
)
def test_text_is_read_however_it_is_encoded_and_what_stumbles_over_it_is_said(
    tmp_path: Path, name: str, way: str
) -> None:
    encode, says = WRITTEN[way]
    sound = read_lut(write(tmp_path, name, SOUND[name]))
    path = tmp_path / name
    path.write_bytes(encode(SOUND[name]))
    x = np.random.default_rng(0).random((100, 3)).astype(np.float32)
    np.testing.assert_array_equal(read_lut(path)(x.astype(np.float64)), sound(x.astype(np.float64)))
    graded = evaluate(LutRecipe(path).grade(Path()).processor, x)
    np.testing.assert_allclose(graded, sound(x.astype(np.float64)), atol=1e-5)
    checked, applied = messages(path)
    assert bool(checked) == bool(applied) == bool(says)
    assert says in checked and says in applied


@pytest.mark.parametrize("name", ["shaper.cube", "a.csp", "curve.spi1d", "houdini.lut"])
def test_comments_between_numbers_tabs_and_indents_are_read(tmp_path: Path, name: str) -> None:
    sound_ops = read_lut(write(tmp_path, name, SOUND[name])).ops
    at = SOUND[name].rindex("1.0")
    line = SOUND[name].rindex("\n", 0, at) + 1
    commented = SOUND[name][:line] + "# a note, 0,5\n" + SOUND[name][line:]
    path = write(tmp_path, name, commented)
    assert "comments between its numbers" in messages(path)[0]
    assert repr(read_lut(path).ops) == repr(sound_ops)
    path.write_text(SOUND[name].replace(".0 ", ".0\t"))
    assert repr(read_lut(path).ops) == repr(sound_ops)


def test_a_cube_in_two_dialects_at_once_is_read(tmp_path: Path) -> None:
    """As LUTCalc writes for Resolve: a title and an input range."""
    text = 'TITLE "SLog3 to 709"\nLUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE 0.0 1.0\n' + table("0.{r} 0.{g} 0.{b}\n")
    path = write(tmp_path, "calc.cube", text)
    lut = read_lut(path)
    assert lut.title == "SLog3 to 709"
    np.testing.assert_allclose(lut([1.0, 0.0, 1.0]), [0.1, 0.0, 0.1], atol=1e-6)
    for message in messages(path):
        assert "TITLE together with LUT_3D_INPUT_RANGE" in message and "delete the line" in message
    shaped = 'TITLE "x"\nDOMAIN_MIN 0 0 0\nDOMAIN_MAX 1 1 1\n' + SOUND["shaper.cube"]
    assert read_lut(write(tmp_path, "shaped.cube", shaped)).summary == "Curve 2 → Cube 2³"
    contradicting = text.replace("LUT_3D_SIZE", "DOMAIN_MAX 2 2 2\nLUT_3D_SIZE")
    with pytest.raises(LutError, match="another range"):
        read_lut(write(tmp_path, "calc.cube", contradicting))


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("LUT_IN_VIDEO_RANGE", "line 2: LUT_IN_VIDEO_RANGE: its numbers are video levels"),
        ("lut_out_video_range", "line 2: lut_out_video_range: its numbers are video levels"),
        ("CREATED 2024", 'line 2: "CREATED" is no word of the header'),
        ("A note without its sign", 'line 2: "A" is no word of the header'),
    ],
)
def test_a_header_line_that_no_dialect_has_is_named(tmp_path: Path, line: str, says: str) -> None:
    """OpenColorIO names the title instead, which is sound."""
    for message in messages(write(tmp_path, "a.cube", SOUND["a.cube"].replace("\n", f"\n{line}\n", 1))):
        assert says in message


def test_each_title_beside_an_input_range_is_left_out(tmp_path: Path) -> None:
    text = 'TITLE "a"\nTITLE "b"\nLUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE 0.0 1.0\n' + table("0.{r} 0.{g} 0.{b}\n")
    lut = read_lut(write(tmp_path, "a.cube", text))
    np.testing.assert_allclose(lut([1.0, 0.0, 1.0]), [0.1, 0.0, 0.1], atol=1e-6)


def test_the_command_prints_what_check_calls_a_problem(lutforge: CommandLine, tmp_path: Path) -> None:
    write(tmp_path, "look.cube", "LUT_3D_SIZE 2\n" + table("{r}023 {g}023 {b}023\n").replace("0023", "0"))
    PIL.Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg")
    output = lutforge("apply", "look.cube", "a.jpg", "-o", "out", cwd=tmp_path).stderr
    assert "look.cube: its numbers are whole and run to 1023, as codes" in output
