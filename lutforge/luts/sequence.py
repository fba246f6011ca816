"""A LUT: a sequence of operations, which is read, written, applied and printed as such."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Single
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.colour.srgb import checked_colours
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.model.lattice import grid, uniform_levels

Form = Literal["full", "shaper", "plain"]
"""What sequences a format holds: any; a curve per channel and a cube; a cube."""
FORMS: tuple[Form, ...] = get_args(Form)

HELD = {
    "full": "any sequence of operations",
    "shaper": "one curve per channel and one cube behind it",
    "plain": "one cube",
}
"""The forms in words, for messages."""

MAX_SIZE = 129
"""Most nodes per axis that OpenColorIO reads."""


@dataclass(frozen=True, eq=False)
class Lut:
    """Operations in the order in which they are applied, and what the file says beside them.

    title, comments: for people; formats keep what they can of them. metadata: of a file that was read: the name of its
    "format", and what its reader adds, such as the "bits" of its integers. Raises LutError where there is no operation.
    """

    ops: tuple[Op, ...]
    title: str = ""
    comments: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.ops:
            raise LutError("LUT: it has no operation")

    def __call__(self, x: ArrayLike) -> Array:
        """What a reader of the file computes, in float64: (…, 3) → (…, 3).

        Raises ImageError on another shape, and on integers.
        """
        y = checked_colours(x)
        for op in self.ops:
            y = op(y)
        return y

    def __str__(self) -> str:
        title = f'LUT "{self.title}"' if self.title else "LUT"
        return "\n  ".join([title, *(f"{number}. {op}" for number, op in enumerate(self.ops, 1))])

    def __repr__(self) -> str:
        return f"<Lut {self.summary}{f' {self.title!r}' if self.title else ''}>"

    @property
    def summary(self) -> str:
        """The operations in one line, such as "Matrix → Range → Curve 65536 → Cube 33³"."""
        sizes = [
            f" {op.size}³" if isinstance(op, Cube) else f" {len(op.outputs)}" if isinstance(op, Curve) else ""
            for op in self.ops
        ]
        return " → ".join(f"{type(op).__name__}{size}" for op, size in zip(self.ops, sizes, strict=True))

    @property
    def cube(self) -> Cube | None:
        """The first cube, or none."""
        return next((op for op in self.ops if isinstance(op, Cube)), None)

    @property
    def shaper(self) -> Curve | None:
        """The curve right in front of the first cube, or the only curve; or none."""
        curve = None
        for op in self.ops:
            if isinstance(op, Cube):
                return curve
            curve = op if isinstance(op, Curve) else None if isinstance(op, Matrix) else curve
        return curve

    @property
    def size(self) -> int:
        """Nodes per axis of the first cube; 0 where there is none."""
        return 0 if self.cube is None else self.cube.size

    @property
    def interpolation(self) -> Interpolation:
        """How the first cube is interpolated."""
        return "tetrahedral" if self.cube is None else self.cube.interpolation

    def processor(self, codes: bool = False) -> OCIO.CPUProcessor:
        """OpenColorIO's processor of the LUT, for float32 pixels or, with `codes`, for 8-bit ones.

        Raises LutError where OpenColorIO cannot evaluate the LUT, as with curves whose knots are not even.
        """
        try:
            processor = OCIO.Config.CreateRaw().getProcessor(group_of(self.ops))
            return of_codes(processor) if codes else processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
        except OCIO_ERRORS as error:
            raise LutError(f"LUT: OpenColorIO cannot evaluate it: {error}") from error

    def shaper_and_cube(self) -> tuple[Curve | None, Cube]:
        """The whole sequence as a shaper, or none, and a cube. Raises LutError where it is more than that.

        What changes nothing is left out: identity matrices, and a clamp to the domain of the curve or cube behind it.
        A curve alone has a straight cube of two nodes behind it.
        """
        ops = [op for op in self.ops if not (isinstance(op, Matrix) and op.is_identity)]
        if len(ops) > 1 and isinstance(ops[0], Range) and (ops[0].low, ops[0].high) == (0.0, 1.0):
            behind = ops[1]
            if isinstance(behind, Cube) or (isinstance(behind, Curve) and (behind.low, behind.high) == (0.0, 1.0)):
                ops = ops[1:]
        match ops:
            case [Cube() as cube]:
                return None, cube
            case [Curve() as curve, Cube() as cube]:
                return curve, cube
            case [Curve() as curve]:
                return curve, Cube(grid(uniform_levels(2)))
        raise LutError(f"LUT: {self.summary} is more than a shaper and a cube")

    def has_form(self, form: Form) -> bool:
        """True where a format of this form can hold the sequence."""
        if form == "full":
            return True
        try:
            curve, cube = self.shaper_and_cube()
        except LutError:
            return False
        return cube.has_equal_axes and (curve is None or form == "shaper")

    def write(self, path: str | Path) -> Path:
        """Write the sequence to a file, atomically and exactly, in the format that the suffix names; return the path.

        Nothing is fitted or sampled here. Raises LutError, with the form that the file needs, where its format cannot
        hold the sequence; `lutforge.bake(transform, path)` bakes to the form of a file.
        """
        path = Path(path)
        file_format = format_of(path)
        name, form, sizes = file_format.name, file_format.forms[0], file_format.sizes
        if not any(self.has_form(held) for held in file_format.forms):
            raise LutError(
                f"{path}: {name} holds {HELD[form]}, this LUT is {self.summary}: bake it for this file, "
                f'bake(transform, "{path.name}") or bake(transform, form="{form}")'
            )
        if self.size > MAX_SIZE:
            raise LutError(f"{path}: {self.size} nodes per axis; OpenColorIO reads 2 to {MAX_SIZE}")
        if sizes and self.size not in sizes:
            listed = ", ".join(map(str, sizes))
            raise LutError(f"{path}: {self.size} nodes per axis; {name} has {listed}: choose a size among them")
        if self.shaper is not None and self.shaper.inputs is not None and not file_format.knots:
            raise LutError(f"{path}: {name} holds no curve at free knots; write a .csp")
        file_format.write(self, path)
        return path


@dataclass(frozen=True)
class FileFormat:
    """A kind of LUT file: what it holds, its writer, and its reader where OpenColorIO reads no such files.

    forms: the sequences that it holds, first the one that is baked for it; sizes: nodes per axis that it can have,
    where not all; size: of a cube that is baked for it where none is asked for; bits: of integer formats, which round,
    and clamp to [0, 1]; knots: its shaper may have its entries at free knots, and not only at even steps of a range.
    """

    name: str
    suffixes: tuple[str, ...]
    forms: tuple[Form, ...]
    write: Callable[[Lut, Path], None]
    sizes: tuple[int, ...] = ()
    size: int = 65
    bits: int | None = None
    knots: bool = False
    read: Callable[[Path], Lut] | None = None


FORMATS: dict[str, FileFormat] = {}
"""The formats that are written, by suffix; `luts/formats.py` fills it."""


def format_of(path: Path) -> FileFormat:
    """The format that the suffix of a path names. Raises LutError on an unknown one."""
    known = FORMATS.get(path.suffix.lower())
    if known is None:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {", ".join(FORMATS)}')
    return known


def own_reader(path: Path) -> Callable[[Path], Lut] | None:
    """The reader of a format that OpenColorIO does not know, by the suffix of a path; else None."""
    known = FORMATS.get(path.suffix.lower())
    return None if known is None else known.read


# --- LUTs as OpenColorIO evaluates them -----------------------------------------------------------------------------


OCIO_ERRORS = (OCIO.Exception, OCIO.ExceptionMissingFile, UnicodeDecodeError)
"""What OpenColorIO raises; in Python the second is not a kind of the first. The third it raises where its message, or a
name in a file, is no text."""


def matrix_transform(matrix: Array, offset: Array | None = None) -> OCIO.MatrixTransform:
    """A 3 × 3 matrix and an offset (3,), or none, as a transform."""
    four = np.eye(4)
    four[:3, :3] = matrix
    return OCIO.MatrixTransform(four.ravel().tolist(), [*(np.zeros(3) if offset is None else offset).tolist(), 0.0])


def group_of(ops: Sequence[Op]) -> OCIO.GroupTransform:
    """The operations as OpenColorIO's transforms. Raises LutError on a curve at free knots, which it has none of."""
    group = OCIO.GroupTransform()
    for op in ops:
        match op:
            case Matrix():
                group.appendTransform(matrix_transform(op.matrix, op.offset))
            case Range():
                ends = {f"{end}{side}Value": value for end, value in (("min", op.low), ("max", op.high))
                        for side in ("In", "Out") if value is not None}  # fmt: skip
                group.appendTransform(OCIO.RangeTransform(**ends))
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
    """The processor of 8-bit codes in and out: what that of floats gives, rounded."""
    return processor.getOptimizedCPUProcessor(OCIO.BIT_DEPTH_UINT8, OCIO.BIT_DEPTH_UINT8, optimization)


