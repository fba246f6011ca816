"""The search for a chart in a JPEG, its verification, and the statistics of its patches.

The search is that of OpenCV, an optional package (Macbeth chart detection, in its objdetect module since version 5). A
chart that it finds is accepted only where its patches have the published colours in their places, because samples of a
false chart would be worse than none.
"""

import importlib
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import least_squares

from lutforge.arrays import Array, Single
from lutforge.colour.srgb import srgb_encode
from lutforge.samples.chart import ChartKind, chart_kind
from lutforge.shots.cells import CellStatistics
from lutforge.shots.read import Shot

RESEMBLANCE = 0.85
"""Share of the variance of a chart's chroma that an affine map of the published colours explains, at least."""
SAMPLED_SIDE = 0.4
"""Side of the square that is sampled in each patch, in pitches."""
MOST_TEXTURE = 12.0
"""Median over the patches of the standard deviation of their codes; patches of a chart have less."""
LEAST_CHROMA = 5.0
"""Root mean square of a chart's chroma, in codes; patches with less are nearly grey."""
LARGEST_SEARCHED = 1000.0
"""Larger pictures are reduced to this many pixels on their long side; the detector enlarges smaller ones to it."""
LEAST_PITCH = 2.0
"""Least distance of patches, in pixels of the reduced picture: OpenCV returns points as candidates, too."""


@dataclass(frozen=True, eq=False)
class LocatedChart:
    """A chart at its place in a picture.

    corners: (4, 2), x and y in JPEG pixels, half a pitch outwards from the centres of the corner patches: top left, top
    right, bottom right, bottom left of the upright chart (of a ColorChecker dark skin, bluish green, black and white).
    """

    corners: Array
    kind: ChartKind = field(default_factory=partial(chart_kind, "classic"))

    def patches(self) -> Array:
        """The corners x, y (n, 4, 2) of the square that is sampled in each patch, in JPEG pixels."""
        square = SAMPLED_SIDE / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        homography = _homography(self.kind.outline, self.corners)
        return _project(homography, self.kind.centres[:, None, :] + square)


def detector_note() -> str | None:
    """A line on why charts are not searched for; None where they are."""
    try:
        cv2 = importlib.import_module("cv2")
    except ImportError as error:
        if error.name == "cv2":
            return "charts are not searched for (pip install 'lutforge[chart]' if the shot shows a ColorChecker)"
        reason = " ".join(str(error).split())[:80]
        return f"charts are not searched for: OpenCV does not load ({reason}); install opencv-contrib-python-headless"
    if not hasattr(getattr(cv2, "mcc", None), "MCC24"):
        return "charts are not searched for: OpenCV 5 finds them; pip install --upgrade 'lutforge[chart]'"
    return None


def find_chart(
    jpeg: NDArray[np.uint8], kind: ChartKind | None = None, reference: Array | None = None
) -> LocatedChart | None:
    """The chart in a JPEG (h, w, 3), in any rotation; None where there is none, or no detector.

    kind: a ColorChecker Classic unless another is named; reference: (n, 3) its sRGB codes, else those under D50.
    """
    kind = kind or chart_kind("classic")
    if not kind.detector or detector_note() is not None:
        return None
    turned = [
        LocatedChart(np.roll(corners, turn, axis=0), kind) for corners in _detect(jpeg, kind) for turn in range(4)
    ]
    if not turned:
        return None
    if reference is None:
        reference = 255.0 * srgb_encode(np.clip(kind.linear_srgb(), 0.0, 1.0))
    statistics = [patch_codes(jpeg, chart) for chart in turned]
    scores = [likeness(patches.mean, patches.std, reference) for patches in statistics]
    best = int(np.argmax(scores))
    return turned[best] if scores[best] >= RESEMBLANCE else None


def likeness(codes: Array, deviation: Array, reference: Array) -> float:
    """The likeness of patches to a chart: at most 1, and 0 where the patches are textured or nearly grey.

    codes, deviation: (n, 3), mean and standard deviation of the JPEG codes of each patch. reference: (n, 3), the
    chart's codes.
    """
    is_plain = bool(np.isfinite(codes).all()) and float(np.median(deviation.max(axis=1))) <= MOST_TEXTURE
    return resemblance(codes, reference) if is_plain else 0.0


def resemblance(codes: Array, reference: Array) -> float:
    """The share of the variance of chroma that an affine map of the reference explains; both (n, 3) in codes."""
    # Brightness does not count: any dark-to-light grid would resemble any other.
    design = np.column_stack([reference, np.ones(len(reference))])
    residual = codes - design @ np.linalg.lstsq(design, codes, rcond=None)[0]
    chroma = codes - codes.mean(axis=1, keepdims=True)
    if float((chroma**2).mean()) < LEAST_CHROMA**2:
        return 0.0
    residual_chroma = residual - residual.mean(axis=1, keepdims=True)
    return 1.0 - float((residual_chroma**2).sum() / (chroma**2).sum())


