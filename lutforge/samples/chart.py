"""The 24-patch ColorChecker: found in a camera's JPEG, verified, and its patches sampled in JPEG and RAW.

The search is colour-checker-detection's segmentation, an optional package. What it finds is only believed
where the patches have a ColorChecker's colours in a ColorChecker's places: a false chart is worse than none.
"""

import importlib
import importlib.util
import logging
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Pixels
from lutforge.samples.clipping import Clipping, Extremes, clipping
from lutforge.shots.shot import Shot

COLUMNS, ROWS = 6, 4

# sRGB codes of the chart (after November 2014), rows from dark skin to black: the values that
# colour-science's CCS_COLOURCHECKERS gives through XYZ_to_sRGB, rounded and cut to [0, 255].
REFERENCE = np.array(
    [
        (116, 79, 65),
        (197, 144, 127),
        (91, 121, 155),
        (91, 108, 65),
        (132, 127, 174),
        (95, 189, 172),
        (224, 124, 51),
        (70, 90, 166),
        (197, 80, 95),
        (93, 58, 103),
        (155, 187, 62),
        (227, 161, 44),
        (41, 62, 144),
        (59, 147, 72),
        (178, 54, 57),
        (236, 199, 30),
        (191, 80, 146),
        (0, 133, 165),
        (241, 242, 236),
        (201, 202, 201),
        (161, 163, 163),
        (121, 121, 121),
        (83, 84, 85),
        (50, 50, 50),
    ],
    dtype=np.float64,
)

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart that was found in a JPEG.

    corners: (4, 2) x, y in JPEG pixels, at the outer corners of the dark skin, bluish green, black and white patches'
    pitch (top left, top right, bottom right, bottom left of the upright chart).
    """

    corners: Array

    def patches(self) -> Array:
        """(24, 4, 2) corners of the sampled square in each patch, x, y in JPEG pixels, row by row.

        Its side is 0.4 of the patches' pitch: about the inner half of a patch.
        """
        column, row = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
        centres = np.stack([column.ravel() + 0.5, row.ravel() + 0.5], axis=1)
        square = 0.4 / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return _project(_homography(self.corners), centres[:, None, :] + square)


@dataclass(frozen=True, eq=False)
class ChartSamples:
    """Patch means of a found chart: JPEG codes (24, 3), RAW (24, 3) (NaN outside the RAW), and what is clipped."""

    codes: Array
    raw: Array
    clipping: Clipping


def detector_note() -> str | None:
    """Why charts are not searched for, in one line; None where they are."""
    if importlib.util.find_spec("colour_checker_detection") is None:
        return "charts are not searched for (pip install 'lutforge[chart]' if the shot shows a ColorChecker)"
    try:
        importlib.import_module("cv2")
    except ImportError as error:
        reason = " ".join(str(error).split())[:80]
        return f"charts are not searched for: OpenCV does not load ({reason}); install opencv-python-headless"
    return None


def find_chart(jpeg: NDArray[np.uint8]) -> Chart | None:
    """The ColorChecker in a JPEG (h, w, 3), in any rotation; None where there is none, or no detector."""
    if detector_note() is not None:
        return None
    best: tuple[float, Chart] | None = None
    for quadrilateral in _detect(jpeg):
        for turn in range(4):
            chart = Chart(np.roll(quadrilateral, turn, axis=0))
            score = likeness(*_jpeg_patches(jpeg, chart))
            if score is not None and (best is None or score > best[0]):
                best = (score, chart)
    return best[1] if best else None


def likeness(codes: Array, deviation: Array) -> float | None:
    """How like a ColorChecker 24 patches are, at most 1; None where they are none.

    codes, deviation: (24, 3) mean and standard deviation of JPEG codes. Asked for: plain patches (a median deviation of
    12 codes at most), a last row of greys that darken step by step without changing tint by over a quarter, colours
    (5 codes from grey, root mean square), of whose variance an affine map of the published ones explains 0.85.
    """
    if not np.isfinite(codes).all() or float(np.median(deviation.max(axis=1))) > 12.0:
        return None
    greys = codes[18:]
    luma = greys @ np.array([0.299, 0.587, 0.114])
    falls = np.diff(luma) <= -4.0
    clipped = (luma[:-1] >= 250) | (luma[1:] <= 12)
    if not np.all(falls | clipped) or np.count_nonzero(falls) < 3 or luma[0] < 2 * luma[-1]:
        return None
    middle = greys[(greys.max(axis=1) < 250) & (greys.min(axis=1) > 12)]
    if len(middle) < 2:
        return None
    tints = middle / middle.mean(axis=1, keepdims=True)
    if np.abs(tints - tints.mean(axis=0)).max() > 0.25:
        return None
    design = np.column_stack([REFERENCE, np.ones(24)])
    residual = codes - design @ np.linalg.lstsq(design, codes, rcond=None)[0]
    # Colour only: brightness alone would make any dark-to-light grid alike.
    chroma = codes - codes.mean(axis=1, keepdims=True)
    if float((chroma**2).mean()) < 5.0**2:
        return None
    residual_chroma = residual - residual.mean(axis=1, keepdims=True)
    score = 1 - float((residual_chroma**2).sum() / (chroma**2).sum())
    return score if score >= 0.85 else None


def sample_chart(shot: Shot, chart: Chart, saturation: Array) -> ChartSamples:
    """Means over the same squares in JPEG and RAW. saturation: (3,) see `clipping.saturation_levels`."""
    registration, size = shot.registration, shot.raw.pixel_size
    codes, raw = np.full((24, 3), np.nan), np.full((24, 3), np.nan)
    limits = np.full((4, 24, 3), np.nan)
    offset = np.array([registration.offset_x, registration.offset_y])
    for index, corners in enumerate(chart.patches()):
        in_jpeg = _pixels_inside(shot.jpeg, corners).astype(np.float64)
        in_array = (registration.scale * corners + offset - (size - 1) / 2) / size
        in_raw = _pixels_inside(shot.raw.pixels, in_array).astype(np.float64)
        if len(in_jpeg) and len(in_raw):
            codes[index], raw[index] = in_jpeg.mean(axis=0), in_raw.mean(axis=0)
            limits[:, index] = (
                in_jpeg.min(axis=0),
                in_jpeg.max(axis=0),
                in_raw.min(axis=0),
                in_raw.max(axis=0),
            )
    return ChartSamples(
        codes, raw, clipping(Extremes(limits[0], limits[1]), Extremes(limits[2], limits[3]), saturation)
    )


def _detect(jpeg: NDArray[np.uint8]) -> list[Array]:
    """Candidate quadrilaterals, (4, 2) in JPEG pixels, clockwise from the top right corner."""
    # The detector turns portrait pictures; turned here, the way back is known.
    turned = jpeg.shape[0] > jpeg.shape[1]
    picture = np.ascontiguousarray(np.rot90(jpeg)) if turned else jpeg
    width = picture.shape[1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about optional packages that the detector's other methods want
        try:
            detection = importlib.import_module("colour_checker_detection")
            found = detection.detect_colour_checkers_segmentation(
                picture.astype(np.float32) / 255, additional_data=True
            )
        except Exception as error:
            # OpenCV raises its own and NumPy's errors on pictures without contours; no chart is never an
            # error.
            _log.debug("chart detector: %s", error)
            return []
    working = detection.SETTINGS_SEGMENTATION_COLORCHECKER_CLASSIC["working_width"]
    quadrilaterals = []
    for candidate in found:
        corners = (np.asarray(candidate.quadrilateral, dtype=np.float64) + 0.5) * (width / working) - 0.5
        if turned:  # rot90: x of the turned picture is y of the JPEG, its y runs against x
            corners = np.stack([jpeg.shape[1] - 1 - corners[:, 1], corners[:, 0]], axis=1)
        quadrilaterals.append(np.roll(corners, 1, axis=0))  # starts at the top left
    return quadrilaterals


def _jpeg_patches(jpeg: NDArray[np.uint8], chart: Chart) -> tuple[Array, Array]:
    mean, deviation = np.full((24, 3), np.nan), np.full((24, 3), np.nan)
    for index, corners in enumerate(chart.patches()):
        pixels = _pixels_inside(jpeg, corners)
        if len(pixels):
            mean[index], deviation[index] = pixels.mean(axis=0), pixels.std(axis=0)
    return mean, deviation


def _pixels_inside(image: NDArray[np.uint8] | Pixels, corners: Array) -> Array:
    """(n, 3) pixels whose centres lie in a convex quadrilateral (4, 2) of x, y; none where it leaves the image."""
    low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int) + 1
    if low.min() < 0 or high[0] > image.shape[1] or high[1] > image.shape[0]:
        return np.zeros((0, 3))
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
    side = np.roll(corners, -1, axis=0) - corners
    cross = [dx * (y - cy) - dy * (x - cx) for (cx, cy), (dx, dy) in zip(corners, side, strict=True)]
    inside = np.all(np.stack(cross) >= 0, axis=0) | np.all(np.stack(cross) <= 0, axis=0)
    pixels: Array = image[low[1] : high[1], low[0] : high[0]][inside]
    return pixels


def _homography(corners: Array) -> Array:
    """(3, 3) from chart coordinates (x 0–6, y 0–4) to JPEG pixels."""
    source = np.array([[0, 0], [COLUMNS, 0], [COLUMNS, ROWS], [0, ROWS]], dtype=np.float64)
    rows = []
    for (x, y), (u, v) in zip(source, corners, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    solution = np.linalg.solve(np.array(rows), corners.ravel())
    return np.append(solution, 1.0).reshape(3, 3)


def _project(matrix: Array, points: Array) -> Array:
    homogeneous = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ matrix.T
    projected: Array = homogeneous[..., :2] / homogeneous[..., 2:]
    return projected
