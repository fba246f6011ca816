"""The sensor: lens blur, filter array, photon and read noise, quantization; and demosaicking."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.arrays import Single
from lutforge.simulate.camera import SimulatedCamera


def capture(camera: SimulatedCamera, light: Single, rng: np.random.Generator, iso: int = 100) -> NDArray[np.uint16]:
    """One exposure: light on the sensor (h, w, 3), 1 = saturation, to a mosaic (h, w) of sensor codes."""
    # Shot noise is Poisson's, as a normal distribution: variance = electrons. A higher ISO fills less of the well.
    blurred = ndimage.gaussian_filter(light, (0.7, 0.7, 0), mode="nearest")  # pixels: lens and low-pass filter
    well = camera.full_well * 100 / iso
    electrons = np.minimum(filtered(blurred, camera.cfa), 1.5) * well
    noise = rng.standard_normal(electrons.shape, dtype=np.float32)
    electrons += noise * np.sqrt(np.maximum(electrons, 0) + camera.read_noise**2)
    codes = camera.black + electrons * ((camera.white - camera.black) / well)
    return np.clip(np.rint(codes), 0, camera.white).astype(np.uint16)


def filtered(image: Single, cfa: str) -> Single:
    """The mosaic (h, w) that a 2 × 2 filter array, such as "RGGB", lets through of an image (h, w, 3)."""
    mosaic = np.empty(image.shape[:2], dtype=image.dtype)
    for place, color in enumerate(cfa):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = image[row::2, column::2, "RGB".index(color)]
    return mosaic


def normalized(camera: SimulatedCamera, mosaic: NDArray[np.uint16]) -> Single:
    """Sensor codes to E: black = 0, white = 1."""
    return (mosaic.astype(np.float32) - camera.black) / np.float32(camera.white - camera.black)


def demosaic(mosaic: Single, cfa: str) -> Single:
    """Full colour (h, w, 3) from a Bayer mosaic: gradient-corrected linear interpolation.

    Malvar, He & Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images" (ICASSP
    2004), figure 2: kernels times 16 for green at red or blue, red at green in a red or blue row, red at blue.
    """
    at_colour = [[0, 0, -2, 0, 0], [0, 0, 4, 0, 0], [-2, 4, 8, 4, -2], [0, 0, 4, 0, 0], [0, 0, -2, 0, 0]]
    in_row = [[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]
    at_other = [[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]
    green, along_row, along_column, diagonal = (
        ndimage.convolve(mosaic, np.array(kernel, dtype=np.float32) / 16, mode="mirror")
        for kernel in (at_colour, in_row, np.transpose(in_row), at_other)
    )
    image = np.empty((*mosaic.shape, 3), dtype=np.float32)
    for place, color in enumerate(cfa):
        area = (slice(place // 2, None, 2), slice(place % 2, None, 2))
        if color == "G":
            row_color = "RGB".index(cfa[place ^ 1])  # of the other filter in this row
            image[..., 1][area] = mosaic[area]
            image[..., row_color][area] = along_row[area]
            image[..., 2 - row_color][area] = along_column[area]
        else:
            channel = "RGB".index(color)
            image[..., channel][area] = mosaic[area]
            image[..., 1][area] = green[area]
            image[..., 2 - channel][area] = diagonal[area]
    return image
