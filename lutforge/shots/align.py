"""Registration of a camera's JPEG on its RAW: one scale and an offset.

They are found by search, and refined below a tenth of a pixel.

The two pictures differ by a tone curve and a colour matrix, so what is compared is their local structure:
luma, gamma-compressed, band-passed, and divided by its local contrast. A coarse search (all plausible scales;
all offsets at once by FFT) proposes places. The one where the RAW's colours explain the JPEG's best is taken, if no
other does nearly as well, and refined by Gauss–Newton steps on scale and offset (Lucas & Kanade 1981,
https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf), coarse to fine. The RAW is always averaged over exactly the
area of a JPEG pixel.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.cells import area_weights, cell_edges
from lutforge.shots.shot import Registration

MIN_SIDE = 200
"""A JPEG whose longer side is shorter than this is a thumbnail: its pixels average too much of the scene."""

MIN_CORRELATION = 0.5
"""Below this, structure does not agree: another scene, or a picture too blurred or noisy to register."""

_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601, as in JPEG
_COARSE_SIDE = 192
"""Pixels of the longer side of the copy that is searched."""


def register(raw: RawImage, jpeg: NDArray[np.uint8]) -> Registration:
    """Scale and offset of a JPEG (h, w, 3) that is oriented like the sensor.

    Raises ShotError where it is too small, or where nothing correlates by at least MIN_CORRELATION.
    """
    return register_rotated(raw, jpeg, (0,))[1]


def register_rotated(
    raw: RawImage, jpeg: NDArray[np.uint8], turns: Sequence[int] = (0, 1, 2, 3)
) -> tuple[NDArray[np.uint8], Registration]:
    """Turn the JPEG to the sensor's orientation, and register it.

    turns: quarter turns (numpy.rot90) that may do it, the likeliest first; the first to match clearly is taken, else
    the one that explains the JPEG's colours best. Raises ShotError as `register`, and where another place or turn
    explains them nearly as well.
    """
    channels = _compressed_channels(raw)
    luma = np.tensordot(_LUMA, channels, axes=1)
    found: list[_Candidate] = []
    for turn in turns:
        reduced = _reduced(raw, np.rot90(jpeg, turn))
        places = _search(luma, raw.pixel_size, reduced)
        candidates = [_judged(channels, raw.pixel_size, reduced, place, turn) for place in places]
        found += candidates
        if candidates and candidates[0].is_clear:
            if any(other.turn % 4 == (turn + 2) % 4 for other in found):
                break
            # A scene may look alike upside down; the same scale serves there.
            over = _reduced(raw, np.rot90(jpeg, turn + 2))
            place = _search(luma, raw.pixel_size, over, scale=places[0].scale)
            found += [_judged(channels, raw.pixel_size, over, start, turn + 2) for start in place]
            break
    found.sort(key=lambda candidate: candidate.explained, reverse=True)
    if not found or found[0].explained < 0.5 or found[0].start.correlation < 0.3:
        best = max((candidate.start.correlation for candidate in found), default=0.0)
        raise ShotError(_NO_MATCH.format(max(best, 0.0), MIN_CORRELATION))
    if len(found) > 1 and 1 - found[1].explained < 1.5 * (1 - found[0].explained):
        raise ShotError(
            "the JPEG lies on the RAW nearly as well at a second place, or turned; register it by another picture: one "
            "with more structure, as the camera wrote it"
        )
    turned = np.ascontiguousarray(np.rot90(jpeg, found[0].turn))
    registration = _refine(channels, raw.pixel_size, _reduced(raw, turned), found[0].start)
    if not registration.correlation >= MIN_CORRELATION:
        raise ShotError(_NO_MATCH.format(registration.correlation, MIN_CORRELATION))
    return turned, registration


_NO_MATCH = (
    "the JPEG does not match the RAW (correlation {:.2f}, needed {}): another scene, cropped or retouched, or too "
    "little structure to register"
)


@dataclass(frozen=True)
class _Candidate:
    """A place, by coarse search, after quarter turns; explained: see `_explained`."""

    start: Registration
    turn: int
    explained: float

    @property
    def is_clear(self) -> bool:
        return self.start.correlation > 0.55 and self.explained > 0.9


def _judged(channels: Array, pixel_size: float, jpeg: "_ReducedJpeg", start: Registration, turn: int) -> _Candidate:
    """A place that the coarse search found, moved to where it fits best on a coarse copy, and how well it does."""
    level = jpeg.halved(_halvings(jpeg))
    place = _unreduced(start, 1 / level.factor)
    luma = _predicted_luma(channels, pixel_size, level, place)
    place = _gauss_newton(luma, pixel_size, level.luma, level.weight, place)
    explained = _explained(channels, pixel_size, level, place)
    return _Candidate(_unreduced(place, level.factor), turn, explained)


def _explained(channels: Array, pixel_size: float, jpeg: "_ReducedJpeg", place: Registration) -> float:
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place.

    At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    """
    terms, use = _terms_at(channels, pixel_size, jpeg, place)
    codes = jpeg.codes.reshape(-1, 3)[use]
    if len(codes) < 200:
        return 0.0
    residual = codes - terms @ _least_squares(terms, codes)
    total = float(np.square(codes - codes.mean(axis=0)).sum())
    return 1 - float(np.square(residual).sum()) / max(total, 1e-9)


