"""Operations converted to OpenColorIO's transforms, and colours evaluated by its processors."""

from collections.abc import Sequence

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Single
from lutforge.errors import LutError
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range

OCIO_ERRORS = (OCIO.Exception, OCIO.ExceptionMissingFile, UnicodeDecodeError)
"""The exceptions that OpenColorIO raises. In Python the second is no subclass of the first; the third is raised where
its message, or a name in a file, is not text."""


def matrix_transform(matrix: Array, offset: Array | None = None) -> OCIO.MatrixTransform:
    """A 3 × 3 matrix and an offset (3,), or none, as a transform."""
    four = np.eye(4)
    four[:3, :3] = matrix
    return OCIO.MatrixTransform(four.ravel().tolist(), [*(np.zeros(3) if offset is None else offset).tolist(), 0.0])


def group_of(ops: Sequence[Op]) -> OCIO.GroupTransform:
    """The operations as OpenColorIO's transforms. Raises LutError on a curve at free knots, which OpenColorIO lacks."""
    group = OCIO.GroupTransform()
    for op in ops:
        match op:
            case Matrix():
                group.appendTransform(matrix_transform(op.matrix, op.offset))
            case Range():
                limits = {f"{end}{side}Value": value for end, value in (("min", op.low), ("max", op.high))
                        for side in ("In", "Out") if value is not None}  # fmt: skip
                group.appendTransform(OCIO.RangeTransform(**limits))
            case Curve():
                if op.inputs is not None:
                    raise LutError("LUT: OpenColorIO has no curves at free knots; read the file with it instead")
                if (op.low, op.high) != (0.0, 1.0):
                    span = op.high - op.low
                    group.appendTransform(matrix_transform(np.diag([1 / span] * 3), np.full(3, -op.low / span)))
                curve = OCIO.Lut1DTransform(len(op.outputs), False)
                curve.setFileOutputBitDepth(OCIO.BIT_DEPTH_F32)
                curve.setInterpolation(OCIO.INTERP_LINEAR)
                curve.setData(np.ascontiguousarray(op.outputs, dtype=np.float32).ravel())
                group.appendTransform(curve)
            case Cube():
                cube = OCIO.Lut3DTransform(op.size)
                cube.setFileOutputBitDepth(OCIO.BIT_DEPTH_F32)
                tetrahedral = op.interpolation == "tetrahedral"
                cube.setInterpolation(OCIO.INTERP_TETRAHEDRAL if tetrahedral else OCIO.INTERP_LINEAR)
                cube.setData(np.ascontiguousarray(op.values, dtype=np.float32).ravel())  # blue fastest
                group.appendTransform(cube)
    return group


def of_codes(
    processor: OCIO.Processor, optimization: OCIO.OptimizationFlags = OCIO.OPTIMIZATION_LOSSLESS
) -> OCIO.CPUProcessor:
    """The processor with 8-bit codes as input and output: the results of the float one, rounded."""
    return processor.getOptimizedCPUProcessor(OCIO.BIT_DEPTH_UINT8, OCIO.BIT_DEPTH_UINT8, optimization)


def evaluate(processor: OCIO.CPUProcessor, x: ArrayLike) -> Single:
    """Apply a processor to colours (…, 3); float32."""
    y = np.array(x, dtype=np.float32, order="C", ndmin=2)
    processor.applyRGB(y)
    return y.reshape(np.shape(x))
