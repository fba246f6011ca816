"""LUT files of any origin, read by OpenColorIO in a separate process.

Most programs read LUT files by OpenColorIO, so its reading of a file is taken for the file's meaning. LutForge has
readers for formats that OpenColorIO does not know: .vlt, and pictures that hold a LUT.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.atomic_write import scratch_folder
from lutforge.boundary import path_of, reading, require_file
from lutforge.child_processes import OverrunError, P, R, guarded
from lutforge.errors import LutError, one_line
from lutforge.interpolation import Interpolation
from lutforge.luts.formats import FORMATS
from lutforge.luts.ocio_transforms import OCIO_ERRORS, evaluate
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.picture import SUFFIXES, read_picture
from lutforge.luts.sequence import Lut
from lutforge.luts.text.checked_text import checked_text
from lutforge.luts.text.encoding import decoded
from lutforge.luts.vlt import read_vlt

OWN_READERS: dict[str, Callable[[Path], Lut]] = {".vlt": read_vlt, **dict.fromkeys(SUFFIXES, read_picture)}
"""The readers of formats that OpenColorIO does not know, by suffix."""

MOST_FILE_BYTES = 128 << 20
"""Bytes of a LUT file that is read: a 129³ cube as text takes about 70 MB."""


def read_lut(path: str | Path) -> Lut:
    """Read a LUT file of any format that OpenColorIO or LutForge knows.

    Args:
        path: of the file; its suffix names the format.

    Returns:
        The LUT: `print(lut)` shows its operations, `lut(pixels)` evaluates it, `lut.write(path)` writes it.

    Raises:
        LutError: in one line, where the file cannot be read, or is no sequence of matrices, ranges, curves and cubes.
    """
    path = path_of(path, "a LUT")
    require_file(path, "a LUT", LutError, MOST_FILE_BYTES)
    reader = OWN_READERS.get(path.suffix.lower())
    with reading(path, f"a {path.suffix.lower()} LUT", LutError):
        if reader is not None:
            with _file_for_reader(path) as (link, problems):
                lut = reader(link)
            metadata = {"format": path.suffix.lower(), **lut.metadata}
            return replace(lut, metadata={**metadata, **({"problems": "; ".join(problems)} if problems else {})})
        if path.suffix.lower() == ".dcp":
            raise LutError(f"{path}: a camera profile, which is no LUT; `lutforge check` shows which programs read it")
        ocio_suffixes = {f".{suffix.lower()}" for _, suffix in OCIO.FileTransform.getFormats()}
        if path.suffix.lower() not in ocio_suffixes:  # OpenColorIO refuses it only after trying all its readers
            suffixes = ", ".join(sorted(ocio_suffixes | {*FORMATS}))
            raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {suffixes}')
        return _sandboxed(_lut_of, path)


def has_own_reader(path: Path) -> bool:
    """True for a format that OpenColorIO does not know, and LutForge reads itself."""
    return path.suffix.lower() in OWN_READERS


def file_processor(path: str | Path, interpolation: Interpolation = "tetrahedral") -> OCIO.CPUProcessor:
    """The processor, float32 in and out, of a LUT file of ours. interpolation: for cubes of files that name none."""
    with reading(path, "a LUT", LutError):
        return processor_of_file(path, interpolation)[0].getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def processor_of_file(
    path: str | Path, interpolation: Interpolation = "tetrahedral"
) -> tuple[OCIO.Processor, tuple[str, ...]]:
    """OpenColorIO's processor of a LUT file that is known to be harmless, and problems that other readers have with it.

    For an untrusted file call `processor_of_untrusted`. Raises LutError.
    """
    path = Path(path)
    require_file(path, "a LUT", LutError, MOST_FILE_BYTES)
    if path.suffix.lower() == ".csp":  # OpenColorIO 2.6 never ends where the end of the metadata is missing
        text = path.read_bytes()
        if text.count(b"BEGIN METADATA") > text.count(b"END METADATA"):
            raise LutError(f"{path}: no END METADATA after BEGIN METADATA; the file is damaged")

    OCIO.ClearAllCaches()  # without this the old content of a file that was written again would be returned
    # INTERP_BEST is tetrahedral for cubes; INTERP_TETRAHEDRAL would print a warning for files of 1D tables.
    method = OCIO.INTERP_BEST if interpolation == "tetrahedral" else OCIO.INTERP_LINEAR
    with reading(path, "a LUT", LutError), _file_for_reader(path) as (link, problems):
        try:
            processor = OCIO.Config.CreateRaw().getProcessor(OCIO.FileTransform(str(link), interpolation=method))
        except OCIO_ERRORS as error:
            raise LutError(f"{path}: {_reason(str(error), str(link), path)}") from error
        _require_sound(processor.createGroupTransform(), path)
        return processor, problems


@contextmanager
def _file_for_reader(path: Path) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Yield the path of a file for its reader, and problems that other readers have with it.

    OpenColorIO replaces variables such as $SHOT in a path, so it gets a link whose path has none. A text that only
    LutForge decodes is written again to a scratch folder. Raises LutError where a word of the text is no number.
    """
    text = checked_text(path)
    if text.rewritten is None and not {"$", "%"} & set(str(path)):
        yield path.absolute(), text.problems
        return
    with scratch_folder() as folder:
        link = folder / f"lut{path.suffix}"
        if text.rewritten is None:
            link.symlink_to(path.resolve())
        else:
            link.write_text(text.rewritten, encoding="utf-8", newline="\n")
        try:
            yield link, text.problems
        except LutError as error:
            raise LutError(str(error).replace(str(link), str(path))) from error


