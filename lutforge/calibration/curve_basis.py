"""Families of rising curves for a response: EMoR (thesis 4.3), its logarithm, or a spline.

A curve is a table at even encoded values, offset + design θ. Every family has a prior for θ and the inequalities under
which the curve rises, so that a fit can use any family.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError
from lutforge.model.emor import inverse_emor, log_inverse_emor
from lutforge.model.response import Response

LEAST_SLOPE = 0.02
"""A curve rises at least this fraction as fast as EMoR's mean: no f⁻¹ is flat."""

WHITE_SPREAD = 0.1
"""Standard deviation of the prior of f⁻¹(1) around 1: cameras render what saturates their sensor as white, about."""

SAMPLE = (255.0 / 0.4) ** 2
"""Precision of a JPEG value: rounding, and a little noise, have a standard deviation of 0.4 codes."""


@dataclass(frozen=True, eq=False)
class CurveBasis:
    """Curves offset (k,) + design (k, m) θ at k even encoded values 0 … 1.

    precision (m, m), shift (m,): the prior θ'·precision·θ − 2 shift·θ. rising (c, m) θ ≥ least (c,): the curve rises.
    bends (b, m): the curve's bends are bends θ, in units of their standard deviation; none where the family has no
    prior of them.
    """

    offset: Array
    design: Array
    precision: Array
    shift: Array
    rising: Array
    least: Array
    bends: Array

    def at(self, encoded: Array) -> tuple[Array, Array]:
        """The offset (…) and the design (…, m) at encoded values (…)."""
        position = np.clip(encoded, 0.0, 1.0) * (len(self.design) - 1)
        cell = np.minimum(position.astype(np.intp), len(self.design) - 2)
        fraction = position - cell
        part = fraction[..., None]
        offset = (1 - fraction) * self.offset[cell] + fraction * self.offset[cell + 1]
        return offset, (1 - part) * self.design[cell] + part * self.design[cell + 1]

    def with_white_at_one(self) -> "CurveBasis":
        """The family less its first curve, which is scaled by 1 and is alone not 0 at white: f⁻¹(1) = 1."""
        offset, rising = self.offset + self.design[:, 0], self.rising[:-1]
        return CurveBasis(
            offset, self.design[:, 1:], self.precision[1:, 1:], self.shift[1:] - self.precision[1:, 0], rising[:, 1:],
            self.least[:-1] - rising[:, 0], self.bends[:, 1:],
        )  # fmt: skip

    def with_white_by_one(self) -> "CurveBasis":
        """The family less the curves that reach white beyond 1: f⁻¹(1) ≤ 1, and without samples near white about 1."""
        white = self.design[-1]
        lacking = 1.0 - self.offset[-1]
        return replace(
            self,
            precision=self.precision + np.outer(white, white) / WHITE_SPREAD**2,
            shift=self.shift + lacking * white / WHITE_SPREAD**2,
            rising=np.vstack([self.rising, -white]),
            least=np.append(self.least, -lacking),
        )


OF_VALUES, OF_BENDS = 0.01, 0.003
"""Weights of the prior of a spline, where a sample has 1: of its values, and of the relative changes of its slope."""
BEND_SPREAD = 0.03
"""Standard deviation of these changes of slope, added in quadrature to half of the prior's own change."""
LEAST_SPLINE_SLOPE = 0.05
"""Least slope of f⁻¹ that is compared with, and least share of the prior's slope that a spline has."""
BEND = 40
"""Precision of the bends of log f⁻¹ from knot to knot: those of sRGB's curve are off by 1/6."""
LEAST_RISE = 0.2
"""Share of the rise of sRGB's log curve that a fitted one has at least."""
LEAST_GAMMA, MOST_GAMMA = 0.2, 5


@cache
def emor_basis(count: int = 15) -> CurveBasis:
    """f⁻¹ = scale · g0 + ξ · h, EMoR in the linear domain; θ = (scale, ξ).

    The prior standard deviation of ξ_n is 2 / n²: principal components matter less the later they come. Of the six
    that were tried it was, on dark exposures of ten chart cameras, level with the best (5 / n³), which cost
    accuracy where all tones are sampled.
    """
    basis = inverse_emor(count)
    design = np.column_stack([basis.mean, basis.curves.T])
    order = np.arange(1, count + 1)
    steps = np.diff(design[::11], axis=0)
    steps[:, 0] *= 1 - LEAST_SLOPE
    return CurveBasis(
        offset=np.zeros(1024),
        design=design,
        precision=np.diag(np.concatenate([[0.0], order**4 / 4])),
        shift=np.zeros(count + 1),
        rising=np.vstack([steps, np.eye(1, count + 1)]),
        least=np.append(np.zeros(len(steps)), OF_VALUES),
        bends=np.zeros((0, count + 1)),
    )


