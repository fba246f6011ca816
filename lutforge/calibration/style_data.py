"""The samples that a style is fitted to: unclipped, and balanced by the multipliers of their setting."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.continuation import Continuation, continuation
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, fit_matrix_and_response
from lutforge.errors import CalibrationError
from lutforge.model.directions import Both, Direction
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.cross_validation import leave_groups_out

LEAST_SAMPLES = 10


@dataclass(frozen=True, eq=False)
class StyleData:
    """The fitting samples of one style. balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,); samples: their rows.

    monochrome: the style is black and white. given: matrix and response that its lattices follow, None where they are
    fitted to the samples.
    """

    balanced: Array
    encoded: Array
    shot: NDArray[np.str_]
    samples: SampleSet
    monochrome: bool = False
    given: MatrixAndResponse | None = None

    @cached_property
    def base(self) -> MatrixAndResponse:
        """The matrix and response that the lattices follow where there are no samples. Raises CalibrationError."""
        return self.given or fit_matrix_and_response(self.balanced, self.encoded)

    @property
    def both(self) -> Both[tuple[Array, Array]]:
        """What each direction takes and gives at the samples, each (n, 3)."""
        return Both((self.balanced, self.encoded), (self.encoded, self.balanced))

    def prior_mean(self, size: int, direction: Direction) -> Continuation:
        """What a lattice of `size` nodes per axis follows where it has no samples; made when it is first asked for.

        Raises CalibrationError.
        """
        if (size, direction) not in self._prior_means:
            inverse = direction == "linearize"
            self._prior_means[size, direction] = continuation(
                self.base, *self.both[direction], inverse=inverse, size=size
            )
        return self._prior_means[size, direction]

    @cached_property
    def folds(self) -> list[tuple[Mask, "StyleData"]]:
        """The samples that are left out in turn to measure errors on, masks (n,), and those that stay."""
        return [(mask, self.select(~mask)) for mask in leave_groups_out(self.shot)]

    @cached_property
    def _prior_means(self) -> dict[tuple[int, Direction], Continuation]:
        return {}

    def select(self, rows: Mask) -> "StyleData":
        """The rows of a mask."""
        parts = (self.balanced[rows], self.encoded[rows], self.shot[rows], self.samples.select(rows))
        return StyleData(*parts, self.monochrome, self.given)


def unclipped(samples: SampleSet, multipliers: Array) -> Mask:
    """Return the mask (n,) of samples that are not clipped, nor after white balance by multipliers (n, 3)."""
    return np.asarray(unclipped_colours(samples.srgb, samples.raw) & np.all(samples.raw * multipliers < 1.0, axis=1))


def styles_with_enough(samples: SampleSet, multipliers: Array) -> tuple[Mask, tuple[str, ...]]:
    """Return the mask (n,) of samples whose style has enough unclipped ones to fit, and notes on the other styles.

    Raises CalibrationError where no style has enough.
    """
    usable = unclipped(samples, multipliers)
    colours = np.rint(samples.srgb * 255) @ [1 << 16, 1 << 8, 1]  # a colour that a table repeats counts once
    counts = {str(name): len(np.unique(colours[usable & (samples.style == name)])) for name in np.unique(samples.style)}
    few = {name: count for name, count in counts.items() if count < LEAST_SAMPLES}
    advice = "add shots with more colours, exposed so that neither the JPEG nor the RAW clips"
    notes = tuple(
        f'style "{name}": {count} unclipped samples of different colours; at least {LEAST_SAMPLES} are needed: {advice}'
        for name, count in few.items()
    )
    if len(few) == len(counts):
        raise CalibrationError(notes[0])
    return ~np.isin(samples.style, list(few)), tuple(f"left out: {note}" for note in notes)


def style_data(samples: SampleSet, multipliers: Array) -> tuple[dict[str, StyleData], int]:
    """Return the StyleData of each style with enough unclipped samples, and the number of clipped samples."""
    enough, _ = styles_with_enough(samples, multipliers)
    balanced = samples.raw * multipliers
    usable = unclipped(samples, multipliers) & enough
    styles = {}
    for name in np.unique(samples.style[enough]):
        rows = usable & (samples.style == name)
        monochrome = is_monochrome(balanced[rows], samples.srgb[rows])
        styles[str(name)] = StyleData(
            balanced[rows], samples.srgb[rows], samples.shot[rows], samples.select(rows), monochrome
        )
    return styles, int((enough & ~usable).sum())
