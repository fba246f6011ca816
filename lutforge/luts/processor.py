"""LUTs and LUT files as OpenColorIO evaluates them."""

from codecs import BOM_UTF8
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike

from lutforge.arrays import Single
from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading, require_file
from lutforge.errors import LutError, one_line
from lutforge.interpolation import Interpolation
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range

OCIO_ERRORS = (OCIO.Exception, OCIO.ExceptionMissingFile, UnicodeDecodeError)
"""What OpenColorIO raises; in Python the second is not a kind of the first. The third it raises where its message, or a
name in a file, is no text."""


def group_of(ops: Sequence[Op]) -> OCIO.GroupTransform:
    """The operations as OpenColorIO's transforms. Raises LutError on a curve at free knots, which it has none of."""
    group = OCIO.GroupTransform()
    for op in ops:
        match op:
            case Matrix():
                four = np.eye(4)
                four[:3, :3] = op.matrix
                group.appendTransform(OCIO.MatrixTransform(four.ravel().tolist(), [*op.offset.tolist(), 0.0]))
            case Range():
                ends = {f"{end}{side}Value": value for end, value in (("min", op.low), ("max", op.high))
                        for side in ("In", "Out") if value is not None}  # fmt: skip
                group.appendTransform(OCIO.RangeTransform(**ends))
            case Curve():
                if op.inputs is not None:
                    raise LutError("LUT: OpenColorIO has no curves at free knots; read the file with it instead")
                if (op.low, op.high) != (0.0, 1.0):
                    span = op.high - op.low
                    scale = np.diag([1 / span] * 3 + [1.0]).ravel().tolist()
                    group.appendTransform(OCIO.MatrixTransform(scale, [-op.low / span] * 3 + [0.0]))
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


def processor_of(ops: Sequence[Op], codes: bool = False) -> OCIO.CPUProcessor:
    """The operations as OpenColorIO evaluates them, float32 in and out. Raises LutError where it has none such.

    codes: 8-bit codes in and out instead.
    """
    try:
        processor = OCIO.Config.CreateRaw().getProcessor(group_of(ops))
        return of_codes(processor) if codes else processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
    except OCIO_ERRORS as error:
        raise LutError(f"LUT: OpenColorIO cannot evaluate it: {error}") from error


def ops_of(group: OCIO.GroupTransform) -> tuple[Op, ...]:
    """OpenColorIO's transforms as operations: those that work channel by channel become curves.

    Raises LutError on one that mixes channels in another way than a matrix or a cube does.
    """
    ops: list[Op] = []
    for part in group:
        match part:
            case OCIO.MatrixTransform():
                four = np.array(part.getMatrix()).reshape(4, 4)
                ops.append(Matrix(four[:3, :3], np.array(part.getOffset()[:3])))
            case OCIO.RangeTransform():
                ops += _range(part)
            case OCIO.Lut1DTransform() if not part.getInputHalfDomain():
                ops.append(Curve(part.getData().reshape(-1, 3).astype(np.float64)))
            case OCIO.Lut3DTransform():
                size = part.getGridSize()
                linear = part.getInterpolation() == OCIO.INTERP_LINEAR
                values = part.getData().reshape(size, size, size, 3).astype(np.float64)
                ops.append(Cube(values, "trilinear" if linear else "tetrahedral"))
            case _:
                ops.append(_tabulated(part))
    return tuple(ops)


def _range(part: OCIO.RangeTransform) -> list[Op]:
    low = part.getMinInValue() if part.hasMinInValue() else None
    high = part.getMaxInValue() if part.hasMaxInValue() else None
    found: list[Op] = [Range(low, high)]
    if low is not None and high is not None:
        scale = (part.getMaxOutValue() - part.getMinOutValue()) / (high - low)
        offset = part.getMinOutValue() - scale * low
        if (scale, offset) != (1.0, 0.0):
            found.append(Matrix(scale * np.eye(3), np.full(3, offset)))
    return found


def _tabulated(part: OCIO.Transform) -> Curve:
    """A transform of single channels at every finite half float, as CLF's half-domain tables have it."""
    halves = np.unique(np.arange(1 << 16, dtype=np.uint16).view(np.float16))
    at = np.repeat(halves[np.isfinite(halves)].astype(np.float64)[:, None], 3, axis=1)
    processor = OCIO.Config.CreateRaw().getProcessor(part).getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
    outputs = evaluate(processor, at).astype(np.float64)
    # Where one channel changes, the others may not.
    probes = np.array([[0.1, 0.5, 0.9], [0.1, 0.2, 0.9], [0.1, 0.5, 0.3], [0.7, 0.5, 0.9]])
    alone = np.stack([np.interp(probes[:, c], at[:, c], outputs[:, c]) for c in range(3)], axis=1)
    if not np.allclose(evaluate(processor, probes), alone, rtol=1e-3, atol=1e-3):
        raise LutError(f"{type(part).__name__} mixes channels, which only a matrix or cube may; OpenColorIO applies it")
    finite = np.all(np.isfinite(outputs), axis=1)
    return Curve(outputs[finite], inputs=at[finite])