@dataclass(frozen=True, eq=False)
class _ReducedJpeg:
    """Return the JPEG's codes (h, w, 3) / 255, averaged over factor×factor pixels, and the weight of each pixel.

    The weight is 0 where a pixel is clipped, or in a black bar.
    """

    codes: Array
    weight: Array
    factor: int

    @cached_property
    def luma(self) -> Array:
        return np.asarray(self.codes @ _LUMA)

    def halved(self, times: int) -> "_ReducedJpeg":
        """Reduced by 2^times more."""
        if times == 0:
            return self
        weight = (_block_mean(self.weight, 2**times) > 0.99).astype(np.float64)
        return _ReducedJpeg(_block_mean(self.codes, 2**times), weight, self.factor * 2**times)


def _reduced(raw: RawImage, jpeg: NDArray[np.uint8]) -> _ReducedJpeg:
    """Reduce to at most a million pixels, not finer than the RAW array, whose blocks would be compared otherwise."""
    height, width = jpeg.shape[:2]
    if max(height, width) < MIN_SIDE or min(height, width) < MIN_SIDE // 2:
        raise ShotError(f"only {width}×{height} pixels: a thumbnail, too small to register")
    factor = max(
        math.ceil(math.sqrt(height * width / 1e6)),
        math.ceil(max(height, width) / max(raw.pixels.shape)),
    )
    small = _block_mean(jpeg.astype(np.float32), factor).astype(np.float64)
    brightest = small.max(axis=2)
    weight = ((brightest < 252) & (brightest > 4)) * _inside_bars(brightest)
    return _ReducedJpeg(small / 255, weight, factor)


def _compressed_channels(raw: RawImage) -> Array:
    """RAW channels (3, h, w) brought to equal brightness (a grey-world white balance), then gamma 1/2.2."""
    means = raw.pixels[::4, ::4].mean(axis=(0, 1), dtype=np.float64)
    factors = (0.25 / np.maximum(means, 1e-6)).astype(np.float32)
    balanced = np.ascontiguousarray(np.moveaxis(raw.pixels, 2, 0)) * factors[:, None, None]
    return np.asarray(np.power(np.maximum(balanced, 0), np.float32(1 / 2.2)), dtype=np.float64)


def _predicted_luma(channels: Array, pixel_size: float, jpeg: _ReducedJpeg, found: Registration) -> Array:
    """RAW as the luma that the camera would make of it: a quadratic of the channels, fitted on the overlap.

    The colour matrix and the tone curve are unknown; a fixed luma would invert the contrast of many edges
    between saturated colours.
    """
    terms, use = _terms_at(channels, pixel_size, jpeg, found)
    weights = _least_squares(terms, jpeg.luma.ravel()[use])
    constant, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    luma = np.full(channels.shape[1:], constant)
    for rows in range(0, len(luma), 32):  # so many stay in the cache
        r, g, b = channels[:, rows : rows + 32]
        luma[rows : rows + 32] += (
            r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b)
        )
    return luma


