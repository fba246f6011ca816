"""Registration as a whole: search, choice, refinement, and what the camera corrected of its lens."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Codes
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.geometry import Placement, Registration
from lutforge.shots.registration.colour_prediction import explained
from lutforge.shots.registration.lens_correction import with_lens_correction
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg
from lutforge.shots.registration.refinement import HOPELESS, Fit, fit_on, refined
from lutforge.shots.registration.search import search, search_at_scale

MIN_CORRELATION = 0.5
"""Below this, structure does not agree: another scene, or a picture too blurred or noisy to register."""
MIN_EXPLAINED = 0.5
"""Share of the JPEG's colours that the RAW must explain."""
CLEAR_CORRELATION = 0.55
CLEAR_EXPLAINED = 0.9
"""A place above both is certain, and no other turn is tried."""
AMBIGUOUS = 1.5
"""Ratio of the unexplained shares of two places, the better one below, under which either may be the true one."""
NON_RIGID_MESSAGE = (
    "parts of the JPEG do not lie on their place in the RAW, by {:.1f} pixels in the mean (a straightened perspective, "
    "strong sharpening, or an unknown correction); switch that off, or use the camera's own JPEG"
)


def register_rotated(
    raw: RawImage, jpeg: Codes, turns: Sequence[int] = (0, 1, 2, 3), expected: Placement | None = None
) -> tuple[Codes, Registration]:
    """Turn the JPEG (h, w, 3) to the sensor's orientation, and register it.

    turns: quarter turns (numpy.rot90) that may do it, the likeliest first; the first to match clearly is taken, else
    the one that explains the JPEG's colours best. expected: of another shot of the camera; where this one clearly lies
    there, too, no other place is searched. Raises ShotError.
    """
    finest_raw = RawLevel.of(raw, jpeg)
    if expected is not None:
        for turn in turns:
            turned = np.rot90(jpeg, turn)
            registration = _at_expected(raw, finest_raw, turned, expected)
            if registration is not None:
                return np.ascontiguousarray(turned), registration

    best = _unambiguous(_candidates(raw, finest_raw, jpeg, turns))
    without_lens = refined(finest_raw, best.jpeg, best.fit.registration).registration
    registration = with_lens_correction(finest_raw, best.jpeg, best.fit, without_lens)
    if not registration.correlation >= MIN_CORRELATION:
        if registration.non_rigid:
            raise ShotError(NON_RIGID_MESSAGE.format(registration.non_rigid))
        raise _no_match(f"correlation {registration.correlation:.2f}, needed {MIN_CORRELATION}")
    return np.ascontiguousarray(np.rot90(jpeg, best.turn)), registration


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A registration of the reduced JPEG after some quarter turns, fitted on a coarse copy.

    searched: its scale before the fit; explained: the share of the JPEG's colours that the RAW explains there.
    """

    jpeg: ReducedJpeg
    fit: Fit
    turn: int
    searched: float
    explained: float

    @property
    def correlation(self) -> float:
        return self.fit.registration.correlation

    @property
    def is_clear(self) -> bool:
        return self.correlation > CLEAR_CORRELATION and self.explained > CLEAR_EXPLAINED

    def is_ambiguous_with(self, second: "_Candidate") -> bool:
        """True where a second place leaves nearly as little of the colours unexplained."""
        return 1 - second.explained < AMBIGUOUS * (1 - self.explained)


def _candidates(raw: RawImage, finest_raw: RawLevel, jpeg: Codes, turns: Sequence[int]) -> list[_Candidate]:
    """The places that the search proposes for each turn, until one is clear, best explained first."""
    candidates: list[_Candidate] = []
    for turn in turns:
        reduced = ReducedJpeg.of(raw, np.rot90(jpeg, turn))
        of_turn = [_fitted(finest_raw, reduced, reduced.coarsest, start, turn) for start in search(finest_raw, reduced)]
        candidates += of_turn
        if not of_turn or not of_turn[0].is_clear:
            continue

        # A scene may look the same upside down; its scale is the same there.
        opposite = turn + 2
        if all(candidate.turn % 4 != opposite % 4 for candidate in candidates):
            upside_down_jpeg = ReducedJpeg.of(raw, np.rot90(jpeg, opposite))
            starts = search_at_scale(finest_raw, upside_down_jpeg, of_turn[0].searched)
            candidates += [
                _fitted(finest_raw, upside_down_jpeg, upside_down_jpeg.coarsest, start, opposite) for start in starts
            ]
        break
    return sorted(candidates, key=lambda candidate: candidate.explained, reverse=True)


def _unambiguous(candidates: Sequence[_Candidate]) -> _Candidate:
    """The first of candidates, best explained first. Raises ShotError where it does not match, or not alone."""
    if not candidates:
        raise _no_match(f"correlation {0.0:.2f}, needed {MIN_CORRELATION}")
    best = candidates[0]
    if best.explained < MIN_EXPLAINED or best.correlation < HOPELESS:
        if max(best.correlation, 0.0) < MIN_CORRELATION:
            raise _no_match(f"correlation {max(best.correlation, 0.0):.2f}, needed {MIN_CORRELATION}")
        raise _no_match(f"{max(best.explained, 0.0):.0%} of its colours explained, needed {MIN_EXPLAINED:.0%}")
    if len(candidates) > 1 and best.is_ambiguous_with(candidates[1]):
        raise ShotError(
            "the JPEG lies on the RAW nearly as well at a second place, or turned; register it by a picture with more "
            "structure, as the camera wrote it"
        )
    return best


def _no_match(measured: str) -> ShotError:
    return ShotError(
        f"the JPEG does not match the RAW ({measured}): another scene, cropped, retouched, or too little structure"
    )


def _fitted(finest_raw: RawLevel, jpeg: ReducedJpeg, copy: ReducedJpeg, start: Registration, turn: int) -> _Candidate:
    """A registration fitted on one copy of the JPEG, and how much of the colours is explained there."""
    fit = fit_on(copy, finest_raw, start)
    scaled = fit.registration.reduced(copy.factor)
    raw, local = finest_raw.for_scale(scaled.scale).straightened(scaled, copy)
    return _Candidate(jpeg, fit, turn, start.scale, explained(raw, copy, local))


def _at_expected(raw: RawImage, finest_raw: RawLevel, jpeg: Codes, expected: Placement) -> Registration | None:
    """Refine an expected place; None where sizes are others, or the JPEG does not clearly lie there, this side up."""
    height, width = raw.pixels.shape[:2]
    if (height, width, raw.pixel_size) != expected.raw or jpeg.shape[:2] != expected.jpeg:
        return None
    reduced, start = ReducedJpeg.of(raw, jpeg), expected.registration
    coarsest = reduced.coarsest
    upright, upside_down = (_fitted(finest_raw, reduced, copy, start, 0) for copy in (coarsest, coarsest.upside_down))
    if not upright.is_clear or upright.is_ambiguous_with(upside_down):
        return None

    # Within reach of the finest copy, that alone is fitted.
    corners = np.array([[0, 0], jpeg.shape[1::-1]])
    moved = (upright.fit.registration.straight(corners) - start.straight(corners)) / start.scale
    near = np.abs(moved).max() < coarsest.factor / 2
    fit = fit_on(reduced, finest_raw, start) if near else refined(finest_raw, reduced, upright.fit.registration)
    registration = with_lens_correction(finest_raw, reduced, upright.fit, fit.registration)
    return registration if registration.correlation >= MIN_CORRELATION else None