def sample_chart(shot: Shot, chart: LocatedChart) -> tuple[CellStatistics, CellStatistics]:
    """Return the statistics of the same squares in JPEG and RAW, as `patch_codes` returns them."""
    registration = shot.registration
    size = shot.raw.pixel_size
    offset = np.array([registration.offset_x, registration.offset_y])
    in_array = LocatedChart((registration.scale * chart.corners + offset - (size - 1) / 2) / size, chart.kind)
    return patch_codes(shot.jpeg, chart), patch_codes(shot.raw.pixels, in_array)


def _detect(jpeg: NDArray[np.uint8], kind: ChartKind) -> list[Array]:
    """Candidate quadrilaterals (4, 2) in JPEG pixels, around the pitches of the corner patches, clockwise."""
    cv2: Any = importlib.import_module("cv2")
    scale = min(1.0, LARGEST_SEARCHED / max(jpeg.shape))
    small = cv2.resize(jpeg[..., 2::-1], None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(getattr(cv2.mcc, kind.detector))
    try:
        checkers = detector.getListColorChecker() if detector.process(small, 4) else ()
    except cv2.error:  # pictures without contours; no chart is never an error
        return []
    grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.float64)
    candidates = []
    for checker in checkers:
        patches = np.asarray(checker.getColorCharts(), dtype=np.float64).reshape(-1, 4, 2)
        matrix, _ = cv2.findHomography(kind.centres, patches.mean(axis=1))
        corners = np.zeros((4, 2)) if matrix is None else _project(matrix, kind.outline)
        across = corners[1] - corners[0]
        down = corners[3] - corners[0]
        area = across[0] * down[1] - across[1] * down[0]
        if np.abs(area) > LEAST_PITCH**2 * len(kind.centres):
            # OpenCV counts the rows of some charts from below.
            corners = _refined(grey, corners if area > 0 else corners[::-1], kind)
            candidates.append((corners + 0.5) / scale - 0.5)
    return candidates


def _refined(grey: Array, corners: Array, kind: ChartKind) -> Array:
    """The corners (4, 2), moved to where the patches of a grey picture (h, w) are plainest."""
    # OpenCV's corners are off by up to a quarter of a pitch. At the right corners, points over most of a patch have the
    # mean of the patch.
    pitch = float(np.linalg.norm(corners[2] - corners[0]) / np.linalg.norm(kind.outline[2]))
    blurred = gaussian_filter(grey, 0.08 * pitch)  # so that the gradient shows the way to a far edge, too
    side = np.linspace(-0.38, 0.38, 7)
    points = kind.centres[:, None, :] + np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)

    def residuals(moved: Array) -> Array:
        x, y = np.moveaxis(_project(_homography(kind.outline, moved.reshape(4, 2)), points), -1, 0)
        values = map_coordinates(blurred, [y, x], order=1, mode="nearest")
        return np.asarray((values - values.mean(axis=1, keepdims=True)).ravel())

    options: Any = {"loss": "soft_l1", "f_scale": 4.0, "diff_step": 1e-3, "x_scale": pitch, "max_nfev": 30}
    return np.asarray(least_squares(residuals, corners.ravel(), **options).x.reshape(4, 2))


def patch_codes(picture: NDArray[np.uint8] | Single, chart: LocatedChart) -> CellStatistics:
    """The statistics (n, 3) of the pixels whose centres lie in each patch; NaN where it leaves the picture."""
    statistics = np.full((4, len(chart.kind.centres), 3), np.nan)
    for index, corners in enumerate(chart.patches()):
        low = np.floor(corners.min(axis=0)).astype(int)
        high = np.ceil(corners.max(axis=0)).astype(int) + 1
        if low.min() < 0 or high[0] > picture.shape[1] or high[1] > picture.shape[0]:
            continue
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
        side = np.roll(corners, -1, axis=0) - corners
        cross = np.stack([dx * (y - cy) - dy * (x - cx) for (cx, cy), (dx, dy) in zip(corners, side, strict=True)])
        pixels = picture[low[1] : high[1], low[0] : high[0]][np.all(cross >= 0, axis=0) | np.all(cross <= 0, axis=0)]
        if len(pixels):
            statistics[:, index] = pixels.mean(axis=0), pixels.std(axis=0), pixels.min(axis=0), pixels.max(axis=0)
    return CellStatistics(*statistics)


def _homography(outline: Array, corners: Array) -> Array:
    """The homography (3, 3) from chart coordinates, whose outline is (4, 2) in pitches, to JPEG pixels."""
    rows = []
    for (x, y), (u, v) in zip(outline, corners, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    solution = np.linalg.solve(np.array(rows), corners.ravel())
    return np.append(solution, 1.0).reshape(3, 3)


def _project(matrix: Array, points: Array) -> Array:
    """Points (…, 2) after a homography (3, 3)."""
    homogeneous = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ matrix.T
    projected: Array = homogeneous[..., :2] / homogeneous[..., 2:]
    return projected
