"""colour-science reads our files as OpenColorIO does."""

from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lutforge.colour.srgb import delta_e_2000
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.reading import file_processor
from lutforge.luts.sequence import evaluate
from lutforge.pipeline.baking import bake
from tests.luts.reader_programs import PROGRAMS, Program, baked, rendered, smooth_look


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


# --- The real programs show what the LUT file holds. Skipped where a program is not installed ------------------------


LIMITS = {
    ("ffmpeg lut3d", ".cube"): 1e-4,
    ("ffmpeg lut3d", ".csp"): 2e-3,
    ("oiiotool", ".clf"): 1e-4,
    ("oiiotool", ".cube"): 1e-4,
    ("oiiotool", ".csp"): 1e-4,
    ("ImageMagick", ".png"): 0.02,
    ("G'MIC", ".cube"): 0.06,
    ("G'MIC", ".png"): 0.06,
    ("darktable", ".cube"): 0.02,
    ("RawTherapee", ".tif"): 0.02,
}
"""Largest difference of a channel from the LUT in the file: the first do the same sums, the others their own rounding,
interpolation, or a round trip through their working space; G'MIC works in 8 bits."""


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: f"{program.name}{program.suffix}")
def test_the_program_renders_what_the_file_holds(tmp_path: Path, program: Program) -> None:
    if program.command is None:
        pytest.skip(f"{program.commands[0]} is not installed (Debian package {program.package})")
    lut = baked(program, smooth_look, tmp_path)
    x, got = rendered(program, tmp_path / f"lut{program.suffix}", tmp_path)
    assert np.abs(got - np.clip(lut(x), 0.0, 1.0)).max() < LIMITS[program.name, program.suffix]
    error = delta_e_2000(got, smooth_look(x))
    assert error.mean() < 0.4
    assert error.max() < 2.0
