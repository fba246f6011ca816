"""Shell scripts that run a program with the files of a kit: `develop.sh RAW OUT.tif`."""

from pathlib import Path

_HEAD = """#!/bin/sh
set -eu
if ! command -v {program} >/dev/null; then echo "{program} is not installed" >&2; exit 2; fi
here=$(cd "$(dirname "$0")" && pwd)
"""

_DEVELOP = """# Develops a RAW file with the camera's look: develop.sh RAW OUT.tif (sRGB, 16 bit).
if [ $# -ne 2 ]; then echo "usage: $0 RAW OUT.tif" >&2; exit 2; fi
if [ ! -r "$1" ]; then echo "$1: cannot be read" >&2; exit 2; fi
name=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
picture="$work/developed.tif"
case "$1" in /*) raw=$1;; *) raw=$PWD/$1;; esac  # darktable follows no link that is named from here
refuse() {{
  said=$(grep -i -m 1 'fail\\|error\\|cannot\\|unsupported\\|mismatch' "$2" || tail -n 1 "$2")
  echo "$name: $1: $said" | cut -c 1-300 >&2
  exit 1
}}
{note}{lines}mv -f "$picture" "$2"
"""

_NOTE = """version=$({program} --version 2>/dev/null | grep -o '[0-9][0-9]*[.][0-9.]*' | head -n 1)
if [ "$version" != "{version}" ]; then
  echo "note: the kit was made with {made_with}, this is $version; calibrate again if colours are off" >&2
fi
"""


def write_script(path: Path, program: str, lines: str) -> None:
    """Write an executable script that needs a program: `lines`, with $here, the kit's folder."""
    path.write_text(_HEAD.format(program=program) + lines, encoding="utf-8", newline="\n")
    path.chmod(0o755)


def write_develop_script(path: Path, program: str, made_with: str, lines: str) -> None:
    """Write an executable script that develops $1 to $2.

    made_with: name and version of the program that the kit was calibrated with, or "": another one says so. lines: make
    $picture of $raw, the whole path of $1; they have $here and $work, a temporary folder, and `refuse REASON FILE`,
    which ends the script with the line of a file that says why.
    """
    version = made_with.partition(" ")[2]
    note = _NOTE.format(program=program, version=version, made_with=made_with) if version else ""
    write_script(path, program, _DEVELOP.format(note=note, lines=lines))
