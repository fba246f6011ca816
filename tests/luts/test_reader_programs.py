"""The real programs show what the LUT file holds. Skipped where a program is not installed."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.colour.colour_difference import delta_e_2000
from lutforge.luts.bake import bake
from lutforge.luts.lut import Lut
from lutforge.luts.write import write_lut
from tests.luts.reader_programs import PROGRAMS, Program, rendered, smooth_look

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


@pytest.fixture(scope="module")
def luts() -> dict[str, Lut]:
    return {method: bake(smooth_look, 33, interpolation=method) for method in ("trilinear", "tetrahedral")}


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: f"{program.name}{program.suffix}")
def test_the_program_renders_what_the_file_holds(tmp_path: Path, program: Program, luts: dict[str, Lut]) -> None:
    if program.command is None:
        pytest.skip(f"{program.commands[0]} is not installed (Debian package {program.package})")
    written = write_lut(luts[program.interpolation], tmp_path / f"lut{program.suffix}", program.dialect)
    x, got = rendered(program, written.path, tmp_path)
    assert written.lut is not None
    wanted = np.clip(written.lut(x), 0.0, 1.0)
    assert np.abs(got - wanted).max() < LIMITS[program.name, program.suffix]
    error = delta_e_2000(got, smooth_look(x))
    assert error.mean() < 0.4
    assert error.max() < 2.0