def _terms_at(
    channels: Array, pixel_size: float, jpeg: _ReducedJpeg, place: Registration
) -> tuple[Array, NDArray[np.intp]]:
    """The quadratic terms (n, 10) of the RAW under some 20,000 of the JPEG's pixels, and which these are (n,)."""
    shape = (jpeg.luma.shape[0], jpeg.luma.shape[1])
    sampled = [_sample(channel, pixel_size, place, shape) for channel in channels]
    use = np.flatnonzero((jpeg.weight * sampled[0][1]).ravel() > 0.5)
    use = use[:: max(1, len(use) // 20_000)]
    return np.stack([*_quadratic(*(plane.ravel()[use] for plane, _ in sampled))], axis=1), use


def _least_squares(terms: Array, values: Array) -> Array:
    normal = terms.T @ terms
    normal += 1e-6 * (np.trace(normal) / len(normal) + 1e-12) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, terms.T @ values))


def _quadratic(r: Array, g: Array, b: Array) -> Iterator[Array]:
    yield from (np.ones_like(r), r, g, b, r * r, g * g, b * b, r * g, g * b, b * r)


def _inside_bars(brightest: Array) -> Array:
    """(h, w) 0 on the black bars that some cameras put around a preview of another aspect ratio, else 1."""
    dark = brightest < 16
    mask = np.ones(dark.shape)
    for axis in (0, 1):
        lines = np.asarray(dark.mean(axis=1 - axis) > 0.99)
        inside = np.flatnonzero(~lines)
        if inside.size and len(lines) - inside.size < 0.4 * len(lines):
            low, high = int(inside[0]), int(inside[-1]) + 1
            index = np.arange(len(lines))
            bar = (index < low + (2 if low else 0)) | (index >= high - (2 if high < len(lines) else 0))
            mask *= (~bar)[:, None] if axis == 0 else (~bar)[None, :]
    return mask


def _block_mean(image: Array, factor: int) -> Array:
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    blocks = image[: height * factor, : width * factor].reshape(height, factor, width, factor, *image.shape[2:])
    return np.asarray(blocks.mean(axis=(1, 3)))


_COARSE = 6.0
"""Standard deviation, in pixels, of what is taken for shading and tone: structure much coarser does not count."""


def _share(weight: Array) -> Array:
    """How much of the weight around each pixel there is."""
    return np.asarray(np.maximum(scipy.ndimage.gaussian_filter(weight, _COARSE), 1e-6))


def _structure(luma: Array, weight: Array, share: Array) -> Array:
    """Luma without its coarse part, divided by its local contrast: what a tone curve leaves as it is.

    share: of the weight. Structure below the noise of rounding to 8 bits is none.
    """
    detail = luma - scipy.ndimage.gaussian_filter(luma * weight, _COARSE) / share
    energy = scipy.ndimage.gaussian_filter(detail * detail * weight, _COARSE) / share
    floor = 0.5 * float(np.average(energy, weights=weight + 1e-12))
    return np.asarray(detail / np.sqrt(energy + floor + (0.3 / 255) ** 2) * weight)


def _sample(luma: Array, pixel_size: float, registration: Registration, shape: tuple[int, int]) -> tuple[Array, Array]:
    """RAW luma averaged over each JPEG pixel (h, w), and the share of each that RAW covers."""
    planes, covers = [], []
    for axis, offset in ((0, registration.offset_y), (1, registration.offset_x)):
        edges = cell_edges(registration.scale, offset, shape[axis], 1, pixel_size)
        planes.append(area_weights(edges, luma.shape[axis]))
        covers.append((edges[:-1] >= 0) & (edges[1:] <= luma.shape[axis]))
    sampled = planes[0] @ luma @ planes[1].T
    return np.asarray(sampled), (covers[0][:, None] & covers[1][None, :]).astype(np.float64)


