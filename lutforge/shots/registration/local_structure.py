"""Local structure of a picture: its detail over the local contrast, which tone curves and shading hardly change.

All of it is masked: what has no weight takes no part, as if the picture ended there.
"""

import numpy as np

from lutforge.arrays import Single
from lutforge.compiled import compiled

DEVIATION = 6.0
"""Standard deviation, in pixels, of what is taken for shading and tone: structure much coarser does not count."""
CODE_ROUNDING = 0.3 / 255
"""Standard deviation of the rounding to 8 bits, 1/√12 of a code: detail below it is noise."""


def structure(luma: Single, weight: Single, around: Single) -> Single:
    """Return the local structure of luma (h, w): detail over its local deviation, times the weight.

    weight: (h, w) of the pixels; around: `local_weight` of it.
    """
    detail = luma - blurred(luma * weight) / around
    energy = blurred(detail * detail * weight) / around

    # Half the mean energy is a floor: flat areas would else count as much as edges.
    floor = 0.5 * float(np.vdot(energy, weight)) / (float(weight.sum()) + 1e-12)
    energy += np.float32(floor + CODE_ROUNDING**2)
    return np.asarray(detail / np.sqrt(energy) * weight)


def local_weight(weight: Single) -> Single:
    """Weight (h, w) in the Gaussian neighbourhood of each pixel, above 0."""
    return np.asarray(np.maximum(blurred(weight), np.float32(1e-6)))


def blurred(image: Single) -> Single:
    """Return the image (h, w) filtered by a Gaussian of DEVIATION, mirrored at its borders."""
    taps = np.exp(-0.5 * (np.arange(4 * DEVIATION + 1) / DEVIATION) ** 2)
    taps /= 2 * taps.sum() - taps[0]
    out = np.empty_like(image)
    _blur(np.ascontiguousarray(image), taps.astype(np.float32), out)
    return out


@compiled()
def _mirrored(place: int, size: int) -> int:
    """The place within 0 … size − 1 that lies there when the image is mirrored at both ends, again and again."""
    inside = place % (2 * size)
    return inside if inside < size else 2 * size - 1 - inside


@compiled(fastmath={"contract"})
def _blur(image: Single, taps: Single, out: Single) -> None:
    """Fill `out` with the image, filtered by symmetric taps, of which the middle one is the first, along both axes."""
    rows, columns = image.shape
    reach = len(taps) - 1
    line = np.empty(columns + 2 * reach, dtype=np.float32)
    for y in range(rows):
        # Down the columns, into the middle of a line with room on both sides.
        middle, row, to = line[reach : reach + columns], image[y], out[y]
        for x in range(columns):
            middle[x] = taps[0] * row[x]
        for k in range(1, reach + 1):
            above, below = image[_mirrored(y - k, rows)], image[_mirrored(y + k, rows)]
            for x in range(columns):
                middle[x] += taps[k] * (above[x] + below[x])

        # The room at both ends is the line's mirror image.
        for k in range(reach):
            line[reach - 1 - k] = middle[_mirrored(-1 - k, columns)]
            line[reach + columns + k] = middle[_mirrored(columns + k, columns)]

        # Along the line.
        for x in range(columns):
            to[x] = taps[0] * middle[x]
        for k in range(1, reach + 1):
            before, after = line[reach - k : reach - k + columns], line[reach + k : reach + k + columns]
            for x in range(columns):
                to[x] += taps[k] * (before[x] + after[x])
