"""Use case: a profile and samples → what the profile makes of each of them."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import options_from_json
from lutforge.calibration.physical.white_balance import complete_multipliers, with_known_balances
from lutforge.calibration.shots.falloff import at_the_centre
from lutforge.calibration.style import style_data, uniform_lattice_errors
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import DIRECTIONS, Direction
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.settings import Multipliers, Selector


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a profile makes of samples, all (n, 3); NaN where it does not know their style or white balance.

    scene: Ts Tw E, linear sRGB; linearized: the JPEG value backward, to be compared with it. rendered: the JPEG value
    of the RAW; transformed, decoded: that, and the measured JPEG value, through the inverse of the response (of a
    lattice, of its grey axis): what stands before it, h(Ts Tw E), and its measured counterpart.
    """

    scene: Array
    linearized: Array
    rendered: Array
    transformed: Array
    decoded: Array


def predict(profile: CameraProfile, samples: SampleSet) -> Predicted:
    """Render the RAW values of samples and linearize their JPEG values by a profile, each under its own settings."""
    samples = at_the_centre(with_setting_names(samples), profile.falloffs)
    scene, linearized, rendered, transformed, decoded = (np.full_like(samples.raw, np.nan) for _ in range(5))
    multipliers = with_known_balances(samples, profile.white_balances).wb
    columns = [samples.style, samples.white_balance, *np.char.mod("%.9g", multipliers.T)]
    _, first, group = np.unique(np.stack(columns), axis=1, return_index=True, return_inverse=True)
    for index, row in enumerate(first):
        found = _setting(profile, str(samples.style[row]), str(samples.white_balance[row]), multipliers[row])
        if found is None:
            continue
        rows, (selector, gain) = group.ravel() == index, found
        raw, encoded = gain * samples.raw[rows], samples.srgb[rows]
        scene[rows] = raw @ profile.raw_to_linear_srgb(selector).T
        linearized[rows] = profile.linearize(selector, "linear-srgb")(encoded)
        rendered[rows] = np.where(np.isfinite(raw), profile.render(selector)(np.nan_to_num(raw)), np.nan)
        even = np.linspace(0.0, 1.0, 1025)
        tones = np.maximum.accumulate(profile.styles[selector.style].tones(even), axis=0)
        for channel in range(3):
            transformed[rows, channel] = np.interp(rendered[rows, channel], tones[:, channel], even)
            decoded[rows, channel] = np.interp(encoded[:, channel], tones[:, channel], even)
    return Predicted(scene, linearized, rendered, transformed, decoded)


def _setting(profile: CameraProfile, style: str, balance: str, multipliers: Array) -> tuple[Selector, float] | None:
    """The selector of samples and the gain of their setting beyond it; None where the profile does not know it."""
    known = profile.white_balances.get(balance)
    if style not in profile.styles:
        return None
    if known is not None and (profile.raw_camera or np.allclose(known.multipliers, multipliers, rtol=1e-6)):
        return Selector(style, balance), 1.0  # which has its gain, and its own physical model where there are several
    if profile.raw_camera or not np.all(np.isfinite(multipliers)):
        return None
    r, g, b = multipliers.tolist()
    return Selector(style, Multipliers((r / g, 1.0, b / g))), 1.0 if known is None else known.gain


def without_a_model(samples: SampleSet) -> Array:
    """What there is before any fit (n, 3): white-balanced RAW through sRGB's own curve; NaN: unknown white balance."""
    try:
        multipliers, _ = complete_multipliers(with_setting_names(samples))
    except LutForgeError:
        multipliers = samples.wb
    return srgb_encode(np.clip(samples.raw * multipliers, 0.0, 1.0))


def node_level_errors(
    profile: CameraProfile, samples: SampleSet
) -> dict[tuple[str, Direction], tuple[Array, Array, Array]]:
    """By style and direction, per axis the histogram of the squared error of a uniform lattice (thesis, Fig. 5.4).

    Raises CalibrationError where the samples do not determine the lattices.
    """
    samples = with_setting_names(samples)
    data, _ = style_data(samples, complete_multipliers(samples)[0])
    options = options_from_json(profile.options)
    return {
        (name, direction): uniform_lattice_errors(style, options, direction)
        for name, style in data.items()
        if name in profile.styles
        for direction in DIRECTIONS
    }