def file_group(
    path: str | Path, interpolation: Interpolation = "tetrahedral"
) -> tuple[OCIO.GroupTransform, OCIO.Processor]:
    """What OpenColorIO reads in a LUT file: its transforms, with their metadata, and their processor.

    Raises LutError, in one line, also where a table holds what is not a finite number.
    """
    path = Path(path)
    require_file(path, "a LUT", LutError, 512 << 20)  # a 129³ cube as text takes about 70 MB
    OCIO.ClearAllCaches()  # else a file that was written again is read from memory
    # "Best" is tetrahedral for cubes, and unlike that name it is quiet about files of 1D tables.
    method = OCIO.INTERP_BEST if interpolation == "tetrahedral" else OCIO.INTERP_LINEAR
    with scratch_folder() as folder, reading(path, "a LUT", LutError):
        link = path.absolute()
        if {"$", "%"} & set(str(path)):  # OpenColorIO replaces variables in a path: give it one that has none
            link = folder / f"lut{path.suffix}"
            link.symlink_to(path.resolve())
        try:
            processor = OCIO.Config.CreateRaw().getProcessor(OCIO.FileTransform(str(link), interpolation=method))
            group = processor.createGroupTransform()
            _require_finite(group, path)
            if path.suffix.lower() in (".cube", ".spi1d"):
                _require_ranges(path)
            return group, processor
        except OCIO_ERRORS as error:
            raise LutError(f"{path}: {_reason(str(error), str(link), path)}") from error


def file_processor(path: str | Path, interpolation: Interpolation = "tetrahedral") -> OCIO.CPUProcessor:
    """An OpenColorIO processor, float32 in and out, of any LUT file that it reads.

    interpolation: for cubes of files that name none themselves (CLF and CTF do). Raises LutError as
    `file_group` does.
    """
    _, processor = file_group(path, interpolation)
    with reading(path, "a LUT", LutError):
        return processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def evaluate(processor: OCIO.CPUProcessor, x: ArrayLike) -> Single:
    """Apply a processor to colours (…, 3); float32."""
    y = np.array(x, dtype=np.float32, order="C", ndmin=2)
    processor.applyRGB(y)
    return y.reshape(np.shape(x))


def _require_finite(parts: OCIO.GroupTransform, path: Path) -> None:
    """Raise LutError where a table holds NaN or infinity. Those of half-float inputs may: for such inputs."""
    for part in parts:
        cube = isinstance(part, OCIO.Lut3DTransform)
        curve = isinstance(part, OCIO.Lut1DTransform) and not part.getInputHalfDomain()
        if (cube or curve) and not np.all(np.isfinite(part.getData())):
            raise LutError(f"{path}: a number in its {'cube' if cube else 'curve'} is not finite; make the file anew")


def _require_ranges(path: Path) -> None:
    """Raise LutError where a .cube's or .spi1d's range is empty or runs backwards, which OpenColorIO applies as it is.

    Adobe's Cube LUT Specification 1.0 has the lower bound below the upper one.
    """
    with path.open("rb") as file:
        head, _, _ = file.read(1 << 16).decode("utf-8", "replace").rpartition("\n")
    lines = [line.split() for line in head.splitlines()]
    numbers: dict[str, list[float]] = {"DOMAIN_MIN": [0.0] * 3, "DOMAIN_MAX": [1.0] * 3}
    for word, *rest in filter(None, lines):
        if word in (*numbers, "LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE", "From"):
            numbers[word] = [float(text) for text in rest]
    bounds = {"DOMAIN": zip(numbers.pop("DOMAIN_MIN"), numbers.pop("DOMAIN_MAX"), strict=False)}
    for name, pairs in (*bounds.items(), *((word, [tuple(pair)]) for word, pair in numbers.items())):
        for low, high in pairs:
            if not low < high:
                raise LutError(f"{path}: {name}: the range {low:g} to {high:g} is empty; write it from low to high")


def _reason(message: str, link: str, path: Path) -> str:
    """OpenColorIO's message about a file as part of one line, with what to do where the cause is known."""
    with path.open("rb") as file:
        head = file.read(4096)
    if head.startswith(BOM_UTF8):
        return "begins with a byte order mark, which OpenColorIO does not read; save it as UTF-8 without one"
    if path.suffix.lower() == ".cube":
        words = {line.split()[0] for line in head.decode("utf-8", "replace").splitlines() if line.strip()}
        if words >= {"LUT_1D_SIZE", "LUT_3D_SIZE"} and words & {"TITLE", "DOMAIN_MIN", "DOMAIN_MAX"}:
            return (
                "a .cube with a shaper (LUT_1D_SIZE and LUT_3D_SIZE) must hold neither TITLE nor DOMAIN "
                "lines for OpenColorIO; delete those lines"
            )
    if "could not be loaded" in message and "failed with: " not in message:
        return "OpenColorIO cannot read it; `lutforge check` shows which programs do"
    if b"\r" in head and b"\n" not in head:
        return "its lines end in carriage returns alone, which OpenColorIO does not read; save it with line feeds"
    said = message.replace(link, path.name).split("failed with: ")[-1]
    return f"OpenColorIO cannot read it: {one_line(said.split('All formats')[0], 200)}"