def spline_basis(like: Array) -> CurveBasis:
    """Make f⁻¹ piecewise linear between even knots; θ: its value at black, then its steps.

    like: (k,) f⁻¹ at even encoded values, which the prior follows. At each knot its value is that of `like`, with the
    weight of a hundredth of a sample. The relative change of its slope is that of `like`, with a standard deviation of
    3 % and half of that change, because `like` is least certain where f⁻¹ becomes steep near white.
    """
    knots = 33
    shape = np.interp(np.linspace(0.0, 1.0, knots), np.linspace(0.0, 1.0, len(like)), like)
    rate = np.maximum(np.gradient(shape, 1.0 / (knots - 1)), LEAST_SPLINE_SLOPE)
    steps = np.diff(shape)
    change, scale = np.diff(steps) / np.maximum(steps[1:] + steps[:-1], 1e-9), (knots - 1) / rate[1:-1]
    bend, place = np.zeros((knots - 2, knots)), np.arange(knots - 2)
    bend[place, place + 1], bend[place, place + 2] = (-1.0 - change) * scale, (1.0 - change) * scale
    bend *= np.sqrt(OF_BENDS * SAMPLE) / np.hypot(1.0, 0.5 * change / BEND_SPREAD)[:, None]
    values = np.tril(np.ones((knots, knots)))
    relative = values / rate[:, None]
    precision = bend.T @ bend + OF_VALUES * SAMPLE * relative.T @ relative
    precision[0, 0] += SAMPLE / rate[0] ** 2  # black is black
    return CurveBasis(
        offset=np.zeros(knots),
        design=values,
        precision=precision,
        shift=OF_VALUES * SAMPLE * relative.T @ (shape / rate),
        rising=np.eye(knots),
        least=np.concatenate([[0.0], np.maximum(LEAST_SPLINE_SLOPE * steps, 0.0)]),
        bends=bend,
    )


@cache
def log_emor_basis(count: int = 15) -> CurveBasis:
    """log f⁻¹ = log g0 + ξ · η (4.3); θ = ξ.

    The prior standard deviation of ξ_n, 5 / n², ties f⁻¹ where no pair reaches. With the thesis preset, f⁻¹ at
    white over f⁻¹ at middle grey is 0.88 … 1.26 times what RAW pairs give, on the six chart cameras that were
    measured; with 10 / n it was 0.76 … 2.34 times.
    """
    basis = log_inverse_emor(count)
    steps = np.diff(basis.mean[1:])
    return CurveBasis(
        offset=basis.mean,
        design=np.ascontiguousarray(basis.curves.T),
        precision=np.diag(np.arange(1, count + 1) ** 4 / 25),
        shift=np.zeros(count),
        rising=np.diff(basis.curves[:, 1:], axis=1).T,
        least=(LEAST_SLOPE - 1.0) * steps,
        bends=np.zeros((0, count)),
    )


@cache
def log_spline_basis() -> CurveBasis:
    """log f⁻¹ piecewise linear between even knots, after Debevec & Malik (SIGGRAPH 1997); θ: its values there.

    f⁻¹ is straight from black to the first knot. The prior is the bend of sRGB's curve from knot to knot.
    """
    knots = 24
    codes, places = np.linspace(0.0, 1.0, 1024), np.linspace(0.0, 1.0, knots + 1)[1:]
    position = np.clip(codes * knots - 1.0, 0.0, knots - 1.0)
    design = np.maximum(1.0 - np.abs(position[:, None] - np.arange(knots)), 0.0)
    offset = np.log(np.clip(codes, codes[1], places[0]) / places[0])
    shape = np.log(srgb_response().linearize(np.stack([places] * 3, axis=1))[:, 0])
    rising = np.diff(np.eye(knots), axis=0)
    bend = np.diff(rising, axis=0)
    return CurveBasis(
        offset=offset,
        design=design,
        precision=BEND * bend.T @ bend,
        shift=BEND * bend.T @ (bend @ shape),
        rising=rising,
        least=LEAST_RISE * (rising @ shape),
        bends=np.zeros((0, knots)),
    )


def srgb_response() -> Response:
    """The sRGB curve (IEC 61966-2-1) in all channels."""
    return Response(np.stack([srgb_decode(np.linspace(0.0, 1.0, 1024))] * 3, axis=1))


def gamma_response(gamma: float = 2.2) -> Response:
    """f⁻¹(I) = I^gamma in all channels. Raises CalibrationError unless 0.2 ≤ gamma ≤ 5."""
    if not LEAST_GAMMA <= gamma <= MOST_GAMMA:
        raise CalibrationError(f"gamma {gamma:g} is not within 0.2 … 5")
    return Response(np.stack([np.linspace(0.0, 1.0, 1024) ** gamma] * 3, axis=1))
