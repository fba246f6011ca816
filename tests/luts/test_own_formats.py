"""The format that OpenColorIO does not read, .vlt, by its description; and the numbers of texts."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.luts.formats.text import DIGITS, EXACT, rows
from lutforge.luts.reading import read_lut
from lutforge.pipeline.baking import bake


def look(x: ArrayLike) -> NDArray[np.float64]:
    """A steep look."""
    y = np.asarray(x, dtype=np.float64) ** 0.4
    return np.asarray(np.clip(y @ np.array([[1.1, -0.1, 0.0], [0.05, 0.9, 0.05], [0.0, -0.2, 1.2]]).T, 0.0, 1.0))


def parsed(path: Path) -> np.ndarray:
    """(17, 17, 17, 3), red index first: three header lines, a blank one, then codes of 12 bits, red fastest."""
    data = path.read_bytes()
    assert b"\r" not in data
    lines = data.decode("ascii").split("\n")
    assert lines[:4] == ["# panasonic vlt file version 1.0", '# source vlt file ""', "LUT_3D_SIZE 17", ""]
    codes = np.array([line.split() for line in lines[4:-1]], dtype=np.int64)
    assert codes.shape == (17**3, 3)
    assert codes.min() >= 0
    assert codes.max() <= 4095
    return codes.reshape(17, 17, 17, 3).transpose(2, 1, 0, 3) / 4095


def test_a_vlt_is_written_as_published(tmp_path: Path) -> None:
    lut = bake(look, tmp_path / "look.vlt")
    assert lut.cube is not None
    assert np.abs(parsed(tmp_path / "look.vlt") - np.clip(lut.cube.values, 0, 1)).max() <= 0.5 / 4095 + 1e-12
    again = read_lut(tmp_path / "look.vlt")
    assert again.cube is not None
    assert np.array_equal(again.cube.values, parsed(tmp_path / "look.vlt"))


@pytest.mark.parametrize(("line", "text"), [(2, "LUT_3D_SIZE 33"), (4, "0 0 5000"), (4, "0 0 0.5"), (4, "0 0")])
def test_other_numbers_in_a_vlt_are_refused(tmp_path: Path, line: int, text: str) -> None:
    path = tmp_path / "look.vlt"
    bake(look, path)
    lines = path.read_text().split("\n")
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(LutError, match=r"look\.vlt"):
        read_lut(path)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-2 * EXACT, 2 * EXACT)] * 3), max_size=4))
def test_numbers_are_written_as_python_does(numbers: list[tuple[float, float, float]]) -> None:
    numbers += [(0.0, -0.0, -1e-12), (1.0, 0.5, -123.25)]
    rounded = np.round(np.array(numbers), DIGITS) + 0.0
    assert rows(numbers) == "".join(f"{r:.10f} {g:.10f} {b:.10f}\n" for r, g, b in rounded.tolist())
