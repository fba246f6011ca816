"""LutForge: calibrate a camera from its RAW and JPEG files, and bake its rendering into LUTs and OCIO configs.

    import lutforge as lf

    samples = lf.read_samples("samples.csv")  # or lf.sample(["a.CRW", …])
    profile = lf.calibrate(samples)
    transform = profile.refinish("standard/tungsten", "vivid/5200K", ev=0.5)
    lut = lf.bake(transform, "fix.clf")  # print(lut) shows its operations, the file's error and notes; lut(pixels)

Each function is what the command of that name runs; help(lf.bake) and so on describe them.

    sample, read_samples, SampleSet         RAW files or a table → colour samples
    calibrate, CalibrationOptions           samples → a profile
    response, import_published              exposures without RAW, or the thesis's model folders → a profile
    load_profile, CameraProfile             a profile: render, linearize, refinish, save
    evaluate, Evaluation, report            a profile → its errors, or a page about it
    transform, load_transfer                words → a transform, also from one camera to another
    bake, read_lut, Lut                     a transform → LUT files; a LUT file → operations
    write_config, build_config              profiles → an OpenColorIO config, as files or in memory
    write_kit                               a profile → a folder that makes one program show the camera's look
    apply                                   a LUT, profiles or a config, and images → graded images
    LutForgeError                           every error: one line that says what is wrong, where, and what to do

The names are loaded when they are first used, so that importing the package stays fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from lutforge.calibration.options import CalibrationOptions as CalibrationOptions
    from lutforge.errors import LutForgeError as LutForgeError
    from lutforge.evaluation.evaluation import Evaluation as Evaluation
    from lutforge.luts.reading import read_lut as read_lut
    from lutforge.luts.sequence import Lut as Lut
    from lutforge.model.camera_profile import CameraProfile as CameraProfile
    from lutforge.model.camera_profile import load_profile as load_profile
    from lutforge.model.published_model import import_published as import_published
    from lutforge.model.raw_transfer import load_transfer as load_transfer
    from lutforge.ocio.config import build_config as build_config
    from lutforge.pipeline.baking import bake as bake
    from lutforge.pipeline.calibration import calibrate as calibrate
    from lutforge.pipeline.configs import write_config as write_config
    from lutforge.pipeline.evaluation import evaluate as evaluate
    from lutforge.pipeline.grading import apply as apply
    from lutforge.pipeline.kits import write_kit as write_kit
    from lutforge.pipeline.reports import report as report
    from lutforge.pipeline.response import response as response
    from lutforge.pipeline.sampling import sample as sample
    from lutforge.pipeline.transforms import transform as transform
    from lutforge.samples.sample_set import SampleSet as SampleSet
    from lutforge.samples.table import read_samples as read_samples

# No __all__: with it, help() would print every class whole.
_HOMES = {
    "CalibrationOptions": "calibration.options",
    "CameraProfile": "model.camera_profile",
    "Evaluation": "evaluation.evaluation",
    "Lut": "luts.sequence",
    "LutForgeError": "errors",
    "SampleSet": "samples.sample_set",
    "apply": "pipeline.grading",
    "bake": "pipeline.baking",
    "build_config": "ocio.config",
    "calibrate": "pipeline.calibration",
    "evaluate": "pipeline.evaluation",
    "import_published": "model.published_model",
    "load_profile": "model.camera_profile",
    "load_transfer": "model.raw_transfer",
    "read_lut": "luts.reading",
    "read_samples": "samples.table",
    "report": "pipeline.reports",
    "response": "pipeline.response",
    "sample": "pipeline.sampling",
    "transform": "pipeline.transforms",
    "write_config": "pipeline.configs",
    "write_kit": "pipeline.kits",
}
"""The public names, and the modules that they are in."""


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'lutforge' has no attribute '{name}'")
    value = getattr(import_module(f"lutforge.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*_HOMES, "__version__"])
