"""Photographs of a chart by a simulated camera without RAW: JPEG files with noise, and shutters that are off."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from lutforge.arrays import Array
from lutforge.samples.chart import ChartKind
from lutforge.simulate.camera import SimulatedCamera

STOPS = (-4.0, -3.25, -2.5, -1.75, -1.0, -0.25, 0.5, 1.25, 2.0)
PITCH, BORDER = 48, 70


def chart_picture(light: Array, kind: ChartKind, surround: float = 0.03, background: float = 0.1) -> Array:
    """An image (h, w, 3) of a chart whose patches have the light (n, 3), on a dark holder before a grey wall."""
    size = np.rint(PITCH * kind.outline.max(axis=0)).astype(int) + 2 * BORDER
    white: Array = light.max(axis=0)
    image: Array = np.full((size[1], size[0], 3), background) * white
    image[BORDER - 10 : 10 - BORDER, BORDER - 10 : 10 - BORDER] = surround * white
    for (x, y), colour in zip(BORDER + PITCH * kind.centres, light, strict=True):
        half = 0.43 * PITCH
        image[round(y - half) : round(y + half), round(x - half) : round(x + half)] = colour
    return image


def photograph_chart(
    camera: SimulatedCamera,
    kind: ChartKind,
    reflectances: Array,
    folder: Path,
    stops: Sequence[float] = STOPS,
    *,
    light: str = "daylight",
    white_balance: str = "daylight",
    shutter: float = 0.02,
    seed: int = 0,
    shade: Array | float = 1.0,
) -> list[Path]:
    """JPEG files of a chart at exposures in stops from the nominal one, which their EXIF states.

    light, white_balance: settings of the camera; shutter: standard deviation of the log of true over stated exposure;
    shade: the light on each patch (n, 1) as a share of the light's.
    """
    rng = np.random.default_rng(seed)
    files = []
    for index, stop in enumerate(stops):
        seconds = camera.nominal_exposure_s * 2.0**stop
        light_on = shade * camera.expose(reflectances, light, seconds * np.exp(shutter * rng.standard_normal()))
        raw = chart_picture(light_on, kind)
        raw = np.clip(raw + np.sqrt(raw / camera.full_well + 1e-8) * rng.standard_normal(raw.shape), 0.0, 1.0)
        picture = Image.fromarray(np.rint(255 * camera.render(raw, "standard", white_balance)).astype(np.uint8))
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0x829A] = IFDRational(seconds)
        files.append(folder / f"chart_{index:02d}.jpg")
        picture.save(files[-1], quality=95, subsampling=0, exif=exif)
    return files
