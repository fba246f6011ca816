"""Registration of a camera's JPEG on its RAW: one scale and an offset, and what the camera straightened.

They are found by search, and refined below a tenth of a pixel.

The two pictures differ by a tone curve and a colour matrix, so what is compared is their local structure:
luma, gamma-compressed, band-passed, and divided by its local contrast. A coarse search (`cross_correlation`) proposes
places. The one where the RAW's colours explain the JPEG's best is taken, if no other does nearly as well, and refined
coarse to fine (`lucas_kanade`), and ends with how the lens bent what the JPEG shows straight (`geometry`), where
that is beyond chance. Each step works on the coarsest copies that serve it (`pyramid`); the RAW is always
averaged over exactly the area of a JPEG pixel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Codes
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.cross_correlation import search
from lutforge.shots.geometry import Distortion, Placement, Registration
from lutforge.shots.lucas_kanade import HOPELESS, Fit, fringes, moved_to_fit
from lutforge.shots.predicted_colours import explained
from lutforge.shots.pyramid import RawPyramid, ReducedJpeg

SIGNIFICANT = 30.0
"""Evidence for a distortion from which on it is believed: the 17 pictures of six cameras without one show up to 18."""
MIN_CORRELATION = 0.5
"""Below this, structure does not agree: another scene, or a picture too blurred or noisy to register."""


def register(raw: RawImage, jpeg: Codes) -> Registration:
    """Scale and offset of a JPEG (h, w, 3) that is oriented like the sensor.

    Raises ShotError where it is too small, or where nothing correlates by at least MIN_CORRELATION.
    """
    return register_rotated(raw, jpeg, (0,))[1]


def register_rotated(
    raw: RawImage, jpeg: Codes, turns: Sequence[int] = (0, 1, 2, 3), expected: Placement | None = None
) -> tuple[Codes, Registration]:
    """Turn the JPEG to the sensor's orientation, and register it.

    turns: quarter turns (numpy.rot90) that may do it, the likeliest first; the first to match clearly is taken, else
    the one that explains the JPEG's colours best. expected: of another shot of the camera; where this one clearly lies
    there, too, no other place is searched. Raises ShotError as `register`, and where another place or turn explains
    the colours nearly as well.
    """
    pyramid = RawPyramid.of(raw, jpeg)
    for turn in turns if expected is not None else ():
        turned = np.rot90(jpeg, turn)
        if expected is not None and (registration := _as_expected(raw, pyramid, turned, expected)) is not None:
            return np.ascontiguousarray(turned), registration
    found: list[_Candidate] = []
    for turn in turns:
        reduced = ReducedJpeg.of(raw, np.rot90(jpeg, turn))
        candidates = [_judged(pyramid, reduced, place, turn) for place in search(pyramid, reduced)]
        found += candidates
        if candidates and candidates[0].is_clear:
            if any(other.turn % 4 == (turn + 2) % 4 for other in found):
                break
            # A scene may look alike upside down; the same scale serves there.
            over = ReducedJpeg.of(raw, np.rot90(jpeg, turn + 2))
            places = search(pyramid, over, scale=candidates[0].searched)
            found += [_judged(pyramid, over, place, turn + 2) for place in places]
            break
    found.sort(key=lambda candidate: candidate.explained, reverse=True)
    if not found or found[0].explained < 0.5 or found[0].fit.place.correlation < HOPELESS:
        correlation = max(found[0].fit.place.correlation, 0.0) if found else 0.0
        if correlation < MIN_CORRELATION:
            raise ShotError(_NO_MATCH.format(f"correlation {correlation:.2f}, needed {MIN_CORRELATION}"))
        share = f"{max(found[0].explained, 0.0):.0%} of its colours explained, needed 50%"
        raise ShotError(_NO_MATCH.format(share))
    if len(found) > 1 and 1 - found[1].explained < 1.5 * (1 - found[0].explained):
        raise ShotError(
            "the JPEG lies on the RAW nearly as well at a second place, or turned; register it by another picture: one "
            "with more structure, as the camera wrote it"
        )
    registration = _with_lens(pyramid, found[0], _refined(pyramid, found[0].jpeg, found[0].fit.place).place)
    if not registration.correlation >= MIN_CORRELATION:
        raise ShotError(_NO_MATCH.format(f"correlation {registration.correlation:.2f}, needed {MIN_CORRELATION}"))
    return np.ascontiguousarray(np.rot90(jpeg, found[0].turn)), registration


def _as_expected(raw: RawImage, pyramid: RawPyramid, jpeg: Codes, expected: Placement) -> Registration | None:
    """Refine an expected place; None where the sizes are others, or the JPEG does not clearly lie there, this side up.

    A place that moves on the coarse copy by less than half of its pixels is within reach of the finest copy.
    """
    height, width = raw.pixels.shape[:2]
    if (height, width, raw.pixel_size) != expected.raw or jpeg.shape[:2] != expected.jpeg:
        return None
    reduced, start = ReducedJpeg.of(raw, jpeg), expected.registration
    start = replace(start, distortion=start.distortion or _flat(pyramid))
    level = reduced.coarsest
    found, over = (_judged(pyramid, reduced, start, 0, one) for one in (level, level.upside_down))
    if not found.is_clear or 1 - over.explained < 1.5 * (1 - found.explained):
        return None
    corners = np.array([[0, 0], jpeg.shape[1::-1]])
    moved = (found.fit.place.straight(corners) - start.straight(corners)) / start.scale
    near = np.abs(moved).max() < level.factor / 2
    fit = _fit(pyramid, reduced, start) if near else _refined(pyramid, reduced, found.fit.place)
    registration = _with_lens(pyramid, found, fit.place)
    return registration if registration.correlation >= MIN_CORRELATION else None


_NO_MATCH = (
    "the JPEG does not match the RAW ({}): another scene, cropped or retouched, or too little structure to register"
)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A place of the reduced, turned JPEG.

    fit: by coarse search and refined on a coarse copy; searched: the scale by coarse search; explained: see there.
    """

    jpeg: ReducedJpeg
    fit: Fit
    turn: int
    searched: float
    explained: float

    @property
    def is_clear(self) -> bool:
        return self.fit.place.correlation > 0.55 and self.explained > 0.9


