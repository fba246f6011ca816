"""Brackets of a camera whose response is known: noise, clipping, a shutter that is off, and a mild gamut map."""

from collections.abc import Callable, Sequence
from io import BytesIO

import numpy as np
from PIL import Image

from lutforge.calibration.bracket import BracketFit
from lutforge.colour.srgb import srgb_encode
from lutforge.simulate.tone_response import ToneResponse


def bracket(
    response: Callable[[np.ndarray], np.ndarray], shots: int = 7, cells: int = 40, seed: int = 0, spacing: float = 1.0
) -> tuple[list[float], np.ndarray, list[np.ndarray]]:
    """Exposure times, `spacing` stops apart, true over stated exposure (3 % off), and images of whole codes."""
    rng = np.random.default_rng(seed)
    muted = rng.random((cells, cells, 1)) < 0.6
    colour = np.where(muted, rng.uniform(0.85, 1, (cells, cells, 3)), rng.uniform(0.25, 1, (cells, cells, 3)))
    scene = np.kron(np.exp(rng.uniform(-5.5, 1.5, (cells, cells, 1))) * colour, np.ones((8, 8, 1)))
    times = [2.0 ** (spacing * (stop - (shots - 1) / 2)) for stop in range(shots)]
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


def compressed(image: np.ndarray, quality: int = 75) -> np.ndarray:
    """An image of whole codes as a JPEG file keeps it, its colours at half the resolution."""
    file = BytesIO()
    codes = np.rint(255 * image).astype(np.uint8)
    Image.fromarray(codes).save(file, "JPEG", quality=quality, subsampling="4:2:0")
    return np.asarray(Image.open(file)) / 255


def _filmic(x: np.ndarray) -> np.ndarray:
    """John Hable's curve (2010) behind a gamma."""

    def curve(v: np.ndarray) -> np.ndarray:
        return (v * (0.22 * v + 0.03) + 0.002) / (v * (0.22 * v + 0.3) + 0.06) - 0.01 / 0.3

    return np.asarray((curve(4 * x) / curve(np.array(4.0))) ** (1 / 1.9))


CURVES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "sRGB": srgb_encode,
    "Rec.709": lambda x: np.where(x < 0.018, 4.5 * x, 1.099 * np.maximum(x, 1e-9) ** 0.45 - 0.099),
    "gamma 1.8": lambda x: x ** (1 / 1.8),
    "gamma 2.6": lambda x: x ** (1 / 2.6),
    "standard": lambda x: ToneResponse((0.26,) * 3, (0.94,) * 3)(np.stack([x] * 3, axis=-1))[..., 0],
    "vivid": lambda x: ToneResponse((0.2,) * 3, (0.97,) * 3)(np.stack([x] * 3, axis=-1))[..., 0],
    "filmic": _filmic,
    "log": lambda x: np.log1p(60 * x) / np.log1p(60),
}


def errors_of(
    fit: BracketFit, response: Callable[[np.ndarray], np.ndarray], times: Sequence[float], errors: np.ndarray
) -> list[float]:
    """Relative errors of f⁻¹ at white and at code 20, both over middle grey, and of the worst exposure.

    A power common to f⁻¹ and to all exposures cannot be told, and is taken out of these.
    """
    light = np.linspace(0, 1, 100_001)
    codes = np.array([20 / 255, 0.5, 1.0])
    dark, middle, white = np.interp(codes, response(light), light)
    found = fit.response.linearize(np.stack([codes] * 3, axis=1))
    at = np.log(times) - np.mean(np.log(times))
    off = np.log([fit.exposure_error[f"{time:g}"] for time in times]) - np.log(errors)
    off -= off.mean() + at * (off @ at) / (at @ at)
    ends = (found[2] / found[1] / (white / middle) - 1, found[0] / found[1] / (dark / middle) - 1)
    return [float(np.abs(error).max()) for error in (*ends, off)]


ADAPTATIONS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "shadows": lambda x, amount: x + 4 * max(-amount, 0.0) * x * (1 - x) ** 3,
    "highlights": lambda x, amount: x - 4 * max(amount, 0.0) * x**3 * (1 - x),
    "contrast": lambda x, amount: x + 4 * amount * (x - 0.5) * x * (1 - x),
}
"""What a camera does to a shot, by how bright it is: −1 … 1 times a size."""


def adapted(kind: str, size: float, images: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The images of a camera that adapts to what it sees, in whole codes."""
    amounts = [size * float(np.clip((image.mean() - 0.45) * 2, -1, 1)) for image in images]
    changed = (ADAPTATIONS[kind](image, amount) for image, amount in zip(images, amounts, strict=True))
    return [np.rint(255 * np.clip(image, 0, 1)) / 255 for image in changed]