def is_read_by_ocio(path: Path, lut: Lut) -> bool:
    """True where OpenColorIO reads the file, from which `lut` was read, as it is."""
    return not has_own_reader(path) and "problems" not in lut.metadata


def processor_of_untrusted(path: str | Path) -> OCIO.Processor:
    """The processor of an untrusted file, which is first read in a separate process. Raises LutError."""
    path = Path(path)
    require_file(path, "a LUT", LutError, MOST_FILE_BYTES)
    with reading(path, "a LUT", LutError):
        _sandboxed(_require_processor, path)
        return processor_of_file(path)[0]


def _sandboxed(function: Callable[P, R], *arguments: P.args, **words: P.kwargs) -> R:
    """A call in the separate process for untrusted files. Raises LutError."""
    try:
        return guarded(function, *arguments, **words)
    except OverrunError as error:
        raise LutError(str(error)) from error


def _require_processor(path: Path) -> None:
    """Raise LutError where no processor can be made of a file."""
    processor_of_file(path)[0].getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def _lut_of(path: Path) -> Lut:
    """The LUT of a file that OpenColorIO reads, with its warnings among the metadata."""
    warnings: list[str] = []
    OCIO.SetLoggingFunction(warnings.append)
    try:
        processor, problems = processor_of_file(path)
    finally:
        OCIO.ResetToDefaultLoggingFunction()
    group = processor.createGroupTransform()
    with reading(path, "a LUT", LutError):
        ops = ops_of(group)
    metadata = {"format": path.suffix.lower()}
    if problems:
        metadata["problems"] = "; ".join(problems)
    if warnings:
        metadata["warnings"] = "; ".join(one_line(text, 160) for text in warnings[:2])
    tables = [part for part in group if isinstance(part, OCIO.Lut3DTransform | OCIO.Lut1DTransform)]
    depth = tables[-1].getFileOutputBitDepth() if tables else OCIO.BIT_DEPTH_F32
    bits = OCIO.BitDepthToInt(depth)
    if not OCIO.BitDepthIsFloat(depth) and bits:
        metadata["bits"] = str(bits)
    title, comments, words = _heading(path, group)
    if words:
        metadata["keywords"] = " ".join(words)
    return Lut(ops or (Matrix(np.eye(3)),), title, comments, metadata)


