"""The numbers of the lattice fit that were chosen by measurement.

Figures are of 17 nodes per axis on the 30 % of the Nikon D40's published pairs that are held out: the mean and the
largest error norm, encoded 0 … 1, medians over five splits. With these numbers they are 0.0027 and 0.015, of the plain
form 0.0040 and 0.039.
"""

from dataclasses import dataclass

SEARCH_SIZE = 13
"""Nodes per axis of the lattice on which node levels and λ_S are searched: the best levels hardly depend on their
number. λ_S is stated for this size wherever it is kept."""

MEASURING_TOLERANCE = 1e-4
"""The tolerance of fits whose only use is to measure an error: within 1e-4 of the exact ones on every sample."""


@dataclass(frozen=True)
class LatticeFitOptions:
    """How a lattice is fitted to samples.

    smoothness: λ_S where there is one shot only, and nothing to cross-validate on; where there are more the search
    begins there. It ends at √10 times that in all five splits.

    prior_weight: what holds each node to the prior: next to a sample nothing, yet it determines nodes that no sample
    reaches. The mean hardly depends on it: 0.0027 at 1e-7, 0.0028 at 1e-3, where the largest error grows to 0.017.

    grey_weight: what each of 257 points of the grey axis counts beside a sample: where there are samples little, else
    it keeps the axis neutral. That costs nothing on samples (0: 0.0027; 0.2: 0.0028).

    outlier_scale, least_outlier: a sample whose error is this many times the median, and at least this large, counts
    half. Twelve codes are beyond any noise of a mean over a patch. Clean data lose nothing (0.0027 without, too).

    eye_share: share of the node levels of a render that stays even to the eye. Where samples are bright the first cell
    would else reach up to codes that any picture has. It costs clean data 1 % of the mean (0: 0.0027; 0.3: 0.0028).

    search_tolerance, tolerance: relative residual of fits that are searched with, and of the last one. A hundredth and
    a thousandth of them change no figure in its fourth digit.

    point_weight: what a point of the lattice with a curve counts beside a sample in the fit of its plain form. With
    0.01 the largest error is 0.044 instead of 0.039; 1 has the same figures.

    bound_cost: nodes of the plain form are colours, in [0, 1], where that costs no more of the mean error: a quarter of
    a code, which no eye sees. If they always are, the mean is 0.0056 and the largest error 0.051.

    follow_power: errors of the plain form count with this power of themselves, an Lp norm of p = 2 + power between the
    mean error and the largest. With 0 the figures are 0.0042 and 0.044, with 2 0.0041 and 0.052.
    """

    smoothness: float = 3e-3
    prior_weight: float = 1e-5
    grey_weight: float = 0.02
    outlier_scale: float = 10.0
    least_outlier: float = 12.0 / 255.0
    eye_share: float = 0.1
    search_tolerance: float = 1e-2
    tolerance: float = 1e-5
    point_weight: float = 0.2
    bound_cost: float = 0.25 / 255.0
    follow_power: float = 1.25
