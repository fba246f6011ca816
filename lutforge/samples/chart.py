"""Colour charts: their kinds, and how one is found in a camera's JPEG, verified, and sampled in JPEG and RAW.

Layouts and sources are in data/charts.json; colours of ColorCheckers come with colour-science.
"""

import importlib
import json
import re
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import least_squares

from lutforge.arrays import Array, Pixels
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError, alternatives
from lutforge.shots.cells import CellStatistics
from lutforge.shots.read import Shot

D50 = "D50"


@dataclass(frozen=True, eq=False)
class ChartKind:
    """A kind of chart, upright. columns, rows: centres of its patches, in pitches from the outer edge of the first.

    detector: OpenCV's name of its detector, "" where it has none; source: of the colours. One of these says them, row
    by row: lab (n, 3) under D50; colours: name in colour-science, under D50; spectra: the same, reflectances.
    """

    name: str
    columns: Array
    rows: Array
    source: str = ""
    detector: str = ""
    lab: Array | None = None
    colours: str = ""
    spectra: str = ""

    @property
    def outline(self) -> Array:
        """The outer corners (4, 2) of the upright chart in pitches, clockwise from the first patch."""
        width, height = self.columns[-1] + 0.5, self.rows[-1] + 0.5
        return np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])

    @property
    def centres(self) -> Array:
        """The centres (n, 2) of the patches in pitches, row by row."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1).reshape(-1, 2)

    @property
    def places(self) -> Array:
        """The centres (n, 2) of the patches, row by row, −1 … 1 from edge to edge of the upright chart."""
        return np.asarray(self.centres / (self.outline[2] / 2) - 1.0)

    def linear_srgb(self, light: str = D50) -> Array:
        """Colours (n, 3) of the patches under a light, adapted to it: a perfect diffuser is 1, 1, 1.

        light: such as "5500K", "D55", "A" or "LED-B3". What is only known under D50 keeps those colours. Raises
        CalibrationError on an unknown light.
        """
        import colour  # a second to import

        from lutforge.colour.spectra import linear_srgb_under, reflectances, spectrum_of

        spectrum = spectrum_of(light)
        if self.spectra:
            return linear_srgb_under(reflectances(self.spectra), spectrum)
        white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][D50]
        xyz: Any
        if self.lab is not None:
            xyz = colour.Lab_to_XYZ(self.lab, white)
        else:
            published: Any = colour.CCS_COLOURCHECKERS[self.colours]
            white = published.illuminant
            xyz = colour.xyY_to_XYZ(np.array(list(published.data.values())))
        return np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", white, "Bradford", apply_cctf_encoding=False))


def chart_names() -> tuple[str, ...]:
    """The charts in data/charts.json."""
    return tuple(_known())


def _known() -> dict[str, Any]:
    return dict(json.loads(files(__package__).joinpath("data", "charts.json").read_text(encoding="utf-8")))


def chart_kind(word: str) -> ChartKind:
    """A chart by its name in data/charts.json. Raises CalibrationError."""
    known = _known()
    entry = known.get(word.lower())
    if entry is None:
        raise CalibrationError(
            f'no chart "{word[:60]}"; {alternatives(word, known)}; '
            "a Passport, Nano or Mega shows a classic, or a classic2014 if made after November 2014"
        )
    arrays = {key: np.array(entry[key], dtype=np.float64) for key in ("columns", "rows", "lab") if key in entry}
    words = {key: entry[key] for key in ("name", "source", "detector", "colours", "spectra") if key in entry}
    return ChartKind(**words, **arrays)  # type: ignore[arg-type]


def parse_corners(text: str) -> Array:
    """Four corners (4, 2) of a text such as "120,80 900,85 905,640 118,630". Raises CalibrationError."""
    numbers = re.findall(r"-?\d+(?:\.\d+)?", text)
    if len(numbers) != 8:
        raise CalibrationError(
            f'corners "{text[:60]}": give four points x,y in pixels, clockwise from the first patch\'s outer corner'
        )
    corners = np.array(numbers, dtype=np.float64).reshape(4, 2)
    sides = np.roll(corners, -1, axis=0) - corners
    turns = sides[:, 0] * np.roll(sides[:, 1], -1) - sides[:, 1] * np.roll(sides[:, 0], -1)
    if not np.all(turns > 0):  # y runs downwards
        raise CalibrationError(f'corners "{text[:60]}": these are not four corners of a chart, clockwise')
    return corners


# --- The search and its verification ----------------------------------------------------------------------------------
# The search is OpenCV's (Macbeth chart detection, in its objdetect module since version 5), an optional package. What
# it finds is only believed where the patches have the chart's colours in the chart's places: a false chart is worse
# than none.


RESEMBLANCE = 0.85
"""Share of the variance of a chart's chroma that an affine map of the published colours explains, at least."""


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart that was found in a JPEG.

    corners: (4, 2) x, y in JPEG pixels, at the outer corners of the corner patches' pitch (top left, top right, bottom
    right, bottom left of the upright chart; of a ColorChecker dark skin, bluish green, black and white).
    """

    corners: Array
    kind: ChartKind = field(default_factory=partial(chart_kind, "classic"))

    def patches(self) -> Array:
        """(n, 4, 2) corners x, y of the square sampled in each patch, in JPEG pixels; its side is 0.4 of the pitch."""
        square = 0.4 / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        homography = _homography(self.kind.outline, self.corners)
        return _project(homography, self.kind.centres[:, None, :] + square)


def detector_note() -> str | None:
    """Why charts are not searched for, in one line; None where they are."""
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


def find_chart(jpeg: NDArray[np.uint8], kind: ChartKind | None = None, reference: Array | None = None) -> Chart | None:
    """The chart in a JPEG (h, w, 3), in any rotation; None where there is none, or no detector.

    kind: a ColorChecker Classic unless another is named; reference: (n, 3) its sRGB codes, else those under D50.
    """
    kind = kind or chart_kind("classic")
    if not kind.detector or detector_note() is not None:
        return None
    turned = [Chart(np.roll(corners, turn, axis=0), kind) for corners in _detect(jpeg, kind) for turn in range(4)]
    if not turned:
        return None
    if reference is None:
        reference = 255.0 * srgb_encode(np.clip(kind.linear_srgb(), 0.0, 1.0))
    found = [patch_codes(jpeg, chart) for chart in turned]
    scores = [likeness(seen.mean, seen.std, reference) for seen in found]
    best = int(np.argmax(scores))
    return turned[best] if scores[best] >= RESEMBLANCE else None


def likeness(codes: Array, deviation: Array, reference: Array) -> float:
    """How like a chart patches are, at most 1, and 0 where they are not plain or hardly have colours.

    codes, deviation: (n, 3) mean and standard deviation of JPEG codes; their median deviation is 12 codes at most.
    reference: (n, 3) the chart's codes.
    """
    plain = bool(np.isfinite(codes).all()) and float(np.median(deviation.max(axis=1))) <= 12.0
    return resemblance(codes, reference) if plain else 0.0


def resemblance(codes: Array, reference: Array) -> float:
    """The share of the variance of chroma that an affine map of the reference explains; both (n, 3) in codes."""
    # Brightness does not count: it would make any dark-to-light grid alike.
    design = np.column_stack([reference, np.ones(len(reference))])
    residual = codes - design @ np.linalg.lstsq(design, codes, rcond=None)[0]
    chroma = codes - codes.mean(axis=1, keepdims=True)
    if float((chroma**2).mean()) < 5.0**2:
        return 0.0
    residual_chroma = residual - residual.mean(axis=1, keepdims=True)
    return 1.0 - float((residual_chroma**2).sum() / (chroma**2).sum())


def sample_chart(shot: Shot, chart: Chart) -> tuple[CellStatistics, CellStatistics]:
    """Return the statistics of the same squares in JPEG and RAW, as of `patch_codes`."""
    registration, size = shot.registration, shot.raw.pixel_size
    offset = np.array([registration.offset_x, registration.offset_y])
    in_array = Chart((registration.scale * chart.corners + offset - (size - 1) / 2) / size, chart.kind)
    return patch_codes(shot.jpeg, chart), patch_codes(shot.raw.pixels, in_array)


def _detect(jpeg: NDArray[np.uint8], kind: ChartKind) -> list[Array]:
    """Candidate quadrilaterals (4, 2) in JPEG pixels, around the pitches of the corner patches, clockwise."""
    cv2: Any = importlib.import_module("cv2")
    scale = min(1.0, 1000.0 / max(jpeg.shape))  # the detector brings smaller pictures up to this
    small = cv2.resize(jpeg[..., 2::-1], None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(getattr(cv2.mcc, kind.detector))
    try:
        found = detector.getListColorChecker() if detector.process(small, 4) else ()
    except cv2.error:  # pictures without contours; no chart is never an error
        return []
    grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.float64)
    candidates = []
    for one in found:
        patches = np.asarray(one.getColorCharts(), dtype=np.float64).reshape(-1, 4, 2)
        matrix, _ = cv2.findHomography(kind.centres, patches.mean(axis=1))
        corners = np.zeros((4, 2)) if matrix is None else _project(matrix, kind.outline)
        across, down = corners[1] - corners[0], corners[3] - corners[0]
        area = across[0] * down[1] - across[1] * down[0]
        if np.abs(area) > 400.0 * 0.01 * len(kind.centres):  # OpenCV gives points, too
            # OpenCV counts the rows of some charts from below.
            corners = _refined(grey, corners if area > 0 else corners[::-1], kind)
            candidates.append((corners + 0.5) / scale - 0.5)
    return candidates


def _refined(grey: Array, corners: Array, kind: ChartKind) -> Array:
    """The corners (4, 2), moved to where the patches of a grey picture (h, w) are plainest."""
    # OpenCV's are off by up to a quarter of a pitch. Points over most of each patch should have the patch's mean.
    pitch = float(np.linalg.norm(corners[2] - corners[0]) / np.linalg.norm(kind.outline[2]))
    blurred = gaussian_filter(grey, 0.08 * pitch)  # so that edges pull from afar
    side = np.linspace(-0.38, 0.38, 7)
    points = kind.centres[:, None, :] + np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)

    def residuals(moved: Array) -> Array:
        x, y = np.moveaxis(_project(_homography(kind.outline, moved.reshape(4, 2)), points), -1, 0)
        values = map_coordinates(blurred, [y, x], order=1, mode="nearest")
        return np.asarray((values - values.mean(axis=1, keepdims=True)).ravel())

    options: Any = {"loss": "soft_l1", "f_scale": 4.0, "diff_step": 1e-3, "x_scale": pitch, "max_nfev": 30}
    return np.asarray(least_squares(residuals, corners.ravel(), **options).x.reshape(4, 2))


def patch_codes(picture: NDArray[np.uint8] | Pixels, chart: Chart) -> CellStatistics:
    """The statistics (n, 3) of the pixels whose centres lie in each patch; NaN where it leaves the picture."""
    found = np.full((4, len(chart.kind.centres), 3), np.nan)
    for index, corners in enumerate(chart.patches()):
        low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int) + 1
        if low.min() < 0 or high[0] > picture.shape[1] or high[1] > picture.shape[0]:
            continue
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
        side = np.roll(corners, -1, axis=0) - corners
        cross = np.stack([dx * (y - cy) - dy * (x - cx) for (cx, cy), (dx, dy) in zip(corners, side, strict=True)])
        pixels = picture[low[1] : high[1], low[0] : high[0]][np.all(cross >= 0, axis=0) | np.all(cross <= 0, axis=0)]
        if len(pixels):
            found[:, index] = pixels.mean(axis=0), pixels.std(axis=0), pixels.min(axis=0), pixels.max(axis=0)
    return CellStatistics(*found)


def _homography(outline: Array, corners: Array) -> Array:
    """(3, 3) from chart coordinates, whose outline is (4, 2) in pitches, to JPEG pixels."""
    rows = []
    for (x, y), (u, v) in zip(outline, corners, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    solution = np.linalg.solve(np.array(rows), corners.ravel())
    return np.append(solution, 1.0).reshape(3, 3)


def _project(matrix: Array, points: Array) -> Array:
    homogeneous = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ matrix.T
    projected: Array = homogeneous[..., :2] / homogeneous[..., 2:]
    return projected
