"""Counts of small DCT coefficients (0, 1, 2 or 3 quantization steps) in a JPEG's flat blocks, which measure its noise.

Blocks are grouped by their mean colour, because noise depends on it. The steps are those of the file. If it was not
saved again, they are those of the camera's encoder.
"""

from dataclasses import dataclass

import numpy as np
import scipy
import simplejpeg

from lutforge.arrays import Array, Index
from lutforge.images.jpeg_header import JpegHeader

LEVELS = 4
"""Number of sizes that are counted; coefficients of more steps are structure."""

TO_YCC = np.array([[0.299, 0.587, 0.114], [-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]])
"""RGB → Y, Cb, Cr of JFIF (ITU-T T.871, clause 7)."""

_LUMA = ((1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2), (0, 3), (3, 0), (1, 3), (3, 1), (2, 3), (3, 2))
_CHROMA = ((0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2))
"""Rows and columns of the coefficients that count: low frequencies, which are quantized finely."""


@dataclass(frozen=True, eq=False)
class NoiseTally:
    """Counts of quantized coefficients in flat blocks, by colour.

    colours: encoded (n, 3); weights: (n, 3) of red, green and blue in the plane that was counted; counts: (n, k,
    LEVELS) blocks by the size of coefficient k in steps; steps: (k,) in codes.
    """

    colours: Array
    weights: Array
    counts: Array
    steps: Array


def tally_noise(data: bytes, header: JpegHeader) -> tuple[NoiseTally, ...]:
    """The noise of luma, and that of both chromas together; empty where there is no flat block."""
    across, down = header.sampling[0]
    if not header.plain or header.sampling[1:] != ((1, 1), (1, 1)) or min(header.width, header.height) < 16 * across:
        return ()
    codes = simplejpeg.decode_jpeg(data, "RGB", fastupsample=True)
    luma = simplejpeg.decode_jpeg(data, "GRAY")[..., 0]
    rows = _bands(header.height, header.width)
    planes = codes[rows].astype(np.float64) @ TO_YCC.T
    exact = luma[rows].astype(np.float64)
    fine = _blocks(exact)
    whole = np.stack([_blocks(planes[..., plane]).mean(axis=(2, 3)) for plane in range(3)], axis=-1)
    tallies = [_tally([(fine, 0)], whole, fine.std(axis=(2, 3)) < 2.5, header.tables[0], _LUMA)]
    height, width = len(planes) // down * down, planes.shape[1] // across * across
    small = planes[:height, :width].reshape(height // down, down, width // across, across, 3).mean(axis=(1, 3))
    blocks = [_blocks(small[..., plane]) for plane in range(3)]
    flat = np.max([block.std(axis=(2, 3)) for block in blocks], axis=0) < 3.0
    mean = np.stack([block.mean(axis=(2, 3)) for block in blocks], axis=-1)
    tallies.append(_tally([(blocks[1], 1), (blocks[2], 2)], mean, flat, header.tables[1], _CHROMA))
    return tuple(tally for tally in tallies if len(tally.colours))


def _bands(height: int, width: int) -> slice | Index:
    """The rows of at most some three million pixels, in bands of whole blocks spread over the picture."""
    bands = height // 16
    wanted = max(1, int(3e6 / (16 * width)))
    if bands <= wanted:
        return slice(0, bands * 16)
    first = np.linspace(0, bands - 1, wanted).astype(np.int64) * 16
    rows: Index = (first[:, None] + np.arange(16)).ravel()
    return rows


def _blocks(plane: Array) -> Array:
    """A plane (h, w) as blocks (h // 8, w // 8, 8, 8)."""
    height, width = plane.shape[0] // 8, plane.shape[1] // 8
    return plane[: height * 8, : width * 8].reshape(height, 8, width, 8).swapaxes(1, 2)


def _tally(
    planes: list[tuple[Array, int]],
    mean: Array,
    flat: Array,
    table: tuple[int, ...],
    at: tuple[tuple[int, int], ...],
) -> NoiseTally:
    """Count the coefficients of planes, each with its row of TO_YCC, in flat blocks of mean colours (…, 3) in YCbCr."""
    colours = mean @ np.linalg.inv(TO_YCC).T / 255.0
    # Clipped codes hold no noise.
    kept = flat & np.all((colours > 6 / 255) & (colours < 249 / 255), axis=-1)
    colours, steps = colours[kept], np.array([table[8 * row + column] for row, column in at], dtype=np.float64)
    cell = np.floor(colours * 24).astype(np.int64) @ np.array([1, 32, 1024])
    _, place, blocks = np.unique(cell, return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(place, colours[:, c], len(blocks)) for c in range(3)]) / blocks[:, None]
    counts = []
    for values, _ in planes:
        transformed = scipy.fft.dctn(values[kept], axes=(1, 2), norm="ortho")
        size = np.stack([np.abs(np.rint(transformed[:, r, c] / s)) for (r, c), s in zip(at, steps, strict=True)], 1)
        keys = (place[:, None] * len(at) + np.arange(len(at))) * (LEVELS + 1) + np.minimum(size, LEVELS)
        tally = np.bincount(keys.astype(np.int64).ravel(), minlength=len(blocks) * len(at) * (LEVELS + 1))
        counts.append(tally.reshape(len(blocks), len(at), LEVELS + 1)[..., :LEVELS])
    weights = np.concatenate([np.tile(TO_YCC[row], (len(blocks), 1)) for _, row in planes])
    return NoiseTally(np.tile(middle, (len(planes), 1)), weights, np.concatenate(counts).astype(np.float64), steps)
