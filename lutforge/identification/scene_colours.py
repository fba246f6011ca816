"""The probability density of a picture's codes under a rendering, from the density of colours of natural scenes.

With S the linearization, p(I) = p_scene(S(I)) |det dS/dI|. So strong colours are probable under a rendering that makes
colours stronger, and colours that a rendering cannot make are improbable. p_scene is a density over brightness and two
chroma shares of linear colours, learned from pictures by eighty simulated cameras
(`tests/benchmarks/identify.py --learn` writes it).
"""

from functools import cache
from importlib.resources import files

import numpy as np

from lutforge.arrays import Array, Pixels
from lutforge.identification.rendering import Colours
from lutforge.interpolation import Levels, interpolate


def palette(picture: Pixels) -> tuple[Array, Array]:
    """The colours (n, 3) of the flat parts of a picture (h, w, 3), encoded, and how many pixels have each (n,).

    Clipped colours and those of a few pixels are left out.
    """
    height, width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
    halved = picture[:height, :width].reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3), dtype=np.float64)
    flat = np.all((halved > 5 / 255) & (halved < 250 / 255), axis=-1)
    down = np.abs(np.diff(halved, axis=0)).max(axis=-1) < 4 / 255
    along = np.abs(np.diff(halved, axis=1)).max(axis=-1) < 4 / 255
    flat[1:] &= down
    flat[:-1] &= down
    flat[:, 1:] &= along
    flat[:, :-1] &= along
    colours = halved[flat]
    cell = np.floor(colours * 32).astype(np.int64) @ np.array([1, 64, 4096])
    _, place, count = np.unique(cell, return_inverse=True, return_counts=True)
    mean = np.column_stack([np.bincount(place, colours[:, c], len(count)) for c in range(3)]) / count[:, None]
    kept = count >= 12
    return mean[kept], count[kept].astype(np.float64)


def scene_coordinates(linear: Array) -> Array:
    """Linear sRGB (n, 3) → stops below white, and two chroma shares: (r − g) and (b − g) of the sum."""
    light = np.maximum(linear, 1e-4)
    total = light.sum(axis=-1)
    return np.stack(
        [
            np.log2(total / 3.0),
            (light[..., 0] - light[..., 1]) / total,
            (light[..., 2] - light[..., 1]) / total,
        ],
        axis=-1,
    )


def scene_log_density(colours: Array, counts: Array, to_linear: Colours) -> float:
    """The mean log density of a picture's colours, encoded, under a rendering; the exposure is free within half a stop.

    to_linear: encoded → linear sRGB of the scene. A colour counts by the root of its pixels.
    """

    def seen(encoded: Array) -> Array:
        return scene_coordinates(to_linear(np.clip(encoded, 0.0, 1.0)))

    at = seen(colours)
    # Differences over a cell of a calibrated lattice: shorter ones measure its unevenness, which makes the logarithm of
    # their determinant too small.
    ends = [(np.minimum(colours + step, 1.0), np.maximum(colours - step, 0.0)) for step in 0.04 * np.eye(3)]
    slopes = np.stack([(seen(up) - seen(low)) / (up - low).sum(axis=1, keepdims=True) for up, low in ends], axis=-1)
    stretched = np.log(np.abs(np.linalg.det(slopes)) + 1e-3)
    weights = np.sqrt(counts) / np.sqrt(counts).sum()
    levels, values = _density()
    shifts = ((shift, 0.0, 0.0) for shift in (-0.5, -0.25, 0.0, 0.25, 0.5))
    return float(max(weights @ (interpolate(at + shift, levels, values)[:, 0] + stretched) for shift in shifts))


@cache
def _density() -> tuple[Levels, Array]:
    """The levels and the log density of scene colours, as learned."""
    place = files("lutforge.identification").joinpath("data/scene_colours.npz")
    with place.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        codes, stops, share = stored["log_density"], stored["stops"], stored["share"]
        low, high = stored["range"].tolist()
    values = low + codes.astype(np.float64) / 255.0 * (high - low)
    return (stops, share, share.copy()), values[..., None]