def _search(raw_luma: Array, pixel_size: float, jpeg: _ReducedJpeg, scale: float | None = None) -> list[Registration]:
    """The best place at all plausible scales (or at the one given) with all offsets, and the second best of that scale.

    Searched on a small copy; in coordinates of the whole JPEG. Empty where there is nothing to compare.
    """
    factor = max(1, round(max(jpeg.luma.shape) / _COARSE_SIDE))
    mask = (_block_mean(jpeg.weight, factor) > 0.5).astype(np.float64)
    template = _structure(_block_mean(jpeg.luma, factor), mask, _share(mask))
    whole = factor * jpeg.factor
    scales = _plausible_scales(raw_luma.shape, pixel_size, mask) if scale is None else np.array([scale * whole])
    if not scales.size:
        return []
    sides = [math.ceil(size * pixel_size / scales.min()) for size in raw_luma.shape]
    shape = [scipy.fft.next_fast_len(size + own, real=True) for size, own in zip(sides, template.shape, strict=True)]
    spectra = [np.conj(scipy.fft.rfft2(plane.astype(np.float32), shape)) for plane in (template, mask)]
    pattern = _Pattern(template, mask, spectra[0], spectra[1], shape)
    found = [_match(raw_luma, pixel_size, pattern, float(scale)) for scale in scales]
    best = max(found, key=lambda places: places[0].correlation)
    return [_unreduced(place, whole) for place in best]


@dataclass(frozen=True, eq=False)
class _Pattern:
    """What is looked for: the small JPEG's structure, its mask, and their transforms' conjugates at a shape.

    The transforms are of single precision: what they find is refined.
    """

    template: Array
    mask: Array
    matched: NDArray[np.complex64]
    covering: NDArray[np.complex64]
    shape: list[int]

    @cached_property
    def area(self) -> Array:
        """(h + 1, w + 1) the mask's sum above and left of each corner."""
        return np.pad(self.mask.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))

    def overlap(self, rows: int, columns: int) -> Array:
        """The mask's sum on a picture of rows × columns, at each shift of the transforms' shape."""
        ends = []
        for size, own, most in zip((rows, columns), self.mask.shape, self.shape, strict=True):
            shift = np.arange(most)
            shift = np.where(shift < size, shift, shift - most)
            ends.append((np.clip(-shift, 0, own), np.clip(size - shift, 0, own)))
        (top, bottom), (left, right) = ends
        low, high = self.area[top], self.area[bottom]
        return np.asarray(high[:, right] - high[:, left] - low[:, right] + low[:, left])


def _plausible_scales(raw_shape: tuple[int, ...], pixel_size: float, mask: Array) -> Array:
    """Scales at which the picture (without bars) is as wide or as high as the RAW, 6 % less to 3 % more.

    Cameras trim the borders before they make the JPEG.
    """
    inside = np.flatnonzero(mask.max(axis=1)), np.flatnonzero(mask.max(axis=0))
    if not inside[0].size or not inside[1].size:
        return np.zeros(0)
    ratios = [raw_shape[axis] * pixel_size / (inside[axis][-1] - inside[axis][0] + 1) for axis in (0, 1)]
    steps = np.arange(-8, 6) * 0.0075
    scales = np.concatenate([ratio * np.exp(steps) for ratio in ratios])
    scales = np.sort(scales)
    keep = np.concatenate([[True], np.diff(np.log(scales)) > 1e-9])
    return np.asarray(scales[keep])


def _match(raw_luma: Array, pixel_size: float, pattern: _Pattern, scale: float) -> list[Registration]:
    """Return the best offset at one scale, and the best a tenth of the picture or more away from it.

    They are found by normalised cross-correlation of the masked template.
    """
    (height, width), shape = pattern.template.shape, pattern.shape
    rows = math.ceil(raw_luma.shape[0] * pixel_size / scale)
    columns = math.ceil(raw_luma.shape[1] * pixel_size / scale)
    origin = Registration(scale, 0.0, 0.0, 0.0)
    plane, cover = _sample(raw_luma, pixel_size, origin, (rows, columns))
    # The cover is a rectangle: its filter is that of its sides.
    sides = [scipy.ndimage.gaussian_filter1d(cover.max(axis=axis), _COARSE) for axis in (1, 0)]
    field = _structure(plane, cover, np.maximum(np.outer(*sides), 1e-6)).astype(np.float32)
    matched = scipy.fft.irfft2(scipy.fft.rfft2(field, shape) * pattern.matched, shape)
    energy = scipy.fft.irfft2(scipy.fft.rfft2(field * field, shape) * pattern.covering, shape)
    overlap = pattern.overlap(*(int(side.sum()) for side in (cover.max(axis=1), cover.max(axis=0))))
    total = float((pattern.template**2).sum())
    score = matched / np.sqrt(np.maximum(energy, 0.2 * total) * total + 1e-12)
    score[overlap < 0.8 * pattern.mask.sum()] = -1.0
    places: list[Registration] = []
    for _ in range(2):
        y, x = np.unravel_index(int(np.argmax(score)), score.shape)
        if places and score[y, x] < 0.5 * places[0].correlation:
            break
        shift_y = int(y) if y < rows else int(y) - shape[0]
        shift_x = int(x) if x < columns else int(x) - shape[1]
        places.append(Registration(scale, scale * shift_x, scale * shift_y, float(score[y, x])))
        near_y, near_x = (np.arange(-round(size / 10), round(size / 10) + 1) for size in (height, width))
        score[np.ix_((y + near_y) % shape[0], (x + near_x) % shape[1])] = -1.0
    return places


