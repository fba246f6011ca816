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
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.ocio_transforms import OCIO_ERRORS
from lutforge.luts.ops import Matrix
from lutforge.luts.ops_from_ocio import ops_of
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
    with reading(path, f"a {path.suffix.lower()} LUT", LutError):
        if has_own_reader(path):
            return _lut_by_own_reader(path)
        _require_suffix_of_ocio(path)
        return _in_child_process(_lut_by_ocio, path)


def has_own_reader(path: Path) -> bool:
    """True for a format that OpenColorIO does not know, and LutForge reads itself."""
    return path.suffix.lower() in OWN_READERS


def is_read_by_ocio(path: Path, lut: Lut) -> bool:
    """True where OpenColorIO reads the file, from which `lut` was read, as it is."""
    return not has_own_reader(path) and not lut.metadata.problems


def trusted_processor(path: str | Path, interpolation: Interpolation = "tetrahedral") -> OCIO.CPUProcessor:
    """OpenColorIO's processor, float32 in and out, of a LUT file that LutForge wrote.

    The file is read in this process: of any other file call `validated_processor`. interpolation: for cubes of files
    that name none. Raises LutError.
    """
    with reading(path, "a LUT", LutError):
        processor, _ = _processor_and_problems(Path(path), interpolation)
        return processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def validated_processor(path: str | Path) -> OCIO.Processor:
    """OpenColorIO's processor of an untrusted file, which a child process has read before. Raises LutError."""
    path = Path(path)
    require_file(path, "a LUT", LutError, MOST_FILE_BYTES)
    with reading(path, "a LUT", LutError):
        _in_child_process(_require_processor, path)
        processor, _ = _processor_and_problems(path)
        return processor


def _in_child_process(function: Callable[P, R], *arguments: P.args, **words: P.kwargs) -> R:
    """Call a function in the child process for untrusted files, and return its value. Raises LutError."""
    try:
        return guarded(function, *arguments, **words)
    except OverrunError as error:
        raise LutError(str(error)) from error


def _require_processor(path: Path) -> None:
    """Raise LutError where no processor can be made of a file."""
    processor, _ = _processor_and_problems(path)
    processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def _lut_by_own_reader(path: Path) -> Lut:
    """The LUT in a file of a format that OpenColorIO does not know."""
    suffix = path.suffix.lower()
    with _path_to_read(path) as (path_to_read, problems):
        lut = OWN_READERS[suffix](path_to_read)
    return replace(lut, metadata=replace(lut.metadata, format=lut.metadata.format or suffix, problems=problems))


def _require_suffix_of_ocio(path: Path) -> None:
    """Raise LutError where no reader of OpenColorIO has a file's suffix; it would try all of them first."""
    suffix = path.suffix.lower()
    if suffix == ".dcp":
        raise LutError(f"{path}: a camera profile, which is no LUT; `lutforge check` shows which programs read it")
    known = {f".{name.lower()}" for _, name in OCIO.FileTransform.getFormats()}
    if suffix not in known:
        suffixes = ", ".join(sorted(known | {*FORMATS}))
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {suffixes}')


def _lut_by_ocio(path: Path) -> Lut:
    """The LUT in a file that OpenColorIO reads, with its warnings among the metadata."""
    warnings: list[str] = []
    OCIO.SetLoggingFunction(warnings.append)
    try:
        processor, problems = _processor_and_problems(path)
    finally:
        OCIO.ResetToDefaultLoggingFunction()
    group = processor.createGroupTransform()
    with reading(path, "a LUT", LutError):
        ops = ops_of(group)

    title, comments, keywords = _heading(path, group)
    metadata = LutMetadata(
        format=path.suffix.lower(),
        bits=_integer_bits(group),
        keywords=keywords,
        problems=problems,
        warnings=tuple(one_line(text, 160) for text in warnings[:2]),
    )
    return Lut(ops or (Matrix(np.eye(3)),), title, comments, metadata)


def _integer_bits(group: OCIO.GroupTransform) -> int | None:
    """The bits of the integers in the last table of a file; None where it holds floats or no table."""
    tables = [transform for transform in group if isinstance(transform, OCIO.Lut3DTransform | OCIO.Lut1DTransform)]
    depth = tables[-1].getFileOutputBitDepth() if tables else OCIO.BIT_DEPTH_F32
    if OCIO.BitDepthIsFloat(depth):
        return None
    return int(OCIO.BitDepthToInt(depth)) or None  # 0 where the depth is not known


