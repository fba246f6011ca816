"""OpenColorIO's transforms converted to operations, so that a file's content can be shown, checked and evaluated.

Matrices, ranges, curves and cubes are converted as they are. Any other transform that works channel by channel, such as
an exponent or a logarithm, is tabulated to a curve.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import LutError
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range


class OpWithoutParametersError(LutError):
    """A file that OpenColorIO renders, with an operation that is neither matrix, range, curve nor cube."""


def ops_of(group: OCIO.GroupTransform) -> tuple[Op, ...]:
    """OpenColorIO's transforms as operations: those that work channel by channel become curves.

    Raises OpWithoutParametersError where a transform has no such operation.
    """
    ops: list[Op] = []
    to_tabulate: list[OCIO.Transform] = []  # neighbours, which become one curve: the errors of several would add up
    for transform in group:
        converted = _converted(transform)
        if converted is None:
            to_tabulate.append(transform)
            continue

        ops += _tabulated(to_tabulate)
        to_tabulate = []
        domain = _domain_stated_by(ops[-1]) if ops else None
        match transform, converted:
            case OCIO.Lut1DTransform(), [Curve() as curve] if domain is not None:
                ops[-1] = Curve(curve.outputs, *domain)
            case _:
                ops += converted
    return (*ops, *_tabulated(to_tabulate))


def _converted(transform: OCIO.Transform) -> list[Op] | None:
    """The operations of a transform; None of one that is to be tabulated. Raises OpWithoutParametersError."""
    convert = _CONVERSIONS.get(type(transform))
    return None if convert is None else convert(transform)


def _is_inverse(transform: OCIO.Transform) -> bool:
    return bool(transform.getDirection() == OCIO.TRANSFORM_DIR_INVERSE)


def _matrix(transform: OCIO.MatrixTransform) -> list[Op] | None:
    """A matrix without its row and column of alpha; an inverse one is tabulated."""
    if _is_inverse(transform):
        return None
    matrix = np.array(transform.getMatrix()).reshape(4, 4)
    if np.any(matrix[:3, 3] != 0):
        raise _without_parameters("a matrix in which alpha tints colours")
    return [Matrix(matrix[:3, :3], np.array(transform.getOffset())[:3])]


def _range(transform: OCIO.RangeTransform) -> list[Op] | None:
    """A range as a clamp, where its style is to clamp, and as a scale and offset, where these change something."""
    if _is_inverse(transform):
        return None
    low = transform.getMinInValue() if transform.hasMinInValue() else None
    high = transform.getMaxInValue() if transform.hasMaxInValue() else None
    low_output = transform.getMinOutValue() if transform.hasMinOutValue() else None
    high_output = transform.getMaxOutValue() if transform.hasMaxOutValue() else None
    ops: list[Op] = [Range(low, high)] if transform.getStyle() == OCIO.RANGE_CLAMP else []

    scale, offset = 1.0, 0.0
    if low is not None and low_output is not None:
        if high is not None and high_output is not None:
            scale = (high_output - low_output) / (high - low)
        offset = low_output - scale * low
    elif high is not None and high_output is not None:
        offset = high_output - high
    if (scale, offset) != (1.0, 0.0):
        ops.append(Matrix(scale * np.eye(3), np.full(3, offset)))
    return ops


def _curve(transform: OCIO.Lut1DTransform) -> list[Op] | None:
    """A 1D table as a curve; an inverse one, and one over all half floats, is tabulated."""
    if transform.getHueAdjust() != OCIO.HUE_NONE:
        raise _without_parameters("a curve that keeps hues")
    if _is_inverse(transform) or transform.getInputHalfDomain():
        return None
    return [Curve(transform.getData().reshape(-1, 3).astype(np.float64))]


def _cube(transform: OCIO.Lut3DTransform) -> list[Op]:
    """A 3D table as a cube."""
    if _is_inverse(transform):
        raise _without_parameters("the inverse of a cube")
    size = transform.getGridSize()
    values = transform.getData().reshape(size, size, size, 3).astype(np.float64)
    tetrahedral = transform.getInterpolation() in (OCIO.INTERP_TETRAHEDRAL, OCIO.INTERP_BEST)
    return [Cube(values, "tetrahedral" if tetrahedral else "trilinear")]


def _cdl(transform: OCIO.CDLTransform) -> list[Op] | None:
    """A colour decision list: slope, offset and power channel by channel, then saturation (ASC CDL 1.2)."""
    if _is_inverse(transform):
        return None
    channels = OCIO.CDLTransform(slope=transform.getSlope(), offset=transform.getOffset(), power=transform.getPower())
    channels.setStyle(transform.getStyle())
    ops = _tabulated([channels])

    luma = np.array(transform.getSatLumaCoefs())
    saturation = transform.getSat()
    if saturation != 1.0:
        ops.append(Matrix(saturation * np.eye(3) + (1.0 - saturation) * luma[None, :]))
    return [*ops, Range()] if transform.getStyle() == OCIO.CDL_ASC else ops


_CONVERSIONS: Mapping[type[OCIO.Transform], Callable[[Any], list[Op] | None]] = {
    OCIO.MatrixTransform: _matrix,
    OCIO.RangeTransform: _range,
    OCIO.Lut1DTransform: _curve,
    OCIO.Lut3DTransform: _cube,
    OCIO.CDLTransform: _cdl,
}
"""The conversions by type; transforms of all other types are tabulated."""


def _without_parameters(operation: str) -> OpWithoutParametersError:
    """The error on an operation, which is named with its article."""
    rendered = "OpenColorIO and `lutforge apply` render it"
    return OpWithoutParametersError(f"it holds {operation}, for which no figures can be reported; {rendered}")


def _domain_stated_by(op: Op) -> tuple[float, float] | None:
    """The domain that a matrix before a curve gives it, from its lowest to its highest input.

    It is None of other operations, and of matrices that do not scale all channels alike.
    """
    if not isinstance(op, Matrix) or not op.is_diagonal:
        return None
    scale, offset = np.diag(op.matrix), op.offset
    if np.ptp(scale) > 0 or np.ptp(offset) > 0 or scale[0] <= 0:
        return None
    low, high = (float((end - offset[0]) / scale[0]) for end in (0.0, 1.0))
    return round(low, 9), round(high, 9)


def _tabulated(transforms: list[OCIO.Transform]) -> list[Op]:
    """Transforms of single channels as one curve with a knot at every finite half float; without transforms nothing.

    CLF's half-domain tables have the same knots. Raises OpWithoutParametersError where the transforms mix channels.
    """
    if not transforms:
        return []
    halves = np.unique(np.arange(1 << 16, dtype=np.uint16).view(np.float16)).astype(np.float64) + 0.0  # -0.0 becomes 0
    knots = np.repeat(halves[np.isfinite(halves)][:, None], 3, axis=1)
    processor = (
        OCIO.Config.CreateRaw()
        .getProcessor(OCIO.GroupTransform(transforms))
        .getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
    )
    outputs = evaluate(processor, knots).astype(np.float64)
    finite = np.all(np.isfinite(outputs), axis=1)
    curve = Curve(outputs[finite], inputs=knots[finite])

    # The curve is right only where the transforms do not mix channels, and are straight lines between half floats:
    # random colours test the first, greys between half floats the second.
    between = (knots[1:] + knots[:-1])[(knots[:-1, 0] > 1e-3) & (knots[1:, 0] < 1.5)] / 2
    probes = np.concatenate([np.random.default_rng(0).random((256, 3)) * 1.5 - 0.1, between])
    by_curve = curve(probes)
    if np.any(np.abs(evaluate(processor, probes) - by_curve) > 2e-3 * np.maximum(np.abs(by_curve), 1.0)):
        raise _without_parameters(f"a {type(transforms[0]).__name__}, which mixes channels or jumps")
    return [curve]
