"""Sample tables: what is written is read, and what is wrong is said in one line with its place."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from lutforge.errors import SampleError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import PictureStyle
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.columns import NUMBER_COLUMNS
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.samples.table_file import is_table
from tests.cases.same_bytes import same_bytes
from tests.cases.samples import made_samples

HEADER = "camera,style,white_balance,shot,patch,exposure_s,raw_r,raw_g,raw_b,srgb_r,srgb_g,srgb_b,wb_r,wb_g,wb_b"
ROW = "Canon S40,standard,daylight,a,p1,0.25,0.1,0.2,0.3,0.4,0.5,0.6,2,1,1.5"

NAMES = st.text(st.characters(exclude_categories=["C", "Z"], codec="utf-8"), min_size=1, max_size=12)


def unit(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


@st.composite
def sample_sets(draw: st.DrawFn) -> SampleSet:
    n = draw(st.integers(1, 6))

    def text() -> "np.ndarray[tuple[int], np.dtype[np.str_]]":
        return np.array(draw(st.lists(NAMES, min_size=n, max_size=n)), dtype=np.str_)

    def numbers(low: float, high: float, columns: int = 3) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
        return draw(hnp.arrays(np.float64, (n, columns), elements=unit(low, high)))

    wb = numbers(0.01, 100.0)
    wb[:, 1] = 1.0
    wb[draw(hnp.arrays(np.bool_, n))] = np.nan
    exposure = numbers(1e-6, 1000.0, 1)[:, 0]
    exposure[draw(hnp.arrays(np.bool_, n))] = np.nan
    camera = text()
    samples = SampleSet(
        camera, text(), text(), text(), text(), exposure, numbers(-0.05, 1), numbers(0, 1), wb,
        text() if draw(st.booleans()) else camera,
    )  # fmt: skip
    if draw(st.booleans()):
        return samples
    return replace(samples, position=numbers(-1, 1, 2), lens=text(), aperture=numbers(0.7, 64, 1)[:, 0])


def assert_same(a: SampleSet, b: SampleSet, tolerance: float) -> None:
    for name in ("camera", "style", "white_balance", "shot", "patch", "raw_camera", "lens"):
        assert getattr(a, name).tolist() == getattr(b, name).tolist()
    for name in ("raw", "srgb"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=tolerance)
    for name in ("wb", "exposure_s", "position", "focal_mm", "aperture"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
@given(samples=sample_sets())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_round_trip(samples: SampleSet, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"samples{suffix}"
    samples.save(path)
    assert_same(read_samples(path), samples, 1e-9 if suffix == ".csv" else 0)
    first = path.read_bytes()
    read_samples(path).save(path)
    assert suffix == ".npz" or same_bytes(path, first)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_matrix_with_negative_numbers_comes_back(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"samples{suffix}"
    samples = made_samples()
    matrix = np.array([0.9, -0.3, -0.1, -0.4, 1.2, 0.2, -0.1, 0.2, 0.6])
    replace(samples, from_xyz=np.tile(matrix, (len(samples), 1))).save(path)
    np.testing.assert_allclose(read_samples(path).from_xyz[0], matrix, atol=1e-9)


@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=300).map(str.encode)))
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.parametrize("prefix", ["", f"{HEADER}\n", f"{HEADER}\n{ROW}\n"])
@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_arbitrary_bytes_never_crash(content: bytes, prefix: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"fuzz{suffix}"
    path.write_bytes(prefix.encode() + content)
    try:
        assert len(read_samples(path)) > 0
    except SampleError as error:
        assert "\n" not in str(error)
        assert "fuzz" in str(error)


def with_cell(column: str, value: str) -> str:
    cells = ROW.split(",")
    cells[HEADER.split(",").index(column)] = value
    return f"{HEADER}\n{ROW}\n{','.join(cells)}\n"


LAST = with_cell("raw_r", "?").split("\n")[2]
ILLEGAL = {
    "missing column": (f"{HEADER.replace('raw_g', 'x').replace('shot', 'y')}\n", "columns shot, raw_g"),
    "one multiplier column": (f"{HEADER.replace(',wb_b', ',z')}\n{ROW}\n", "missing column wb_b"),
    "not a number": (with_cell("raw_r", "abc"), "line 3: raw_r is 'abc', not a number"),
    "decimal comma": (with_cell("raw_r", '"0,5"'), "line 3: raw_r is '0,5', not a number; write"),
    "nan": (with_cell("srgb_g", "nan"), "line 3: srgb_g is nan"),
    "infinite": (with_cell("raw_b", "inf"), "line 3: raw_b is inf"),
    "overflow": (with_cell("exposure_s", "1e999"), "line 3: exposure_s is 1e999"),
    "empty colour": (with_cell("raw_r", ""), "line 3: raw_r is empty"),
    "8-bit": (with_cell("srgb_r", "128"), "line 3: srgb_r is 128; sRGB lies in [0, 1]: divide 8-bit"),
    "raw too high": (with_cell("raw_r", "1.01"), "line 3: raw_r is 1.01; RAW lies in"),
    "raw too low": (with_cell("raw_r", "-0.06"), "line 3: raw_r is -0.06"),
    "no exposure": (with_cell("exposure_s", "0"), "line 3: exposure_s is 0; the exposure time in seconds is"),
    "negative multiplier": (with_cell("wb_r", "-1"), "line 3: wb_r is -1; the multiplier is positive"),
    "two multipliers": (with_cell("wb_r", ""), "line 3: wb_r,wb_g,wb_b is ',1,1.5'; give all three"),
    "absurd multiplier": (with_cell("wb_r", "1e300"), "no camera has such"),
    "x alone": (HEADER + ",x\n" + ROW + ",0.5\n", "missing column y"),
    "x in pixels": (HEADER + ",x,y\n" + ROW + ",0.5,640\n", "line 2: y is 640; positions lie in"),
    "negative aperture": (HEADER + ",aperture\n" + ROW + ",-8\n", "line 2: aperture is -8; the f-number is positive"),
    "no style": (with_cell("style", ""), "line 3: style is empty; write the style"),
    "long cell": (with_cell("shot", "x" * 5000), "line 3: shot holds 5000 characters"),
    "short row": (f"{HEADER}\n{ROW}\n{ROW[:-10]}\n", "line 3: 12 cells where the header has"),
    "long row": (f"{HEADER}\n{ROW}\n{ROW},7\n", "line 3: 16 cells where the header has"),
    "later line": (with_cell("shot", '"two\nlines"') + LAST, "line 5: raw_r is '?'"),
    "blank line": (f"{HEADER}\n\n{LAST}", "line 3: raw_r is '?'"),
    "header only": (f"{HEADER}\n", "a header but no samples"),
    "empty": ("", "the file is empty"),
    "doubled column": (f"{HEADER},shot\n{ROW},b\n", "column 'shot' occurs twice"),
    "many columns": (f"{HEADER}{''.join(f',x{i}' for i in range(2000))}\n", "2015 columns"),
    "semicolons": (f"{HEADER};\n{ROW}\n".replace(",", ";"), "separated by semicolons; save it comma"),
    "tabs": (f"{HEADER}\n{ROW}\n".replace(",", "\t"), "separated by tabs"),
    "old line ends": (f"{HEADER}\r{ROW}\r", "CR alone"),
    "no newline": ("x" * 100_000, "no header within"),
    "open quote": ('"camera,style\n', "missing columns|header cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("name", ILLEGAL)
def test_illegal(name: str, tmp_path: Path) -> None:
    content, message = ILLEGAL[name]
    path = tmp_path / "samples.csv"
    path.write_bytes(content.encode())
    with pytest.raises(SampleError) as caught:
        read_samples(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert any(part in text for part in message.split("|")), text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (f"{HEADER}\n{ROW}\n".encode("utf-16"), "not UTF-8 text"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not UTF-8 text"),
        (b"\x1f\x8b\x08" + b"\xff" * 50, "not UTF-8"),
        (f"{HEADER}\n{ROW}\n{ROW.replace('standard', 'förtrollad')}\n".encode("latin-1"), "not UTF-8 text"),
        (f"{HEADER},wärme\n".encode("latin-1"), "line 1: byte 105 is not UTF-8"),
    ],
)
def test_binary(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "samples.csv"
    path.write_bytes(content)
    with pytest.raises(SampleError, match=message):
        read_samples(path)


def test_other_paths(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "none.csv", "no such file"),
        (tmp_path / "samples.xlsx", r"\.csv or \.npz"),
        (tmp_path, r"\.csv or \.npz"),
    ):
        with pytest.raises(SampleError, match=message):
            read_samples(path)
    (tmp_path / "dir.csv").mkdir()
    with pytest.raises(SampleError, match="a folder"):
        read_samples(tmp_path / "dir.csv")


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.rstrip("\n"),
        lambda text: text.replace(",", " , "),
        lambda text: "\n".join('"' + line.replace(",", '","') + '"' for line in text.splitlines()),
        lambda text: text.replace("\n", ",\n"),
        lambda text: text + "\n\n",
        lambda text: text.upper().replace("CANON", "Canon").replace("STANDARD", "standard")
        .replace("DAYLIGHT", "daylight").replace(",A,P1", ",a,p1"),
    ],
    ids=["bom", "crlf", "last line end", "blanks", "quoted", "trailing commas", "blank lines", "capitals"],
)  # fmt: skip
def test_dialects(change: "object", tmp_path: Path) -> None:
    path = tmp_path / "samples.csv"
    assert callable(change)
    path.write_bytes(change(f"{HEADER}\n{ROW}\n{ROW}\n").encode())
    samples = read_samples(path)
    assert len(samples) == 2
    assert samples.camera.tolist() == ["Canon S40"] * 2
    assert samples.patch.tolist() == ["p1"] * 2
    np.testing.assert_array_equal(samples.raw, [[0.1, 0.2, 0.3]] * 2)
    np.testing.assert_array_equal(samples.wb, [[2, 1, 1.5]] * 2)


def one_row() -> dict[str, Any]:
    """The columns of a table of one row, as a script writes them."""
    cells = dict(zip(HEADER.split(","), ROW.split(","), strict=True))
    return {name: np.array([float(cell) if name in NUMBER_COLUMNS else cell]) for name, cell in cells.items()}


def test_columns_in_any_order_and_unknown_ones(tmp_path: Path) -> None:
    columns = dict(sorted((one_row() | {"note": np.array(["ü"])}).items()))
    np.savez(tmp_path / "a.npz", **columns)
    rows = [",".join(columns), ",".join(str(values[0]) for values in columns.values())]
    (tmp_path / "a.csv").write_text("\n".join(rows), encoding="utf-8")
    for path in (tmp_path / "a.csv", tmp_path / "a.npz"):
        samples = read_samples(path)
        np.testing.assert_array_equal(samples.srgb, [[0.4, 0.5, 0.6]])
        assert samples.raw_camera.tolist() == ["Canon S40"]


def test_unknown_and_scaled_multipliers(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    scaled, unknown = ROW.replace("2,1,1.5", "4,2,3"), ROW.replace("0.25", "").replace("2,1,1.5", ",,")
    path.write_text(f"{HEADER}\n{scaled}\n{unknown}\n")
    samples = read_samples(path)
    np.testing.assert_array_equal(samples.wb, [[2, 1, 1.5], [np.nan] * 3])
    np.testing.assert_array_equal(samples.exposure_s, [0.25, np.nan])


def test_noise_and_rounding_are_kept_in_range(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER}\n{ROW.replace('0.1,0.2,0.3,0.4', '-0.04,1.0000005,0.3,1.0000005')}\n")
    samples = read_samples(path)
    np.testing.assert_array_equal(samples.raw, [[-0.04, 1.0, 0.3]])
    np.testing.assert_array_equal(samples.srgb, [[1.0, 0.5, 0.6]])


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("raw_r", [7.0], "row 1: raw_r is 7; RAW lies in"),
        ("raw_r", [np.nan], "row 1: raw_r is nan; write a finite number"),
        ("raw_r", ["x"], "column raw_r holds <U1; write it as numbers"),
        ("raw_r", [0.1, 0.2], "column raw_r has shape"),
        ("raw_r", [[0.1]], "column raw_r has shape"),
        ("style", [1.0], "column style holds float64; write it as text"),
        ("style", ["x" * 300], "column style holds <U300"),
        ("shot", [""], "row 1: shot is empty"),
        ("wb_r", [np.nan], "row 1: wb_r,wb_g,wb_b is 'nan,1,1.5'; give all three"),
    ],
)
def test_illegal_arrays(name: str, values: list[Any], message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **(one_row() | {name: np.array(values)}))
    with pytest.raises(SampleError, match=message):
        read_samples(path)


def test_no_objects_are_unpickled(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **(one_row() | {"style": np.array(["standard"], dtype=object)}))
    with pytest.raises(SampleError, match="column style holds object"):
        read_samples(path)


def test_a_header_that_claims_more_rows_than_the_file_has(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **one_row())
    whole = path.read_bytes()
    for shape in (b"(9999999,)", b"(9,)"):
        with zipfile.ZipFile(io.BytesIO(whole)) as source, zipfile.ZipFile(path, "w") as target:
            for name in source.namelist():
                data = source.read(name)
                target.writestr(name, data.replace(b"(1,), }" + b" " * (len(shape) - 4), shape + b", }", 1))
        with pytest.raises(SampleError, match="not as long as it says"):
            read_samples(path)


def test_a_profile_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    balances = {"daylight": WhiteBalance((2.0, 1.0, 1.5))}
    CameraProfile("A", np.eye(3), balances, {"standard": PictureStyle()}).save(path)
    assert not is_table(path)
    with pytest.raises(SampleError, match="a camera profile; name sample tables"):
        read_samples(path)


def test_nothing_to_write(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER}\n{ROW}\n")
    samples = read_samples(path)
    with pytest.raises(SampleError, match="no samples"):
        samples.select(np.zeros(1, dtype=np.bool_)).save(path)
    with pytest.raises(SampleError, match=r"\.csv or \.npz"):
        samples.save(tmp_path / "a.txt")
    assert len(read_samples(path)) == 1


def test_samples_of_arrays_take_what_stands_for_every_row_once() -> None:
    raw = [[0.1, 0.2, 0.3], [0.2, 0.3, 0.4]]
    samples = SampleSet.from_arrays(raw, raw, camera="Made up", shot=["a", "b"], white_balance="dial", wb=(2, 1, 1.5))
    assert samples.shot.tolist() == ["a", "b"]
    assert samples.raw_camera.tolist() == ["Made up"] * 2
    assert samples.wb.tolist() == [[2, 1, 1.5]] * 2
    assert np.isnan(samples.exposure_s).all()
    assert repr(samples) == "SampleSet(Made up: samples 2, shots 2)"
    with pytest.raises(SampleError, match="column shot does not fit 2 samples"):
        SampleSet.from_arrays(raw, raw, camera="Made up", shot=["a", "b", "c"])
    for wrong in ([0.1, 0.2, 0.3], [[0.1, 0.2, 0.3]]):  # one colour is no column of two
        with pytest.raises(SampleError, match="column srgb has shape"):
            SampleSet.from_arrays(raw, wrong, camera="Made up", shot="a")
    for none in ([[0.1, 0.2, 0.3], [0.2]], "a"):
        with pytest.raises(SampleError, match="column raw is not an array of numbers"):
            SampleSet.from_arrays(none, raw, camera="Made up", shot="a")
