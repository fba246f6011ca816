"""Means of pictures over areas: over whole blocks of pixels, and over cells whose borders cut through pixels."""

from typing import Any

import numpy as np

from lutforge.arrays import Array, Codes, Single
from lutforge.compiled import compiled


def block_mean(image: Single | Codes, factor: int) -> Single:
    """Means over blocks of factor × factor pixels of an image (h, w, …); a rest at the right and bottom is left out."""
    if factor == 1:
        return image.astype(np.float32)
    layers: Any = np.ascontiguousarray(image)
    layers = layers[..., None] if image.ndim == 2 else layers
    means = np.empty((image.shape[0] // factor, image.shape[1] // factor, layers.shape[2]), np.float32)
    _block_means(layers, factor, means)
    return means.reshape(means.shape[: image.ndim])


def cell_means(plane: Single, rows: Array, columns: Array) -> Single:
    """Means (H, W) of a plane (h, w) over cells with borders (H + 1,), (W + 1,) in its pixels; 0 outside of it."""
    means = np.empty((len(rows) - 1, len(columns) - 1), np.float32)
    _area_means(plane, rows, columns, means)
    return means


@compiled()
def _area_means(plane: Single, rows: Array, columns: Array, means: Single) -> None:
    """Fill the means (H, W) of a plane over cells: first down each column of pixels, then along the row of cells."""
    height, width = plane.shape
    line = np.empty(width, np.float32)
    for i in range(len(rows) - 1):
        low, high = min(max(rows[i], 0.0), height), min(max(rows[i + 1], 0.0), height)
        line[:] = 0
        for y in range(int(np.floor(low)), int(np.ceil(high))):
            share = np.float32((min(y + 1.0, high) - max(float(y), low)) / (high - low))
            pixels = plane[y]
            for x in range(width):
                line[x] += share * pixels[x]

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