def _heading(path: Path, group: OCIO.GroupTransform) -> tuple[str, tuple[str, ...], list[str]]:
    """Title, comments and the first words of lines, of the part of a file before its numbers."""
    about = group.getFormatMetadata()
    with path.open("rb") as file:
        lines = [line.strip() for line in decoded(file.read(1 << 14))[0].splitlines()]
    if any(line.startswith("<") for line in lines[:3]):  # XML
        described = [part for part in about.getChildElements() if part.getElementName() == "Description"]
        return about.getName()[:200], tuple(part.getElementValue()[:200] for part in described), []

    title = ""
    comments: list[str] = []
    words: list[str] = []
    inside = False  # the metadata of a .csp
    for line in lines:
        first, *rest = line.split(maxsplit=1) or [""]
        if line in ("BEGIN METADATA", "END METADATA"):
            inside = line.startswith("BEGIN")
        elif inside or line.startswith("#"):
            comments.append(line.lstrip("# ")[:200])
        elif _is_number(first) and len(line.split()) == 3:
            break
        elif first and not _is_number(first):
            title = " ".join(rest).strip().strip('"')[:200] if first == "TITLE" else title
            words.append(first[:40])
    return title, tuple(comments[:64]), words[:64]


def _is_number(word: str) -> bool:
    with suppress(ValueError):
        float(word)
        return True
    return False


def ops_of(group: OCIO.GroupTransform) -> tuple[Op, ...]:
    """OpenColorIO's transforms as operations: those that work channel by channel become curves. Raises LutError."""
    ops: list[Op] = []
    single: list[OCIO.Transform] = []  # neighbours that work channel by channel become one curve: errors do not add up
    for part in group:
        inverse = part.getDirection() == OCIO.TRANSFORM_DIR_INVERSE
        converted: list[Op] = []
        match part:
            case OCIO.MatrixTransform() if not inverse:
                matrix, offset = np.array(part.getMatrix()).reshape(4, 4), np.array(part.getOffset())
                if np.any(matrix[:3, 3] != 0):
                    raise _no_figures("a matrix in which alpha tints colours")
                converted = [Matrix(matrix[:3, :3], offset[:3])]
            case OCIO.RangeTransform() if not inverse:
                converted = _range(part)
            case OCIO.Lut1DTransform() if part.getHueAdjust() != OCIO.HUE_NONE:
                raise _no_figures("a curve that keeps hues")
            case OCIO.Lut1DTransform() if not part.getInputHalfDomain() and not inverse:
                converted = [Curve(part.getData().reshape(-1, 3).astype(np.float64))]
            case OCIO.Lut3DTransform() if not inverse:
                size = part.getGridSize()
                tetrahedral = part.getInterpolation() in (OCIO.INTERP_TETRAHEDRAL, OCIO.INTERP_BEST)
                values = part.getData().reshape(size, size, size, 3).astype(np.float64)
                converted = [Cube(values, "tetrahedral" if tetrahedral else "trilinear")]
            case OCIO.Lut3DTransform():
                raise _no_figures("the inverse of a cube")
            case OCIO.CDLTransform() if not inverse:
                converted = _cdl(part)
            case _:
                single.append(part)
                continue
        ops += _tabulated(single)
        single = []
        ops += _with_domain(ops, converted[0]) if isinstance(part, OCIO.Lut1DTransform) else converted
    return (*ops, *_tabulated(single))


def _cdl(part: OCIO.CDLTransform) -> list[Op]:
    """A colour decision list: slope, offset and power channel by channel, then saturation (ASC CDL 1.2)."""
    channels = OCIO.CDLTransform(slope=part.getSlope(), offset=part.getOffset(), power=part.getPower())
    channels.setStyle(part.getStyle())
    luma, saturation = np.array(part.getSatLumaCoefs()), part.getSat()
    ops: list[Op] = _tabulated([channels])
    if saturation != 1.0:
        ops.append(Matrix(saturation * np.eye(3) + (1.0 - saturation) * luma[None, :]))
    return [*ops, Range()] if part.getStyle() == OCIO.CDL_ASC else ops


class NoFiguresError(LutError):
    """A file that OpenColorIO renders, and that is no sequence of matrices, ranges, curves and cubes."""


def _no_figures(operation: str) -> NoFiguresError:
    rendered = "OpenColorIO and `lutforge apply` render it"
    return NoFiguresError(f"it holds {operation}, for which no figures can be reported; {rendered}")


def _with_domain(ops: list[Op], curve: Op) -> list[Op]:
    """A curve with the domain that a matrix at the end of the operations gives it; the matrix is removed from them.

    Only a matrix that scales all channels alike is a domain.
    """
    if not ops or not isinstance(ops[-1], Matrix) or not isinstance(curve, Curve) or not ops[-1].is_diagonal:
        return [curve]
    scale, offset = np.diag(ops[-1].matrix), ops[-1].offset
    if np.ptp(scale) > 0 or np.ptp(offset) > 0 or scale[0] <= 0:
        return [curve]
    ops.pop()
    low, high = (float((end - offset[0]) / scale[0]) for end in (0.0, 1.0))
    return [Curve(curve.outputs, round(low, 9), round(high, 9))]


