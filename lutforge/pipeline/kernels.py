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
    """Begin to compile all kernels beside this process, once after an installation; it may take longer than this one.

    Not where there is one core only, or no folder that keeps them. For the command line: a program that embeds Python
    names itself as Python's executable.
    """
    done = _compiled_mark()
    if cores() > 1 and done is not None and not done.exists():
        begin([sys.executable, "-m", "lutforge.pipeline.kernels"])


def compile_all() -> None:
    """Compile all kernels that sampling, calibration, baking and configs need; those of the lattice fit first.

    These take the longest. Those of sampling come last: whoever began this process compiles them itself meanwhile.
    """
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.colour.srgb import srgb_encode
    from lutforge.inverse.linearization import InverseOptions
    from lutforge.ocio.config import config_luts
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.calibration import calibrate
    from lutforge.pipeline.sampling import sample
    from lutforge.pipeline.transforms import TransformRequest
    from lutforge.samples.sample_set import SampleSet
    from lutforge.simulate.camera import nikon_d5100
    from lutforge.simulate.photograph import CameraSettings, photograph
    from lutforge.simulate.scenes import SCENES
    from lutforge.solvers.lattice_regression import Regularization, fit_lattice

    count, rng = 120, np.random.default_rng(0)
    raw = rng.uniform(0.01, 0.9, (count, 3))
    fit_lattice(raw, raw, (np.linspace(0, 1, 5),) * 3, Regularization(thin_plate=0.0))
    name, style, balance = (np.full(count, word) for word in ("camera", "standard", "daylight"))
    shots = np.array([f"shot {number % 3}" for number in range(count)])
    jpeg, gains = srgb_encode(raw), np.ones((count, 3))
    samples = SampleSet(name, style, balance, shots, shots, np.ones(count), raw, jpeg, gains, name)
    profile = calibrate(samples, CalibrationOptions(size=5))
    wanted = TransformRequest("refinish", "standard/daylight", "standard/daylight", 1.0)
    camera = nikon_d5100()
    settings = CameraSettings("standard", "daylight", camera.nominal_exposure_s)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        bake_files(profile, wanted, [folder / "baked.clf", folder / "baked.cube"], size=5)
        config_luts([profile], InverseOptions(size=9))
        sample(photograph(camera, SCENES["still-life"](404, 608, 0), settings, folder, "shot").dng)
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