def _processor_and_problems(
    path: Path, interpolation: Interpolation = "tetrahedral"
) -> tuple[OCIO.Processor, tuple[str, ...]]:
    """OpenColorIO's processor of a LUT file, and the problems that other readers have with the file.

    OpenColorIO parses the file in this process. Raises LutError.
    """
    require_file(path, "a LUT", LutError, MOST_FILE_BYTES)
    if path.suffix.lower() == ".csp":  # OpenColorIO 2.6 never ends where the end of the metadata is missing
        text = path.read_bytes()
        if text.count(b"BEGIN METADATA") > text.count(b"END METADATA"):
            raise LutError(f"{path}: no END METADATA after BEGIN METADATA; the file is damaged")

    OCIO.ClearAllCaches()  # without this the old content of a file that was written again would be returned
    # INTERP_BEST is tetrahedral for cubes; INTERP_TETRAHEDRAL would print a warning for files of 1D tables.
    method = OCIO.INTERP_BEST if interpolation == "tetrahedral" else OCIO.INTERP_LINEAR
    with reading(path, "a LUT", LutError), _path_to_read(path) as (path_to_read, problems):
        try:
            transform = OCIO.FileTransform(str(path_to_read), interpolation=method)
            processor = OCIO.Config.CreateRaw().getProcessor(transform)
        except OCIO_ERRORS as error:
            raise LutError(f"{path}: {_reason(str(error), str(path_to_read), path)}") from error
        _require_sound(processor.createGroupTransform(), path)
        return processor, problems


@contextmanager
def _path_to_read(path: Path) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Yield the path under which a reader reads a file, and problems that other readers have with the file.

    It is the file's own where nothing speaks against that. OpenColorIO replaces variables such as $SHOT in a path: then
    it is a link whose path has none. A text that only LutForge decodes is written again to a scratch folder. Raises
    LutError where a word of the text is no number.
    """
    text = checked_text(path)
    if text.rewritten is None and not {"$", "%"} & set(str(path)):
        yield path.absolute(), text.problems
        return
    with scratch_folder() as folder:
        path_to_read = folder / f"lut{path.suffix}"
        if text.rewritten is None:
            path_to_read.symlink_to(path.resolve())
        else:
            path_to_read.write_text(text.rewritten, encoding="utf-8", newline="\n")
        try:
            yield path_to_read, text.problems
        except LutError as error:
            raise LutError(str(error).replace(str(path_to_read), str(path))) from error


def _heading(path: Path, group: OCIO.GroupTransform) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Title, comments and the first words of lines, before the numbers of a file."""
    with path.open("rb") as file:
        lines = [line.strip() for line in decoded(file.read(1 << 14))[0].splitlines()]
    is_xml = any(line.startswith("<") for line in lines[:3])
    return _heading_of_xml(group.getFormatMetadata()) if is_xml else _heading_of_text(lines)


def _heading_of_xml(metadata: OCIO.FormatMetadata) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Title and descriptions of a process list, which has no keywords."""
    descriptions = [child for child in metadata.getChildElements() if child.getElementName() == "Description"]
    return metadata.getName()[:200], tuple(child.getElementValue()[:200] for child in descriptions), ()


def _heading_of_text(lines: list[str]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Title, comments and keywords of the lines before a table, each without white space around it."""
    title = ""
    comments: list[str] = []
    keywords: list[str] = []
    in_metadata = False  # of a .csp
    for line in lines:
        first, *rest = line.split(maxsplit=1) or [""]
        if line in ("BEGIN METADATA", "END METADATA"):
            in_metadata = line.startswith("BEGIN")
        elif in_metadata or line.startswith("#"):
            comments.append(line.lstrip("# ")[:200])
        elif _is_number(first) and len(line.split()) == 3:
            break
        elif first and not _is_number(first):
            title = " ".join(rest).strip().strip('"')[:200] if first == "TITLE" else title
            keywords.append(first[:40])
    return title, tuple(comments[:64]), tuple(keywords[:64])


def _is_number(word: str) -> bool:
    with suppress(ValueError):
        float(word)
        return True
    return False


def _require_sound(group: OCIO.GroupTransform, path: Path) -> None:
    """Raise LutError where a table holds NaN or infinity, or a table's domain is empty or runs backwards.

    OpenColorIO applies such tables without an error. Tables of half-float inputs may hold NaN, for inputs that are NaN.
    In Adobe's Cube LUT Specification 1.0 the lower bound of a domain is below the upper one.
    """
    for transform in group:
        is_cube = isinstance(transform, OCIO.Lut3DTransform)
        is_curve = isinstance(transform, OCIO.Lut1DTransform) and not transform.getInputHalfDomain()
        if (is_cube or is_curve) and not np.all(np.isfinite(transform.getData())):
            raise LutError(
                f"{path}: a number in its {'cube' if is_cube else 'curve'} is not finite; make the file anew"
            )
        if isinstance(transform, OCIO.MatrixTransform):
            scale: Array = np.diag(np.array(transform.getMatrix()).reshape(4, 4))
            backwards = path.suffix.lower() in (".cube", ".spi1d") and not np.all(scale > 0)
            if backwards or not np.all(np.isfinite(transform.getMatrix() + transform.getOffset())):
                raise LutError(f"{path}: the domain of its table is empty or runs backwards; write it from low to high")


def _reason(message: str, path_to_read: str, path: Path) -> str:
    """OpenColorIO's message about a file as part of one line, with what to do where the cause is known."""
    if "no element found" in message or "unclosed token" in message:
        return "the file ends before its last element: make or copy it again"
    reason = message.replace(path_to_read, path.name).split("failed with: ")[-1].split("All formats")[0]
    if "could not be loaded" in reason:
        suffix = path.suffix.lower()
        return f"it is not a {suffix} file that OpenColorIO can read; `lutforge check` shows which programs do"
    return f"OpenColorIO cannot read it: {one_line(reason, 200)}"
