"""The development inside the simulated camera: a mosaic becomes the picture of its JPEG."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.arrays import Array
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.sensor import demosaic, normalized

BORDER = 8
"""Sensor pixels left out of the JPEG at the left and at the right; half as many above and below."""


def develop(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> NDArray[np.uint8]:
    """Develop a mosaic (h, w) into the picture of a JPEG: `rendered`, rounded to 8 bits."""
    return np.rint(255 * rendered(camera, mosaic, settings)).astype(np.uint8)


def rendered(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> Array:
    """Encoded values (h, w, 3) of a mosaic (h, w): demosaicked, its border cropped, and rendered."""
    raw = demosaic(normalized(camera, mosaic), camera.cfa)
    if settings.vignetting is not None:
        raw *= settings.vignetting.gain(*mosaic.shape).astype(np.float32)
    raw = raw[BORDER // 2 : -BORDER // 2, BORDER:-BORDER]
    if settings.distortion is not None:
        # The distorted picture, straightened, and magnified by as little as fills the frame.
        lens = replace(settings.distortion, x=settings.distortion.x - BORDER, y=settings.distortion.y - BORDER // 2)
        size = np.array(raw.shape[1::-1])
        grid = np.stack(np.meshgrid(*(np.arange(side) + 0.5 for side in size)), axis=-1)
        edges = np.concatenate([grid[0], grid[-1], grid[:, 0], grid[:, -1]]) - size / 2
        zooms = np.linspace(0.8, 1.25, 901)
        fits = [np.all(np.abs(lens.distorted(size / 2 + zoom * edges) - size / 2) <= size / 2) for zoom in zooms]
        straight = size / 2 + zooms[np.flatnonzero(fits)[-1]] * (grid - size / 2)
        places = lens.distorted(straight) - (lens.x, lens.y)
        channels = []
        for channel, magnified in enumerate((1 + lens.red, 1.0, 1 + lens.blue)):
            x, y = np.moveaxis(magnified * places + (lens.x, lens.y), -1, 0)
            channels.append(ndimage.map_coordinates(raw[..., channel], [y - 0.5, x - 0.5], mode="nearest"))
        raw = np.stack(channels, axis=-1)
    return camera.render(raw, settings.style, settings.white_balance, settings.push_ev)


def shrink(picture: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """A finished picture (h, w, 3) made smaller, with no more than its share of aliasing."""
    if scale == 1:
        return picture
    height, width, _ = picture.shape
    rows, columns = max(round(height * scale), 1), max(round(width * scale), 1)
    blur = 0.42 * np.sqrt(max(scale**-2 - 1, 0.0))
    soft = ndimage.gaussian_filter(picture.astype(np.float32), (blur, blur, 0), mode="nearest")
    y, x = ((np.arange(n) + 0.5) / n for n in (rows, columns))
    grid = np.meshgrid(y * height - 0.5, x * width - 0.5, indexing="ij")
    channels = [ndimage.map_coordinates(soft[..., c], grid, order=1, mode="nearest") for c in range(3)]
    return np.asarray(np.clip(np.rint(np.stack(channels, axis=-1)), 0, 255), dtype=np.uint8)
