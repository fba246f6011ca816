"""colour-science reads our files as OpenColorIO does; where two readers disagree, that is an error."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.bake import bake
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.verify import disagreement, verify


def look(x: ArrayLike) -> NDArray[np.float64]:
    mixed = np.asarray(x) ** 2.2 @ np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.05, 0.15, 0.8]]).T
    return np.asarray((0.01 + 0.99 * mixed) ** 0.45)


LIMITS = {"a.cube": 1e-6, "a.resolve.cube": 2e-6, "a.csp": 1e-5, "a.spi1d": 2e-6, "a.spi3d": 2e-6}
"""Measured: 1e-7, 2e-7, 4e-7, 2e-7, 2e-7."""


@pytest.mark.parametrize("method", INTERPOLATIONS)
@pytest.mark.parametrize("name", sorted(LIMITS))
def test_two_readers_agree(tmp_path: Path, name: str, method: Interpolation) -> None:
    lut = bake(look, tmp_path / name, size=17, interpolation=method)
    error = verify(tmp_path / name, look, lut)
    assert error.second is not None
    assert error.second < LIMITS[name]
    assert "colour-science agrees" in str(error)


def test_a_range_beyond_one_is_read_alike(tmp_path: Path) -> None:
    for name in ("a.resolve.cube", "a.csp", "a.spi1d"):
        lut = bake(look, tmp_path / name, size=9, highest=8.0)
        error = verify(tmp_path / name, look, lut, display_referred=False)
        assert error.second is not None
        assert error.second < 5e-4


def test_a_disagreement_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a.resolve.cube"
    bake(look, path, size=9)
    x = np.random.default_rng(0).random((500, 3))
    y = evaluate(file_processor(path), x).astype(np.float64)
    assert disagreement([path], x, y, "tetrahedral") is not None
    with pytest.raises(LutError, match="read it differently"):
        disagreement([path], x, y + 0.01, "tetrahedral")
    path.write_text(path.read_text().replace("LUT_3D_SIZE 9", "LUT_3D_SIZE 8"))
    with pytest.raises(LutError, match="colour-science cannot read it"):
        disagreement([path], x, y, "tetrahedral")


def test_other_formats_have_one_reader(tmp_path: Path) -> None:
    for name in ("a.clf", "a.png"):
        lut = bake(look, tmp_path / name, size=9)
        assert verify(tmp_path / name, look, lut).second is None
