"""Panasonic's tables, parsed here by their published description, not by the package's own reader."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.errors import LutError
from lutforge.luts.reading import read_lut
from lutforge.pipeline.baking import bake
from tests.luts.test_dctl import look


def parsed(path: Path) -> np.ndarray:
    """(17, 17, 17, 3), red index first: three header lines, a blank one, then codes of 12 bits, red fastest."""
    data = path.read_bytes()
    assert b"\r" not in data
    lines = data.decode("ascii").split("\n")
    assert lines[:4] == ["# panasonic vlt file version 1.0", '# source vlt file ""', "LUT_3D_SIZE 17", ""]
    rows = np.array([line.split() for line in lines[4:-1]], dtype=np.int64)
    assert rows.shape == (17**3, 3)
    assert rows.min() >= 0
    assert rows.max() <= 4095
    return rows.reshape(17, 17, 17, 3).transpose(2, 1, 0, 3) / 4095


def test_it_is_written_as_published(tmp_path: Path) -> None:
    lut = bake(look, tmp_path / "look.vlt")
    assert lut.cube is not None
    assert np.abs(parsed(tmp_path / "look.vlt") - np.clip(lut.cube.values, 0, 1)).max() <= 0.5 / 4095 + 1e-12
    again = read_lut(tmp_path / "look.vlt")
    assert again.cube is not None
    assert np.array_equal(again.cube.values, parsed(tmp_path / "look.vlt"))


@pytest.mark.parametrize(("line", "text"), [(2, "LUT_3D_SIZE 33"), (4, "0 0 5000"), (4, "0 0 0.5"), (4, "0 0")])
def test_other_numbers_are_refused(tmp_path: Path, line: int, text: str) -> None:
    path = tmp_path / "look.vlt"
    bake(look, path)
    lines = path.read_text().split("\n")
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(LutError, match=r"look\.vlt"):
        read_lut(path)
