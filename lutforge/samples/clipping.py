"""Clipping: the limits beyond which a JPEG or RAW value does not determine the light of the scene.

All limits of clipping are in this file, those of single values and those of the pixels of an area.
"""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.shots.cells import CellStatistics

HALF_CODE = 0.5 / 255
"""An encoded value nearer than this to 0 or 1 is clipped: half a code of an 8-bit file."""
JPEG_LIMITS = 1, 254
"""Codes at which a pixel of a JPEG may be clipped: compression moves clipped ones by a code."""
SATURATED = 0.999
"""The RAW value from which on it is saturated: 1, less what scaling and rounding take."""
NONLINEAR = 0.98
"""The RAW value from which on a pixel takes no part in a mean: just below saturation sensors are not linear."""


def clipping(jpeg: CellStatistics, raw: CellStatistics) -> dict[str, Mask]:
    """Masks (…) of areas with clipped channels, by reason; an area is in the first mask that holds for it."""
    clips = {
        "JPEG white": jpeg.maximum >= JPEG_LIMITS[1],
        "JPEG black": jpeg.minimum <= JPEG_LIMITS[0],
        "RAW saturated": raw.maximum >= NONLINEAR,
        "RAW black": raw.minimum <= 0,  # decoders cut noise below black at 0, so that a mean is too bright there
    }
    masks: dict[str, Mask] = {}
    for reason, channels in clips.items():
        masks[reason] = np.any(channels, axis=-1) & ~np.any(list(masks.values()), axis=0)
    return masks


def censored(jpeg: CellStatistics, raw: CellStatistics) -> tuple[Mask, Mask]:
    """Masks (…, 3) of channels that are all black, or all white, in the JPEG, in areas where that is all that clips.

    Their RAW is not clipped, and at least one channel of the JPEG is not: such an area is a censored observation, whose
    rendering lies at that end or beyond.
    """
    low, high = JPEG_LIMITS
    black = jpeg.maximum <= low
    white = jpeg.minimum >= high
    unclipped = (jpeg.minimum > low) & (jpeg.maximum < high)
    unclipped_raw = (raw.minimum > 0) & (raw.maximum < NONLINEAR)

    is_censored = np.all((black | white | unclipped) & unclipped_raw, axis=-1)
    is_censored &= np.any(black | white, axis=-1) & np.any(unclipped, axis=-1)
    return black & is_censored[..., None], white & is_censored[..., None]


def unclipped_colours(encoded: Array, raw: Array) -> Mask:
    """Mask (n,) of colours encoded (n, 3) HALF_CODE inside 0 … 1, of raw (n, 3) neither black nor saturated."""
    inside = (encoded >= HALF_CODE) & (encoded <= 1.0 - HALF_CODE) & (raw > 0.0) & (raw < SATURATED)
    return np.asarray(np.all(inside, axis=1))


def clipped(encoded: ArrayLike) -> Mask:
    """Mask (…,) of encoded colours (…, 3) with a channel at 0 or 255, whose RAW value is unknown."""
    values = np.asarray(encoded)
    channels: Mask = (values <= HALF_CODE) | (values >= 1.0 - HALF_CODE)
    # This is nine times as fast as np.any over so short an axis.
    return np.asarray(channels[..., 0] | channels[..., 1] | channels[..., 2])
