"""LutForge: calibrate a camera from its RAW and JPEG files, and bake its rendering into LUTs and OCIO configs.

    import lutforge as lf

    samples = lf.read_samples("samples.csv")  # or lf.sample(["a.CRW", …])
    profile = lf.calibrate(samples)
    transform = profile.refinish("standard/tungsten", "vivid/5200K", ev=0.5)
    lut = lf.bake(transform, size=33)  # a sequence of operations: print(lut), lut(pixels)
    lut.write("fix.clf")
    lf.bake(transform, "fix.cube")  # baked to the form of that file, and written

The names are loaded when they are first used, so that importing the package stays fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.errors import LutForgeError
    from lutforge.evaluation.evaluation import Evaluation
    from lutforge.images.raw import read_raw
    from lutforge.luts.bake import bake
    from lutforge.luts.check import check_lut
    from lutforge.luts.reading import read_lut
    from lutforge.luts.sequence import Lut
    from lutforge.luts.verify import verify
    from lutforge.model.camera_profile import CameraProfile, load_profile, match
    from lutforge.model.profile_file import save_profile
    from lutforge.model.published_model import import_published
    from lutforge.ocio.config import build_config, write_config
    from lutforge.pipeline.calibration import calibrate
    from lutforge.pipeline.evaluation import evaluate
    from lutforge.pipeline.grading import apply
    from lutforge.pipeline.reports import report
    from lutforge.pipeline.response import response_from_bracket
    from lutforge.pipeline.sampling import sample
    from lutforge.pipeline.transforms import transform
    from lutforge.samples.sample_set import SampleSet
    from lutforge.samples.table import read_samples, write_samples

__all__ = [
    "CalibrationOptions",
    "CameraProfile",
    "Evaluation",
    "Lut",
    "LutForgeError",
    "SampleSet",
    "apply",
    "bake",
    "build_config",
    "calibrate",
    "check_lut",
    "evaluate",
    "import_published",
    "load_profile",
    "match",
    "read_lut",
    "read_raw",
    "read_samples",
    "report",
    "response_from_bracket",
    "sample",
    "save_profile",
    "transform",
    "verify",
    "write_config",
    "write_samples",
]

_HOMES = {
    "CalibrationOptions": "calibration.options",
    "CameraProfile": "model.camera_profile",
    "Evaluation": "evaluation.evaluation",
    "Lut": "luts.sequence",
    "LutForgeError": "errors",
    "SampleSet": "samples.sample_set",
    "apply": "pipeline.grading",
    "bake": "luts.bake",
    "build_config": "ocio.config",
    "calibrate": "pipeline.calibration",
    "check_lut": "luts.check",
    "evaluate": "pipeline.evaluation",
    "import_published": "model.published_model",
    "load_profile": "model.camera_profile",
    "match": "model.camera_profile",
    "read_lut": "luts.reading",
    "read_raw": "images.raw",
    "read_samples": "samples.table",
    "report": "pipeline.reports",
    "response_from_bracket": "pipeline.response",
    "sample": "pipeline.sampling",
    "save_profile": "model.profile_file",
    "transform": "pipeline.transforms",
    "verify": "luts.verify",
    "write_config": "ocio.config",
    "write_samples": "samples.table",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'lutforge' has no attribute '{name}'")
    value = getattr(import_module(f"lutforge.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
