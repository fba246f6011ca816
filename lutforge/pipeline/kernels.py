"""Use case: all kernels compiled before they are needed: `python -m lutforge.pipeline.kernels`.

Commands that calibrate begin it where no command did before, so that one core compiles while another reads photographs;
the image of a container or of a render farm's machines may run it, too. What it does is the work itself in small.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lutforge.child_processes import begin
from lutforge.compiled import cache_folder
from lutforge.threads import cores


def compile_ahead() -> None:
    """Begin to compile all kernels beside this process, once after an installation.

    Not where there is one core only, or no folder that keeps them. For the command line: a program that embeds Python
    names itself as Python's executable.
    """
    done = _compiled_mark()
    if cores() > 1 and done is not None and not done.exists():
        begin([sys.executable, "-m", "lutforge.pipeline.kernels"])


def compile_all() -> None:
    """Compile all kernels that sampling, calibration, baking and configs need; those of the lattice fit first.

    These take the longest, and whoever began this process begins with the others.
    """
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.inverse.linearization import InverseOptions
    from lutforge.ocio.config import config_luts
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.calibration import calibrate
    from lutforge.pipeline.sampling import sample
    from lutforge.pipeline.transforms import TransformRequest
    from lutforge.simulate.camera import nikon_d5100
    from lutforge.simulate.photograph import CameraSettings, photograph
    from lutforge.simulate.scenes import SCENES
    from lutforge.solvers.lattice_regression import Regularisation, fit_lattice

    colours = np.random.default_rng(0).random((100, 3))
    fit_lattice(colours, colours, (np.linspace(0, 1, 5),) * 3, Regularisation(thin_plate=0.0))
    camera = nikon_d5100()
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for number in range(3):
            settings = CameraSettings("standard", "daylight", camera.nominal_exposure_s * 2.0**-number)
            photograph(camera, SCENES["still-life"](404, 608, number), settings, folder, f"{number}")
        profile = calibrate(sample(folder), CalibrationOptions(size=5))
        wanted = TransformRequest("refinish", "standard/daylight", "standard/daylight", 1.0)
        bake_files(profile, wanted, [folder / "baked.clf", folder / "baked.cube"], size=5)
        config_luts([profile], InverseOptions(size=9))
    mark = _compiled_mark()
    if mark is not None:
        mark.touch()


def _compiled_mark() -> Path | None:
    """The file that says that all kernels are compiled for this Python and numba; None where none are kept."""
    import numba

    folder = cache_folder()
    return None if folder is None else folder / f"all-{sys.implementation.cache_tag}-numba-{numba.__version__}"


if __name__ == "__main__":
    compile_all()
