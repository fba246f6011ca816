"""Brackets of a camera whose response is known: noise, clipping, a shutter that is off, and a mild gamut map."""

from collections.abc import Callable

import numpy as np


def bracket(
    response: Callable[[np.ndarray], np.ndarray], shots: int = 7, cells: int = 40, seed: int = 0
) -> tuple[list[float], np.ndarray, list[np.ndarray]]:
    """Exposure times in steps of a stop, true over stated exposure (3 % off), and images (h, w, 3) of whole codes."""
    rng = np.random.default_rng(seed)
    muted = rng.random((cells, cells, 1)) < 0.6
    colour = np.where(muted, rng.uniform(0.85, 1, (cells, cells, 3)), rng.uniform(0.25, 1, (cells, cells, 3)))
    scene = np.kron(np.exp(rng.uniform(-5.5, 1.5, (cells, cells, 1))) * colour, np.ones((8, 8, 1)))
    times = [2.0 ** (stop - (shots - 1) / 2) for stop in range(shots)]
    errors = np.exp(0.03 * rng.standard_normal(shots))
    images = []
    for time, error in zip(times, errors, strict=True):
        light = scene * time * error
        light = np.clip(light + np.sqrt(1e-4 * light + 1e-7) * rng.standard_normal(light.shape), 0, 1)
        grey = light.mean(axis=-1, keepdims=True)
        chroma = 1 - light.min(axis=-1, keepdims=True) / np.maximum(light.max(axis=-1, keepdims=True), 1e-6)
        light = np.clip(grey + (light - grey) * (1 + 0.3 * np.maximum(chroma - 0.45, 0)), 0, 1)
        images.append(np.rint(255 * response(light)) / 255)
    return times, errors, images
