"""A calibrated style as functions with slopes, the same for lattices and physical models."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import grid
from lutforge.model.profile_data import PictureStyle
from lutforge.model.transform import Gain, Transform
from lutforge.settings import Selector

Colours = Callable[[Array], Array]
"""A function of colours (…, 3) → (…, 3)."""


@dataclass(frozen=True, eq=False)
class Rendering:
    """A style of a camera. linearize: encoded → balanced RAW; render: balanced RAW → encoded; matrix: Ts (3, 3).

    white_balances: multipliers (3,) by name. encoders: of the JPEGs that it was calibrated from, () where unknown.
    slack: the median length of the residual of codes that it was calibrated from; 0 if unknown.
    """

    camera: str
    style: str
    white_balances: dict[str, Array]
    linearize: Colours
    render: Colours
    matrix: Array
    encoders: tuple[str, ...] = ()
    slack: float = 0.0

    def residual(self, encoded: Array) -> Array:
        """The length (n,) of render(linearize(I)) − I, encoded, for codes (n, 3)."""
        again = self.render(np.clip(self.linearize(encoded), 0.0, 1.0))
        return np.asarray(np.linalg.norm(again - encoded, axis=-1))

    def to_linear_srgb(self, encoded: Array) -> Array:
        """Encoded (n, 3) → linear sRGB of the scene."""
        return np.asarray(self.linearize(encoded) @ self.matrix.T)

    def slopes(self, encoded: Array) -> tuple[Array, Array]:
        """Balanced RAW (n, 3) of encoded colours, and the rendering's slopes there (n, 3, 3), in codes of 255.

        Slopes are means over colours that lie apart by `nearby`, encoded, as a lattice's jump at its nodes; they are
        taken from differences of `linear`, within which a tone curve hardly bends.
        """
        nearby, linear = 0.02, 2e-3
        around = np.concatenate([np.zeros((1, 3)), nearby * np.eye(3), -nearby * np.eye(3)])
        spread = np.clip(encoded[None] + around[:, None], 0.0, 1.0)
        scene = np.clip(self.linearize(spread), 0.0, 1.0)
        slopes = [
            (self.render(np.clip(scene + step, 0.0, 1.0)) - self.render(np.clip(scene - step, 0.0, 1.0))).mean(axis=0)
            for step in linear * np.eye(3)
        ]
        return scene[0], np.stack(slopes, axis=-1) * (255.0 / (2 * linear))


def renderings(profile: CameraProfile) -> tuple[Rendering, ...]:
    """One for each style of a camera whose own RAW was calibrated."""
    names = list(profile.white_balances)
    multipliers = {name: np.array(profile.white_balances[name].multipliers) for name in names}
    middle = sorted(names, key=lambda name: float(multipliers[name][0] / multipliers[name][2]))[len(names) // 2]
    found = []
    for style in profile.styles:
        selector = Selector(style, middle)
        raw = profile.linearize(selector)
        balanced = Transform((*raw.stages, Gain(profile.multipliers(selector))))
        render = profile.render(selector).without_gain()
        rendering = Rendering(profile.camera, style, multipliers, balanced, render, profile.matrix, profile.encoders)
        found.append(replace(rendering, slack=_slack(rendering, profile.styles[style])))
    return tuple(found)


def _slack(rendering: Rendering, style: PictureStyle) -> float:
    if style.linearize is None or not np.any(style.coverage.get("linearize", 0.0)):
        return 0.0
    codes = grid(style.linearize.levels)[style.coverage["linearize"] > 0]
    return float(np.median(rendering.residual(codes)))
