"""colour-science reads our files as OpenColorIO does."""

from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.processor import evaluate
from lutforge.luts.reading import file_processor
from lutforge.pipeline.baking import bake


def look(x: ArrayLike) -> NDArray[np.float64]:
    mixed = np.asarray(x) ** 2.2 @ np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.05, 0.15, 0.8]]).T
    return np.asarray((0.01 + 0.99 * mixed) ** 0.45)


def second_reading(path: Path, x: NDArray[np.float64], method: Interpolation) -> NDArray[np.float64]:
    interpolator = getattr(colour.algebra, f"table_interpolation_{method}")
    dialects = {"a.cube": "Iridas Cube", "a.resolve.cube": "Resolve Cube"}
    sequence = colour.read_LUT(str(path), method=dialects.get(path.name))
    y: Any = x
    for stage in sequence if isinstance(sequence, colour.LUTSequence) else [sequence]:
        y = stage.apply(y, interpolator=interpolator) if isinstance(stage, colour.LUT3D) else stage.apply(y)
    return np.asarray(y, dtype=np.float64)


@pytest.mark.filterwarnings("ignore")  # it warns of tables that it converts to its own domain
@pytest.mark.parametrize("method", INTERPOLATIONS)
@pytest.mark.parametrize("highest", [1.0, 8.0])
@pytest.mark.parametrize("name", ["a.cube", "a.resolve.cube", "a.csp", "a.spi1d", "a.spi3d"])
def test_two_readers_agree(tmp_path: Path, name: str, highest: float, method: Interpolation) -> None:
    if highest > 1 and name in ("a.cube", "a.spi3d"):
        return  # these have no input beyond 1
    path = tmp_path / name
    bake(look, path, size=17, interpolation=method, highest=highest)
    x = np.random.default_rng(0).random((2000, 3)) * highest
    first = evaluate(file_processor(path, method), x)
    # float32 in one of them; OpenColorIO lays a spline through the knots of a .csp.
    np.testing.assert_allclose(second_reading(path, x, method), first, atol=1e-5 if highest == 1 else 5e-4)
