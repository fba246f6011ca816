"""Scene-linear light through a camera: what the JPEG would be if the camera had seen it."""

import numpy as np

from lutforge.colour.rgb_spaces import from_linear_srgb, rgb_space
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.transform import DecodeRgb, Linear, Transform
from lutforge.settings import Selector


def through_camera(
    profile: CameraProfile, to: str | Selector, space: str, ev: float = 0.0, model: ModelName | None = None
) -> Transform:
    """Take footage in a colour space to the camera's JPEG: y = render(M decode(x)), equation (4.1).

    space: a name of `lutforge.colour.rgb_spaces`, scene-linear (values beyond 1 and below 0 included) or encoded.
    Linear 1 in all channels saturates the camera at ev 0; ev: exposure in stops. Raises SettingsError on an exposure
    beyond ±20 stops, an unknown space, or a RAW space, which `CameraProfile.render` takes.
    """
    if not -20.0 <= ev <= 20.0:
        raise SettingsError(f"exposure {ev:g} EV is not within ±20 stops")
    if space == "raw":
        raise SettingsError("footage is in a colour space such as acescg or vlog, not raw")
    encoding = rgb_space(space)
    decode = () if encoding.is_linear else (DecodeRgb(encoding),)
    selector = profile.selector(to)
    from_raw = from_linear_srgb(space) @ profile.raw_to_linear_srgb(selector)
    return Transform((*decode, Linear(2.0**ev * np.linalg.inv(from_raw)), *profile.render(selector, model).stages))
