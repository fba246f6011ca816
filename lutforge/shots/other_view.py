"""A JPEG of a camera without RAW with another camera's RAW of the same scene, from another place.

What both show of a plane, or of anything far away, differs by a homography. Features that both pictures have (SIFT,
Lowe 2004, https://doi.org/10.1023/B:VISI.0000029664.99615.94) are matched, and the homography that most of them agree
on is fitted by a robust estimator (MAGSAC++, Barath et al. 2020, https://doi.org/10.1109/CVPR42600.2020.00138). The RAW
is then resampled to the JPEG's frame; where the two still disagree, as on near objects, tiles are rejected.
"""

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.arrays import Array, Codes
from lutforge.errors import ShotError
from lutforge.images.raw import read_raw
from lutforge.images.read import read_image
from lutforge.shots.geometry import Registration
from lutforge.shots.metadata import camera_of, read_metadata, read_picture_settings
from lutforge.shots.read import Shot
from lutforge.shots.tags import tags

LONGEST = 1600
"""Pixels of the longer side of the pictures that features are looked for in."""


def read_other_view(picture: Path, raw_file: Path) -> tuple[Shot, float]:
    """A JPEG of one camera with the RAW of another in its frame, and its exposure over the RAW's, NaN where unknown."""
    raw = read_raw(raw_file, half_size=True)
    shown = read_image(picture).pixels
    if shown.shape[2] < 3:
        raise ShotError(f"{picture}: not a colour picture")
    jpeg = np.rint(np.clip(shown[..., :3], 0.0, 1.0) * 255).astype(np.uint8)
    try:
        cv2: Any = importlib.import_module("cv2")
    except ImportError:
        raise ShotError("pictures of two cameras are registered by OpenCV: pip install 'lutforge[views]'") from None

    # RAW as a picture in codes (h, w): green, brought to a usual brightness, on a gamma curve
    green = raw.pixels[..., 1]
    bright = np.clip(green / max(float(np.quantile(green[::4, ::4], 0.98)), 1e-6), 0.0, 1.0)
    try:
        matrix, share = _homography(cv2, np.rint(255 * np.power(bright, 1 / 2.2)).astype(np.uint8), jpeg)
    except ShotError as error:
        raise ShotError(f"{picture}: {raw_file.name}: {error}") from None

    # RAW in the frame of the JPEG, about as many pixels as it had: its own values, none mixed, 0 outside
    height, width = jpeg.shape[:2]
    size = float(np.clip(np.sqrt(np.linalg.det(_local(matrix, raw.pixels.shape)[0])), 0.25, 8.0))
    centre = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])  # OpenCV counts from the centre of the first pixel
    to_array = np.linalg.inv(centre) @ np.diag([1 / size, 1 / size, 1.0]) @ centre @ matrix
    pixels = cv2.warpPerspective(
        raw.pixels, to_array, (int(width / size), int(height / size)), flags=cv2.INTER_NEAREST, borderValue=0.0
    )
    resampled = replace(raw, pixels=pixels, pixel_size=size, flip=0, preview=None)

    metadata = read_metadata(picture, replace(resampled, multipliers=None, exposure_s=np.nan, iso=np.nan), None)
    metadata = replace(metadata, notes=())
    shot = Shot(picture.stem, picture, resampled, jpeg, str(picture), metadata, Registration(1.0, 0.0, 0.0, share))

    aperture = raw.aperture if raw.aperture > 0 else 1.0
    exposure = raw.exposure_s * (raw.iso if raw.iso > 0 else 100.0) / 100.0 / aperture**2
    named = replace(shot, raw_camera=camera_of(tags(raw_file)) or "reference camera")
    return named, read_picture_settings(picture).exposure / exposure


def _homography(cv2: Any, grey: Codes, jpeg: Codes) -> tuple[Array, float]:
    """(3, 3) from pixels of a grey picture (h, w) to those of a JPEG (h, w, 3), and the share of matches that agree."""
    small, scales = [], []
    for picture in (grey, cv2.cvtColor(jpeg, cv2.COLOR_RGB2GRAY)):
        scale = min(1.0, LONGEST / max(picture.shape))
        resized = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        small.append(cv2.createCLAHE(4.0, (8, 8)).apply(resized))
        scales.append(scale)
    finder = cv2.SIFT_create(nfeatures=6000)
    (keys_a, features_a), (keys_b, features_b) = (finder.detectAndCompute(picture, None) for picture in small)
    if features_a is None or features_b is None or min(len(keys_a), len(keys_b)) < 8:
        raise ShotError("too little structure to register")

    # A feature whose second nearest is nearly as near may be either (Lowe 2004, 7.1).
    pairs = [pair for pair in cv2.BFMatcher().knnMatch(features_a, features_b, k=2) if len(pair) == 2]
    good = [first for first, second in pairs if first.distance < 0.8 * second.distance]
    points = [
        (np.array([keys[getattr(match, name)].pt for match in good]).reshape(-1, 2) + 0.5) / scale - 0.5
        for keys, name, scale in ((keys_a, "queryIdx", scales[0]), (keys_b, "trainIdx", scales[1]))
    ]

    matrix = inside = None
    if len(good) >= 8:
        matrix, inside = cv2.findHomography(
            *points, cv2.USAC_MAGSAC, 3.0 / scales[1], maxIters=20_000, confidence=0.9999
        )
    agreeing = 0 if inside is None else int(inside.sum())
    # By chance a dozen of thousands of wrong matches may agree on some homography.
    if matrix is None or agreeing < max(20, 0.1 * len(good)):
        agree = f"{agreeing} of {len(good)} features of the two pictures agree"
        raise ShotError(f"{agree}: another scene, or too little in common")
    if not np.all(np.linalg.det(_local(matrix, grey.shape)) > 0) or np.linalg.cond(_local(matrix, grey.shape)[0]) > 5:
        raise ShotError("the two pictures agree on a distortion that no camera makes: another scene")
    return np.asarray(matrix, dtype=np.float64), agreeing / len(good)


def _local(matrix: Array, shape: tuple[int, ...]) -> Array:
    """The derivative (5, 2, 2) of a homography at the middle and near the corners of a picture."""
    h, w = shape[:2]
    at = np.array([[0.5, 0.5], [0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]]) * (w, h)
    homogeneous = np.column_stack([at, np.ones(5)]) @ matrix.T
    x, y = homogeneous[:, 0] / homogeneous[:, 2], homogeneous[:, 1] / homogeneous[:, 2]
    rows = [matrix[None, row, :2] - value[:, None] * matrix[2, :2] for row, value in ((0, x), (1, y))]
    return np.asarray(np.stack(rows, axis=1) / homogeneous[:, 2, None, None])