def _refine(channels: Array, pixel_size: float, jpeg: _ReducedJpeg, start: Registration) -> Registration:
    """Gauss–Newton from coarse to fine copies of the JPEG; in coordinates of the whole JPEG."""
    found = start
    for times in range(_halvings(jpeg), -1, -1):
        level = jpeg.halved(times)
        scaled = _unreduced(found, 1 / level.factor)
        raw_luma = _predicted_luma(channels, pixel_size, level, scaled)
        found = _unreduced(_gauss_newton(raw_luma, pixel_size, level.luma, level.weight, scaled), level.factor)
    return found


def _halvings(jpeg: _ReducedJpeg) -> int:
    """How often a JPEG is halved to become about as small as for the coarse search."""
    return max(0, round(math.log2(max(jpeg.luma.shape) / _COARSE_SIDE)))


def _gauss_newton(raw_luma: Array, pixel_size: float, jpeg: Array, weight: Array, start: Registration) -> Registration:
    height, width = jpeg.shape
    y = np.arange(height)[:, None] - (height - 1) / 2
    x = np.arange(width)[None, :] - (width - 1) / 2
    whole = _share(weight)
    target = _structure(jpeg, weight, whole)
    found = start
    for _ in range(8):
        plane, cover = _sample(raw_luma, pixel_size, found, (height, width))
        mask = weight * cover
        moving = _structure(plane, mask, whole if cover.all() else _share(mask))
        norm = math.sqrt(float((moving**2 * mask).sum()) * float((target**2 * mask).sum())) + 1e-12
        product = float((moving * target * mask).sum())
        found = Registration(found.scale, found.offset_x, found.offset_y, product / norm)
        gain = product / (float((target**2 * mask).sum()) + 1e-12)
        # gradient of the mean of both pictures: an unbiased, faster converging step (Benhimane & Malis 2004)
        mean = (moving + gain * target) / 2
        gradient_y, gradient_x = np.gradient(mean)
        inner = scipy.ndimage.minimum_filter(mask, 3)
        columns = np.stack([(gradient_x * x + gradient_y * y), gradient_x, gradient_y]) * inner
        residual = ((gain * target - moving) * inner).ravel()
        flat = columns.reshape(3, -1)
        try:
            step = np.linalg.solve(flat @ flat.T + 1e-9 * np.eye(3), flat @ residual)
        except np.linalg.LinAlgError:
            break
        if not np.all(np.isfinite(step)) or abs(step[0]) > 0.05 or np.abs(step[1:]).max() > 8:
            break
        found = _moved(found, step, height, width)
        if abs(step[0]) * width < 2e-3 and np.abs(step[1:]).max() < 2e-3:
            break
    return found


def _moved(found: Registration, step: Array, height: int, width: int) -> Registration:
    """Apply a step (relative scale, x, y in JPEG pixels) taken about the JPEG's centre."""
    cx, cy = width / 2, height / 2
    scale = found.scale * (1 + float(step[0]))
    return Registration(
        scale,
        found.offset_x + found.scale * (cx + float(step[1])) - scale * cx,
        found.offset_y + found.scale * (cy + float(step[2])) - scale * cy,
        found.correlation,
    )


def _unreduced(found: Registration, factor: float) -> Registration:
    """Convert from coordinates of a JPEG reduced by `factor` to its own; 1/factor goes the other way."""
    return Registration(found.scale / factor, found.offset_x, found.offset_y, found.correlation)
