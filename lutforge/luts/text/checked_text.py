"""The text of a LUT file, checked for a reader, and the problems that other readers have with it."""

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import LutError
from lutforge.luts.text.cube_dialects import of_one_dialect, require_header_words
from lutforge.luts.text.encoding import decoded
from lutforge.luts.text.numbers import require_numbers, require_numbers_of_xml
from lutforge.luts.text.oddities import without_oddities
from lutforge.luts.text.tables import require_3dl, require_csp, require_cube_rows, require_spi3d

TEXTS = (".cube", ".itx", ".3dl", ".csp", ".spi1d", ".spi3d", ".spimtx", ".cub", ".lut", ".mga", ".m3d", ".vf", ".vlt")
"""Suffixes of formats that are lines of text."""
XML = (".clf", ".ctf", ".cc", ".ccc", ".cdl")
"""Suffixes of formats that are XML."""


@dataclass(frozen=True)
class LutText:
    """The text of a LUT file for its reader.

    rewritten: the text for the reader, or None where the file can be read as it is; problems: those that other programs
    have with the file.
    """

    rewritten: str | None = None
    problems: tuple[str, ...] = ()


def checked_text(path: Path) -> LutText:
    """Decode a LUT file and check its numbers. Files whose format is no text are not read.

    Raises LutError, which names the line and what to do, where a word should be a number and is none, and where a row
    has too few or too many numbers.
    """
    suffix = path.suffix.lower()
    if suffix not in TEXTS + XML:
        return LutText()
    data = path.read_bytes()
    try:
        text, problem = decoded(data)
    except UnicodeDecodeError:
        raise LutError(f"{path}: its text in UTF-16 or UTF-32 is cut short or damaged: copy it again") from None

    if suffix in XML or text.lstrip()[:1] == "<":
        require_numbers_of_xml(text, path)
        if not problem or data.startswith(codecs.BOM_UTF8):
            return LutText()
        # The text was UTF-16: its declaration must name the encoding in which the reader gets it.
        return LutText(re.sub(r"(<\?xml[^>]*encoding=)([\"'])[^\"']*\2", r"\1\2UTF-8\2", text, count=1), (problem,))
    return _checked_table(text, suffix, path, [problem] if problem else [])


def _checked_table(text: str, suffix: str, path: Path, problems: list[str]) -> LutText:
    """Check a table in lines of text. problems: those of its encoding. Raises LutError as `checked_text`."""
    lines = re.split(r"\r\n|\n|\r", text)
    if "\r" in text and "\n" not in text:
        problems.append("lines end in carriage returns alone, which OpenColorIO does not read: save it with line feeds")
    lines, oddities = without_oddities(lines, suffix)
    problems += oddities

    # A .cube that ends early is reported as such, before the words of its last line are.
    if suffix == ".cube":
        require_cube_rows(lines, path)
    require_numbers(lines, suffix, path)

    match suffix:
        case ".csp":
            require_csp(lines, path)
        case ".spi3d":
            require_spi3d(lines, path)
            lines = [line for line in lines if line.strip()]
        case ".3dl":
            require_3dl(lines, path)
        case ".cube":
            require_header_words(lines, path)
            lines, mixed = of_one_dialect(lines, path)
            problems += mixed
    return LutText("\n".join(lines) + "\n" if problems else None, tuple(problems))
