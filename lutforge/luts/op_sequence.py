"""A sequence of operations with a title and comments: the contents of a LUT file, evaluated and printed."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass, field

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.srgb import checked_colours
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.forms import Form
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.ocio_transforms import OCIO_ERRORS, group_of, of_codes
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.model.lattice import grid, uniform_levels


@dataclass(frozen=True, eq=False)
class OpSequence:
    """Operations in the order in which they are applied, with a title and comments; a `Lut` can also be written.

    title, comments: for people; formats keep what they can of them. metadata: what is known of the file that it was
    read from, and what a writer is to state. Raises LutError where there is no operation.
    """

    ops: tuple[Op, ...]
    title: str = ""
    comments: tuple[str, ...] = ()
    metadata: LutMetadata = field(default_factory=LutMetadata)

    def __post_init__(self) -> None:
        if not self.ops:
            raise LutError("LUT: it has no operation")

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate as a reader of the file does, in float64: (…, 3) → (…, 3).

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
        """The curve right before the first cube, or the only curve; or none."""
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
        """The interpolation of the first cube; tetrahedral where there is none."""
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

        Operations that change nothing are left out: identity matrices, and a clamp to the domain of the curve or cube
        after it. A curve alone comes with an identity cube of two nodes per axis.
        """
        ops = [op for op in self.ops if not (isinstance(op, Matrix) and op.is_identity)]
        if len(ops) > 1 and isinstance(ops[0], Range) and (ops[0].low, ops[0].high) == (0.0, 1.0):
            after = ops[1]
            if isinstance(after, Cube) or (isinstance(after, Curve) and (after.low, after.high) == (0.0, 1.0)):
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