def _judged(
    pyramid: RawPyramid, jpeg: ReducedJpeg, start: Registration, turn: int, level: ReducedJpeg | None = None
) -> _Candidate:
    """A place that the coarse search found, moved to where it fits best on a coarse copy, and how well it does."""
    level = level or jpeg.coarsest
    start = replace(start, distortion=start.distortion or _flat(pyramid))
    fit = _fit(pyramid, level, start)
    scaled = fit.place.reduced(level.factor)
    raw = pyramid.for_scale(scaled.scale)
    pixels, local = scaled.straightened(raw.pixels, raw.pixel_size, level.weight.shape)
    return _Candidate(jpeg, fit, turn, start.scale, explained(replace(raw, pixels=pixels), level, local))


def _refined(pyramid: RawPyramid, jpeg: ReducedJpeg, start: Registration, count: int = 3) -> Fit:
    """Refine on ever finer copies of the JPEG."""
    fit = _fit(pyramid, jpeg.coarsest, start, count)
    for times in range(jpeg.halvings - 1, -1, -1):
        fit = _fit(pyramid, jpeg.halved(times), fit.place, count)
    return fit


def _with_lens(pyramid: RawPyramid, candidate: _Candidate, place: Registration) -> Registration:
    """Add how the lens bent what the camera straightened, and the fringes that it took away: what is beyond chance.

    Both are looked for on the coarsest copy, where chance has never reached the limit.
    """
    jpeg, flat, bent = candidate.jpeg, _flat(pyramid), candidate.fit.evidence(candidate.fit.step[3:], 3) > SIGNIFICANT
    if bent:
        fit = _refined(pyramid, jpeg, replace(candidate.fit.place, distortion=flat), 5)
        lens = fit.place.distortion or flat
        bent = fit.evidence(np.array([lens.k1, lens.k2]), 3) > SIGNIFICANT
        place = fit.place if bent else place
    larger = _fringes(pyramid, jpeg.coarsest, place)
    coloured = larger.evidence(larger.step[:2], 0) > SIGNIFICANT
    for _ in range(2 if coloured else 0):
        larger = _fringes(pyramid, jpeg.halved(max(jpeg.halvings - 1, 0)), place)
        lens, (red, blue) = place.distortion or flat, (float(share) for share in larger.step[:2])
        place = replace(place, distortion=replace(lens, red=lens.red + red, blue=lens.blue + blue))
    if bent:
        fit = _fit(pyramid, jpeg, place, 7)
        lens = fit.place.distortion or flat
        if fit.evidence(np.array([lens.x - flat.x, lens.y - flat.y]), 5) > SIGNIFICANT:
            return fit.place
    if bent or coloured:
        return _fit(pyramid, jpeg, place, 5 if bent else 3).place
    return replace(place, distortion=None) if place.distortion == flat else place


def _flat(pyramid: RawPyramid) -> Distortion:
    """No distortion, about the middle of the RAW."""
    size = np.array(pyramid.finest.pixels.shape[1::-1]) * pyramid.finest.pixel_size
    return Distortion(float(size[0]) / 2, float(size[1]) / 2, float(np.linalg.norm(size)) / 2)


def _fringes(pyramid: RawPyramid, level: ReducedJpeg, place: Registration) -> Fit:
    """By what shares red and blue are drawn larger, on one copy of the JPEG."""
    scaled = place.reduced(level.factor)
    return fringes(pyramid.for_scale(scaled.scale), level, scaled)


def _fit(pyramid: RawPyramid, level: ReducedJpeg, start: Registration, count: int = 3) -> Fit:
    """Move a place to where it fits best on one copy of the JPEG; in coordinates of the whole JPEG, as `start`."""
    scaled = start.reduced(level.factor)
    fit = moved_to_fit(pyramid.for_scale(scaled.scale), level, scaled, count)
    return replace(fit, place=fit.place.reduced(1 / level.factor))
