"""Scene-linear light through a camera: what the JPEG would be if the camera had seen it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.colour.scene_spaces import SceneSpace, from_linear_srgb
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.transform import Transform
from lutforge.settings import Selector

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneRender:
    """y = render(M x), equation (4.1) from scene-linear x, values beyond 1 and below 0 included.

    to_raw: M (3, 3), exposure included; highest: the largest scene value that the camera does not clip, in any colour.
    """

    to_raw: Array
    render: Transform

    def __call__(self, x: ArrayLike) -> Array:
        """Scene-linear (…, 3) → encoded (…, 3)."""
        return self.render(np.asarray(x, dtype=np.float64) @ self.to_raw.T)

    @property
    def highest(self) -> float:
        """No scene-linear channel is larger than this where no channel of the balanced RAW is clipped."""
        gain = np.asarray(getattr(self.render, "gain", np.ones(3)))
        back = np.linalg.inv(gain[:, None] * self.to_raw)
        return float(np.maximum(back, 0.0).sum(axis=1).max())


def through_camera(
    profile: CameraProfile, to: str | Selector, space: SceneSpace, ev: float = 0.0, model: ModelName | None = None
) -> SceneRender:
    """Scene-linear footage → the camera's JPEG. 1 in all channels saturates the camera at ev 0; ev: exposure in stops.

    Raises SettingsError on an exposure beyond ±20 stops, or a RAW space, which `CameraProfile.render` takes.
    """
    if not -20.0 <= ev <= 20.0:
        raise SettingsError(f"exposure {ev:g} EV is not within ±20 stops")
    if space == "raw":
        raise SettingsError("scene-linear footage is in linear-srgb, acescg or aces2065-1, not raw")
    selector = profile.selector(to)
    from_raw = from_linear_srgb(space) @ profile.raw_to_linear_srgb(selector)
    return SceneRender(2.0**ev * np.linalg.inv(from_raw), profile.render(selector, model))
