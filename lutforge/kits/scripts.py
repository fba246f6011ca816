"""Shell scripts that run a program with the files of a kit: `develop.sh RAW OUT.tif`."""

from pathlib import Path

_HEAD = """#!/bin/sh
set -eu
if ! command -v {program} >/dev/null; then echo "{program} is not installed" >&2; exit 2; fi
here=$(cd "$(dirname "$0")" && pwd)
"""

_DEVELOP = """# Develops a RAW file with the camera's look: develop.sh RAW OUT.tif (sRGB, 16 bit).
if [ $# -ne 2 ]; then echo "usage: $0 RAW OUT.tif" >&2; exit 2; fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"""


def write_script(path: Path, program: str, lines: str) -> None:
    """Write an executable script that needs a program: `lines`, with $here, the kit's folder."""
    path.write_text(_HEAD.format(program=program) + lines, encoding="utf-8", newline="\n")
    path.chmod(0o755)


def write_develop_script(path: Path, program: str, lines: str) -> None:
    """Write an executable script that develops $1 to $2: `lines`, with $here and $work, a temporary folder."""
    write_script(path, program, _DEVELOP + lines)
