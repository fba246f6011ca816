"""An approximate rendering of a camera from one exposure of a chart: a usual curve, a white balance, a matrix.

One exposure shows no response, since each patch has one brightness. The chart's greys decide, whose reflectances are
known: on sRGB's curve, or on EMoR's mean of 201 cameras' curves, bent so that the greys keep their ratios.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import srgb_response
from lutforge.errors import CalibrationError
from lutforge.model.emor import log_inverse_emor
from lutforge.model.response import Response

LEAST_CHART_GREYS = 3
"""Unclipped greys that are needed: two always lie on some curve. Each further one bends the curve once."""

MOST_CURVES, STIFFNESS = 3, 0.05
"""Curves of EMoR that bend the mean, with six greys, and how the n-th is held at 0: by STIFFNESS n²."""

FLOOR = 0.02
"""Linear value below which an error of the matrix no longer counts by its ratio: noise and flare are of this size."""

NOMINAL_WEIGHT = 0.05
"""Weight of the nominal matrix, as a share of the summed weight of the patches: colours that no patch shows keep it."""


@dataclass(frozen=True, eq=False)
class OneExposure:
    """A rendering I = f(Ts Tw E) of colours E in a linear space.

    curve: the name of f; response: f; matrix: Ts (3, 3), with rows that sum to 1; multipliers: Tw (3,), green = 1;
    scale: the linear value of E = 1; spread: by how much the greys' ratios are off under f, as a share.
    """

    curve: str
    response: Response
    matrix: Array
    multipliers: Array
    scale: float
    spread: float


def _bent_to(encoded: Array, colours: Array) -> Response:
    """EMoR's mean curve, bent by its first curves so that greys (n, 3) of known linear values keep their ratios.

    log f⁻¹ = mean + ξ · curves: a ridge regression of log colours, whose level is free in each channel.
    """
    count = min(MOST_CURVES, len(encoded) - LEAST_CHART_GREYS)
    basis = log_inverse_emor(MOST_CURVES)
    places = np.linspace(0.0, 1.0, len(basis.mean))
    design, target = [], []
    for channel in range(3):
        codes = encoded[:, channel]
        curves = np.array([np.interp(codes, places, curve) for curve in basis.curves[:count]])
        curves = curves.reshape(count, len(codes)).T
        missing = np.log(colours[:, channel]) - np.interp(codes, places, basis.mean)
        design.append(curves - curves.mean(axis=0))
        target.append(missing - missing.mean())
    stacked, targets = np.vstack(design), np.concatenate(target)
    stiffness = np.diag((STIFFNESS * np.arange(1, count + 1) ** 2) ** 2)
    bend = np.linalg.solve(stacked.T @ stacked + stiffness, stacked.T @ targets)

    inverse = np.exp(basis.mean + bend @ basis.curves[:count])
    inverse[0] = 0.0
    rising = np.maximum.accumulate(inverse / inverse[-1])
    return Response(np.repeat(rising[:, None], 3, axis=1))


def _spread(response: Response, encoded: Array, colours: Array) -> float:
    """The mean over the channels of how much the ratios of greys' light to their linear values differ, as a share."""
    ratio = response.linearize(encoded) / colours
    return float(np.mean(np.std(np.log(np.maximum(ratio, 1e-6)), axis=0)))


def fit_one_exposure(encoded: Array, colours: Array, grey: Mask, nominal: Array) -> OneExposure:
    """Fit a rendering to patches: JPEG values (n, 3) and linear colours (n, 3), of which some are grey (n,).

    nominal: (3, 3), from the space of the colours to the JPEG's primaries. Raises CalibrationError where fewer than
    three greys are unclipped.
    """
    if np.count_nonzero(grey) < LEAST_CHART_GREYS:
        raise CalibrationError(
            f"{np.count_nonzero(grey)} unclipped grey patches, and {LEAST_CHART_GREYS} are needed: expose the chart so "
            "that its greys are neither black nor burnt out"
        )

    # A curve that is bent to the greys always comes nearer to them: it is taken where it halves the residual.
    srgb, bent = srgb_response(), _bent_to(encoded[grey], colours[grey] @ nominal.T)
    spreads = {curve: _spread(curve, encoded[grey], colours[grey] @ nominal.T) for curve in (srgb, bent)}
    response = bent if spreads[bent] < 0.5 * spreads[srgb] else srgb
    name = "EMoR's mean curve, bent to the chart's greys" if response is bent else "sRGB's curve"

    ratio = np.median(response.linearize(encoded[grey]) @ np.linalg.inv(nominal).T / colours[grey], axis=0)
    multipliers, scale = ratio / ratio[1], float(ratio[1])

    # Each row of the matrix sums to 1, so that neutral stays neutral: two numbers a row are left to fit.
    balanced = scale * colours * multipliers
    linear = response.linearize(encoded)
    differences = np.stack([balanced[:, 0] - balanced[:, 1], balanced[:, 2] - balanced[:, 1]], axis=1)
    weight = 1.0 / (np.abs(linear) + FLOOR)
    matrix = np.empty((3, 3))
    for row in range(3):
        target = linear[:, row] - balanced[:, 1]
        start = nominal[row, [0, 2]]
        weighted = differences * weight[:, row, None]
        hold = np.sqrt(NOMINAL_WEIGHT * np.sum(weighted**2, axis=0))
        rows = np.vstack([weighted, np.diag(hold)])
        red, blue = np.linalg.lstsq(rows, np.concatenate([target * weight[:, row], hold * start]))[0]
        matrix[row] = red, 1.0 - red - blue, blue
    return OneExposure(name, response, matrix, multipliers, scale, spreads[response])