def evaluate(processor: OCIO.CPUProcessor, x: ArrayLike) -> Single:
    """Apply a processor to colours (…, 3); float32."""
    y = np.array(x, dtype=np.float32, order="C", ndmin=2)
    processor.applyRGB(y)
    return y.reshape(np.shape(x))


# --- What goes into a LUT and what comes out --------------------------------------------------------------------------
# A LUT on the wrong pixels is the usual mistake, and no format has a word for it. The files that LutForge writes say it
# in their comments.


ENCODED = "the camera's JPEG, encoded, 0 to 1"
ADOBE_RGB = "the camera's JPEG in Adobe RGB, encoded, 0 to 1"
RAW = "linear camera RAW, black 0, saturation 1, before white balance"


@dataclass(frozen=True)
class InputAndOutput:
    """Input and output of a LUT: ENCODED, ADOBE_RGB, RAW, or scene-linear or scene-referred and the space's name."""

    input: str
    output: str

    @property
    def takes_raw(self) -> bool:
        """True where the input is camera RAW before white balance."""
        return self.input.startswith(RAW)

    @property
    def are_linear(self) -> tuple[bool, bool]:
        """Whether input and output are linear light."""
        takes, gives = (end == RAW or end.startswith("scene-linear") for end in (self.input, self.output))
        return takes, gives

    @property
    def comments(self) -> tuple[str, ...]:
        """The comment lines of a file: one record a line for `read_input_and_output`, and advice for people."""
        takes_linear, gives_linear = self.are_linear
        advice = ["not for JPEGs"] if takes_linear else []
        if gives_linear:
            advice.append("keep its output in half or float files, 8 bits would show bands")
        return f"input: {self.input}", f"output: {self.output}", *([f"use: {'; '.join(advice)}"] if advice else [])


def input_and_output_of(kind: str, space: str, encoded: str = ENCODED) -> InputAndOutput:
    """The input and the output of a transform. kind: "render", "linearize", or any from JPEG to JPEG.

    space: of the scene's side, "raw" or a name; encoded: what the JPEG that goes in is, ENCODED or ADOBE_RGB.
    """
    linear = space == "raw" or rgb_space(space).is_linear
    scene = RAW if space == "raw" else f"scene-{'linear' if linear else 'referred'} {space}"
    return InputAndOutput(scene if kind == "render" else encoded, scene if kind == "linearize" else ENCODED)


def read_input_and_output(comments: Iterable[str]) -> InputAndOutput | None:
    """What the comments of a LUT file say; None where they do not."""
    stated = dict(comment.split(": ", 1) for comment in comments if ": " in comment)
    return InputAndOutput(stated["input"], stated["output"]) if {"input", "output"} <= stated.keys() else None
