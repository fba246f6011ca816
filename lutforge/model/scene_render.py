"""Scene-linear light through a camera: what the JPEG would be if the camera had seen it."""

import numpy as np

from lutforge.colour.scene_spaces import SceneSpace, from_linear_srgb
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.transform import Linear, Transform
from lutforge.settings import Selector


def through_camera(
    profile: CameraProfile, to: str | Selector, space: SceneSpace, ev: float = 0.0, model: ModelName | None = None
) -> Transform:
    """Scene-linear footage → the camera's JPEG, values beyond 1 and below 0 included: y = render(M x), equation (4.1).

    1 in all channels saturates the camera at ev 0; ev: exposure in stops. Raises SettingsError on an exposure beyond
    ±20 stops, or a RAW space, which `CameraProfile.render` takes.
    """
    if not -20.0 <= ev <= 20.0:
        raise SettingsError(f"exposure {ev:g} EV is not within ±20 stops")
    if space == "raw":
        raise SettingsError("scene-linear footage is in linear-srgb, acescg or aces2065-1, not raw")
    selector = profile.selector(to)
    from_raw = from_linear_srgb(space) @ profile.raw_to_linear_srgb(selector)
    return Transform((Linear(2.0**ev * np.linalg.inv(from_raw)), *profile.render(selector, model).stages))
