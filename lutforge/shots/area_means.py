"""Means of an image over areas: over blocks of its pixels, and over the pixels of a picture that lies on it."""

from typing import Any

import numpy as np

from lutforge.arrays import Array, Codes, Pixels, Single
from lutforge.compiled import compiled
from lutforge.shots.cells import cell_edges
from lutforge.shots.geometry import Registration


def cells_of_jpeg(
    place: Registration, shape: tuple[int, ...], raw: tuple[int, ...], pixel_size: float
) -> tuple[tuple[Array, Array], Single]:
    """The borders of a JPEG's rows (h + 1,) and columns (w + 1,) in RAW pixels, and which pixels RAW covers, 0 or 1.

    shape, raw: of the two pictures, (h, w, …).
    """
    rows = cell_edges(place.scale, place.offset_y, shape[0], 1, pixel_size)
    columns = cell_edges(place.scale, place.offset_x, shape[1], 1, pixel_size)
    covers = [(edges[:-1] >= 0) & (edges[1:] <= size) for edges, size in zip((rows, columns), raw[:2], strict=True)]
    return (rows, columns), np.outer(*covers).astype(np.float32)


def on_jpeg_pixels(
    plane: Single, pixel_size: float, place: Registration, shape: tuple[int, int]
) -> tuple[Single, Single]:
    """RAW values averaged over each JPEG pixel (h, w), and whether RAW covers it, 0 or 1."""
    borders, covers = cells_of_jpeg(place, shape, plane.shape, pixel_size)
    sampled = np.empty(shape, np.float32)
    _area_means(plane, *borders, sampled)
    return sampled, covers


def block_mean(image: Single | Codes, factor: int) -> Pixels:
    """Means over blocks of factor × factor pixels of an image (h, w, …); a rest at the right and bottom is left out."""
    if factor == 1:
        return image.astype(np.float32)
    layers: Any = np.ascontiguousarray(image)
    layers = layers[..., None] if image.ndim == 2 else layers
    means = np.empty((image.shape[0] // factor, image.shape[1] // factor, layers.shape[2]), np.float32)
    _block_means(layers, factor, means)
    return means.reshape(means.shape[: image.ndim])


@compiled()
def _area_means(plane: Single, rows: Array, columns: Array, means: Single) -> None:
    """Fill the means (H, W) of a plane (h, w) over cells with borders at rows (H + 1,) and columns (W + 1,).

    Borders count in the plane's pixels. What lies outside of it does not count; a cell without pixels has 0.
    """
    height, width = plane.shape
    line = np.empty(width, np.float32)
    for i in range(len(rows) - 1):
        low, high = min(max(rows[i], 0.0), height), min(max(rows[i + 1], 0.0), height)
        line[:] = 0
        for y in range(int(np.floor(low)), int(np.ceil(high))):
            share, own = np.float32((min(y + 1.0, high) - max(float(y), low)) / (high - low)), plane[y]
            for x in range(width):
                line[x] += share * own[x]
        for j in range(len(columns) - 1):
            left, right = min(max(columns[j], 0.0), width), min(max(columns[j + 1], 0.0), width)
            mean = np.float32(0)
            for x in range(int(np.floor(left)), int(np.ceil(right))):
                mean += np.float32((min(x + 1.0, right) - max(float(x), left)) / (right - left)) * line[x]
            means[i, j] = mean


@compiled()
def _block_means(layers: Single | Codes, factor: int, means: Single) -> None:
    """Fill the means (H, W, n) over blocks of factor × factor pixels of an image (h, w, n)."""
    width, depth = means.shape[1], means.shape[2]
    line = np.empty(width * factor * depth, np.float32)
    for i in range(means.shape[0]):
        line[:] = 0
        for y in range(i * factor, (i + 1) * factor):
            row = layers[y].ravel()
            for x in range(len(line)):
                line[x] += np.float32(row[x])
        for j in range(width):
            for layer in range(depth):
                total = np.float32(0)
                for x in range(j * factor, (j + 1) * factor):
                    total += line[x * depth + layer]
                means[i, j, layer] = total / np.float32(factor * factor)
