"""Plain models of the response f, to stand beside EMoR: sRGB's curve, a gamma, a monotone spline."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.solvers.inequality_least_squares import solve_lsi

Array = NDArray[np.float64]

ENTRIES = 1024
KNOTS = 24
SPLINE_SMOOTHNESS = 0.1
"""Weight of the squared second differences of the spline's log f⁻¹ less sRGB's, relative to the number of pairs."""
LEAST_RISE = 0.2
"""The spline's log f⁻¹ rises at least this fraction as fast as sRGB's."""


def srgb_response(entries: int = 1024) -> Response:
    """The sRGB curve (IEC 61966-2-1) in all channels."""
    v = np.linspace(0.0, 1.0, entries)
    linear = srgb_decode(v)
    return Response(np.stack([linear] * 3, axis=1))


def gamma_response(gamma: float = 2.2, entries: int = 1024) -> Response:
    """f⁻¹(I) = I^gamma in all channels. Raises CalibrationError unless 0.2 ≤ gamma ≤ 5."""
    if not 0.2 <= gamma <= 5.0:
        raise CalibrationError(f"gamma {gamma:g} is not within 0.2 … 5")
    return Response(np.stack([np.linspace(0.0, 1.0, entries) ** gamma] * 3, axis=1))


def spline_response(linear: Array, encoded: Array, knots: int = 12, entries: int = 1024) -> Response:
    """A monotone cubic spline (Fritsch & Carlson 1980) per channel through the medians of `knots` groups of like count.

    linear: Ts Tw E (n, 3); encoded: I (n, 3) of the same colours. Raises CalibrationError below 2 samples a knot.
    """
    if len(linear) < 2 * knots:
        raise CalibrationError(f"{len(linear)} samples are too few for a spline of {knots} knots")
    codes = np.linspace(0.0, 1.0, entries)
    columns = []
    for channel in range(3):
        order = np.argsort(encoded[:, channel], kind="stable")
        groups = np.array_split(order, knots)
        x = np.array([np.median(encoded[group, channel]) for group in groups])
        y = np.maximum.accumulate([np.median(linear[group, channel]) for group in groups])
        keep = np.concatenate([[True], np.diff(x) > 1e-6]) & (x > 1e-6)
        x, y = np.concatenate([[0.0], x[keep]]), np.concatenate([[0.0], np.maximum(y[keep], 0.0)])
        curve = PchipInterpolator(x, y, extrapolate=False)(np.minimum(codes, x[-1]))
        end = (y[-1] - y[-2]) / (x[-1] - x[-2])
        columns.append(np.maximum.accumulate(curve + np.maximum(codes - x[-1], 0.0) * end))
    return Response(np.stack(columns, axis=1))


def spline_of_pairs(pairs: ExposurePairs, weight: NDArray[np.float64]) -> Response:
    """A monotone linear spline for log f⁻¹ in each channel, after Debevec & Malik (SIGGRAPH 1997), f(1) = 1.

    minimise Σ w (g(I') − g(I) − log k')² and the squared second differences of g less sRGB's, under rising g.
    """
    knots = np.linspace(0.0, 1.0, KNOTS + 1)[1:]  # log f⁻¹ has no value at 0
    shape = np.log(srgb_response().linearize(np.stack([knots] * 3, axis=1))[:, 0])
    rising = np.zeros((KNOTS - 1, KNOTS))
    step = np.arange(KNOTS - 1)
    rising[step, step], rising[step, step + 1] = -1.0, 1.0
    bend = np.diff(rising, axis=0) * np.sqrt(SPLINE_SMOOTHNESS * weight.sum())
    top = np.zeros((1, KNOTS))
    top[0, -1] = 1e3 * np.sqrt(weight.sum())
    root = np.sqrt(weight)
    codes = np.linspace(0.0, 1.0, ENTRIES)
    table = np.zeros((ENTRIES, 3))
    for channel in range(3):
        design = (_hats(pairs.second[:, channel], knots) - _hats(pairs.first[:, channel], knots)) * root[:, None]
        logs = solve_lsi(
            np.vstack([design, bend, top]),
            np.concatenate([pairs.log_ratio * root, bend @ shape, [0.0]]),
            rising,
            LEAST_RISE * np.diff(shape),
        )
        below = np.exp(logs[0]) * codes / knots[0]
        table[:, channel] = np.where(codes < knots[0], below, np.exp(np.interp(codes, knots, logs)))
    return Response(np.maximum.accumulate(table, axis=0))


def _hats(values: Array, knots: Array) -> Array:
    """(n, knots) weights of linear interpolation; the first piece holds on below it."""
    position = np.clip((values - knots[0]) / (knots[1] - knots[0]), 0.0, len(knots) - 1.0)
    weights: Array = np.maximum(1.0 - np.abs(position[:, None] - np.arange(len(knots))), 0.0)
    return weights
