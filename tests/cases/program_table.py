"""The guide's table of what programs do with LUT files, from the table that `check` and `bake` use.

`python -m tests.cases.program_table` writes it, after `make hosts` has run the programs, and prints which of them are
here in another version than the table names.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from lutforge.atomic_write import atomic_path
from lutforge.luts.lut_kind import LutKind
from lutforge.luts.lut_programs import GARBAGE, LEAVES, NOT_KNOWN, PROGRAMS, READS, REFUSES, Program

PAGE = Path(__file__).resolve().parents[2] / "examples" / "guide" / "files.md"
KINDS = {
    "plain `.cube`": LutKind.CUBE,
    "`.cube` with a domain other than 0 to 1": LutKind.CUBE_WITH_DOMAIN,
    "shaper `.cube`": LutKind.CUBE_WITH_SHAPER,
    "`.csp`": LutKind.CSP,
    "`.3dl`": LutKind.FLAME_3DL,
    "`.clf`": LutKind.CLF,
    "Hald image": LutKind.HALD,
}
"""The columns of the table, and the kind of file of each."""

SHORT = {READS: "read", REFUSES: "refused", NOT_KNOWN: "–"}
"""What fits into a cell, instead of a whole verdict."""

WITHIN = {GARBAGE: "**wrong colours**", LEAVES: "**picture left as it is**"}
"""The same, of a part of a verdict."""

VERSIONS = {
    "ffmpeg": ("ffmpeg", "-version"),
    "mpv": ("mpv", "--version"),
    "mlt": ("melt", "--version"),
    "darktable": ("darktable-cli", "--version"),
    "rawtherapee": ("rawtherapee-cli", "-v"),
    "gmic": ("gmic", "version"),
    "imagemagick": ("convert-im6.q16", "-version"),
    "graphicsmagick": ("gm", "version"),
}
"""The command that prints the version of a program."""

_TABLE = re.compile(r"(<!-- programs -->\n\n)(.*?)(\n\n<!-- end of programs -->)", re.DOTALL)


def table() -> str:
    """The table in Markdown: first what was measured, by version, then what was not run."""
    rows = [
        f"| program | {' | '.join(KINDS)} | measured with |",
        f"|{'---|' * (len(KINDS) + 2)}",
    ]
    titled = [program for program in PROGRAMS.values() if program.title and (program.tried or program.does)]
    for program in sorted(titled, key=lambda program: not program.tried):
        cells = [_cell(program, kind) for kind in KINDS.values()]
        rows.append(f"| {program.title} | {' | '.join(cells)} | {program.tried or 'not run here'} |")
    return "\n".join(rows)


def _cell(program: Program, kind: LutKind) -> str:
    verdict = program.does.get(kind, program.otherwise if program.tried else NOT_KNOWN)
    for words, short in WITHIN.items():
        verdict = verdict.replace(words, short)
    return SHORT.get(verdict, verdict)


def with_table(page: str) -> str:
    """The text of a page with the table between its marks."""
    return _TABLE.sub(lambda block: block[1] + table() + block[3], page)


def other_versions() -> list[str]:
    """A line for each program that is not here, or here in another version than the table names."""
    lines = []
    for name, command in VERSIONS.items():
        program = PROGRAMS[name]
        if shutil.which(command[0]) is None:
            lines.append(f"{program.title}: not installed; the table has {program.tried}")
            continue
        ran = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=60)
        version = re.search(r"\d+\.\d+", ran.stdout + ran.stderr)
        if version is None or version[0] != program.tried:
            lines.append(
                f"{program.title}: {version[0] if version else 'no version'} is here, the table has {program.tried}"
            )
    return lines


def main() -> None:
    """Write the table into the page."""
    page = PAGE.read_text(encoding="utf-8")
    with atomic_path(PAGE) as temporary:
        temporary.write_text(with_table(page), encoding="utf-8")
    print(*other_versions(), sep="\n", file=sys.stderr)


if __name__ == "__main__":
    main()