def _range(part: OCIO.RangeTransform) -> list[Op]:
    """A range as a clamp, where its style is to clamp, and as a scale and offset, where these change something."""
    low = part.getMinInValue() if part.hasMinInValue() else None
    high = part.getMaxInValue() if part.hasMaxInValue() else None
    low_output = part.getMinOutValue() if part.hasMinOutValue() else None
    high_output = part.getMaxOutValue() if part.hasMaxOutValue() else None
    ops: list[Op] = [Range(low, high)] if part.getStyle() == OCIO.RANGE_CLAMP else []

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


def _tabulated(parts: list[OCIO.Transform]) -> list[Op]:
    """Transforms of single channels as one curve with a knot at every finite half float; nothing of no transform.

    CLF's half-domain tables have the same knots. Raises LutError where the transforms mix channels.
    """
    if not parts:
        return []
    halves = np.unique(np.arange(1 << 16, dtype=np.uint16).view(np.float16)).astype(np.float64) + 0.0  # -0.0 becomes 0
    at = np.repeat(halves[np.isfinite(halves)][:, None], 3, axis=1)
    processor = (
        OCIO.Config.CreateRaw()
        .getProcessor(OCIO.GroupTransform(parts))
        .getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
    )
    outputs = evaluate(processor, at).astype(np.float64)
    finite = np.all(np.isfinite(outputs), axis=1)
    curve = Curve(outputs[finite], inputs=at[finite])

    # The curve is right only where the transforms do not mix channels, and are straight lines between half floats:
    # random colours test the first, greys between half floats the second.
    between = (at[1:] + at[:-1])[(at[:-1, 0] > 1e-3) & (at[1:, 0] < 1.5)] / 2
    probes = np.concatenate([np.random.default_rng(0).random((256, 3)) * 1.5 - 0.1, between])
    by_curve = curve(probes)
    if np.any(np.abs(evaluate(processor, probes) - by_curve) > 2e-3 * np.maximum(np.abs(by_curve), 1.0)):
        raise _no_figures(f"a {type(parts[0]).__name__}, which mixes channels or jumps")
    return [curve]


def _require_sound(parts: OCIO.GroupTransform, path: Path) -> None:
    """Raise LutError where a table holds NaN or infinity, or a table's domain is empty or runs backwards.

    OpenColorIO applies such tables without an error. Tables of half-float inputs may hold NaN, for inputs that are NaN.
    In Adobe's Cube LUT Specification 1.0 the lower bound of a domain is below the upper one.
    """
    for part in parts:
        cube = isinstance(part, OCIO.Lut3DTransform)
        curve = isinstance(part, OCIO.Lut1DTransform) and not part.getInputHalfDomain()
        if (cube or curve) and not np.all(np.isfinite(part.getData())):
            raise LutError(f"{path}: a number in its {'cube' if cube else 'curve'} is not finite; make the file anew")
        if isinstance(part, OCIO.MatrixTransform):
            scale: Array = np.diag(np.array(part.getMatrix()).reshape(4, 4))
            backwards = path.suffix.lower() in (".cube", ".spi1d") and not np.all(scale > 0)
            if backwards or not np.all(np.isfinite(part.getMatrix() + part.getOffset())):
                raise LutError(f"{path}: the domain of its table is empty or runs backwards; write it from low to high")


def _reason(message: str, link: str, path: Path) -> str:
    """OpenColorIO's message about a file as part of one line, with what to do where the cause is known."""
    if "no element found" in message or "unclosed token" in message:
        return "the file ends before its last element: make or copy it again"
    reason = message.replace(link, path.name).split("failed with: ")[-1].split("All formats")[0]
    if "could not be loaded" in reason:
        suffix = path.suffix.lower()
        return f"it is not a {suffix} file that OpenColorIO can read; `lutforge check` shows which programs do"
    return f"OpenColorIO cannot read it: {one_line(reason, 200)}"
