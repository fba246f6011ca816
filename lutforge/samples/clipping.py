"""The clipping limits of areas and of samples: beyond them a JPEG or RAW pixel no longer tells what the scene was."""

from typing import TYPE_CHECKING

import numpy as np

from lutforge.arrays import Array, Mask, Pixels

if TYPE_CHECKING:  # what is asked of samples alone is asked without the kernels
    from lutforge.shots.cells import CellStatistics


def clipping(jpeg: "CellStatistics", raw: "CellStatistics", saturation: Array) -> dict[str, Mask]:
    """Masks (…) of areas with clipped channels, each under its first reason. saturation: as `saturation_levels`."""
    clips = {
        # JPEG compression moves a clipped pixel by a code.
        "JPEG white": jpeg.maximum >= 254,
        "JPEG black": jpeg.minimum <= 1,
        # Sensors bend below their ceiling. Decoders cut noise below black at 0, so that a mean is too bright there.
        "RAW saturated": raw.maximum >= 0.98 * saturation,
        "RAW black": raw.minimum <= 0,
    }
    masks: dict[str, Mask] = {}
    for reason, channels in clips.items():
        masks[reason] = np.any(channels, axis=-1) & ~np.any(list(masks.values()), axis=0)
    return masks


def one_sided(jpeg: "CellStatistics", raw: "CellStatistics", saturation: Array) -> tuple[Mask, Mask]:
    """Masks (…, 3) of channels that are all black, or all white, in the JPEG, in areas where that is all that clips.

    Their RAW is whole, and at least one channel of the JPEG is: such an area tells that the rendering of its light lies
    at that end or beyond. saturation: as for `clipping`.
    """
    black, white = jpeg.maximum <= 1, jpeg.minimum >= 254
    whole = (jpeg.minimum > 1) & (jpeg.maximum < 254)
    of_raw = (raw.minimum > 0) & (raw.maximum < 0.98 * saturation)
    told = np.all((black | white | whole) & of_raw, axis=-1) & np.any(black | white, axis=-1) & np.any(whole, axis=-1)
    return black & told[..., None], white & told[..., None]


def unclipped_colours(encoded: Array, raw: Array) -> Mask:
    """Mask (n,) of colours encoded (n, 3) half a code inside 0 … 1, of raw (n, 3) neither black nor saturated."""
    half_code = 0.5 / 255.0
    inside = (encoded >= half_code) & (encoded <= 1.0 - half_code) & (raw > 0.0) & (raw < 0.999)
    return np.asarray(np.all(inside, axis=1))


def saturation_levels(pixels: Pixels) -> Array:
    """(3,) RAW level at which each channel of (h, w, 3) saturates, at most 1.

    Many sensors saturate below the file's nominal white. Their pixels pile up at the channel's maximum, where
    the histogram of a scene runs out; without a pile-up nothing was saturated, and the level is 1.
    """
    levels = np.ones(3)
    for channel in range(3):
        values = pixels[..., channel]
        ceiling = float(values.max(initial=0.0))
        if not 0.2 < ceiling < 1.0:
            continue
        edges = ceiling * (1 - 0.005 * np.arange(13, -1, -1)) + 1e-7
        histogram, _ = np.histogram(values[values >= edges[0]], bins=edges)
        top, below = int(histogram[-2:].sum()), float(histogram[:10].mean())
        if top >= 50 and top > 10 * below:
            levels[channel] = ceiling
    return levels
