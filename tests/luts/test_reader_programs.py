"""The real programs show what the LUT file holds. Skipped where a program is not installed."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.colour.srgb import delta_e_2000
from tests.luts.reader_programs import PROGRAMS, Program, baked, rendered, smooth_look

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
