"""The records of a kit: the camera's look, the files for a program, and the script that runs the program."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.luts.description import description
from lutforge.luts.input_and_output import InputAndOutput
from lutforge.luts.verification import FileError
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.model.transform import Decode, Encode, MatrixStage, Transform

BALANCED_RAW = "linear camera RAW behind its white balance, which the developer sets"
"""The input of camera profiles, in words that files state."""

Source = Literal["raw", "any"]
"""The profiles that a kit can be made from: only those of RAW files, or also those of developed pictures."""


@dataclass(frozen=True, eq=False)
class Look:
    """A camera's look: its rendering in one style and white balance.

    The input is what the profile was calibrated on, RAW or developed pictures. render: the input, white-balanced,
    (…, 3) on [0, 1] → the camera's JPEG, encoded sRGB. multipliers: (3,), of the setting, with gain.
    """

    profile: CameraProfile
    style: str
    white_balance: str
    render: Callable[[Array], Array]
    multipliers: Array

    @property
    def to_srgb(self) -> Array:
        """(3, 3): white-balanced input → linear sRGB, by the matrix of all colours of the style if it has one."""
        models = self.profile.styles[self.style].models
        return models[0].matrix if models else self.profile.matrix

    @property
    def title(self) -> str:
        """The look's name, for menus."""
        return f"{self.profile.camera} {self.style}"

    @property
    def file_name(self) -> str:
        """The title as the name of a file, without a suffix."""
        return re.sub(r"[^\w .+-]", "_", self.title)[:120]

    @property
    def setting(self) -> str:
        """STYLE/WB."""
        return f"{self.style}/{self.white_balance}"

    @property
    def details(self) -> list[str]:
        """Camera, settings and held-out errors, as files state them."""
        errors = self.profile.render(self.setting).purpose.comments
        return [f"camera and settings: {self.profile.camera}, {self.setting}", *errors]

    def description(self, input_: str, output: str) -> tuple[str, ...]:
        """The lines that a camera profile of the look states: version, input, output, camera, settings and licence."""
        return description(InputAndOutput(input_, output), details=self.details)

    def seen_from(self, source: str) -> Transform:
        """Colours of a space → the camera's JPEG, encoded sRGB.

        For a profile of developed pictures this is exactly what was calibrated. For one of RAW files it is approximate:
        one matrix converts the program's colours back to camera RGB. In linear spaces values may be below 0 or above 1.
        """
        if self.profile.raw_space == "raw":
            return through_camera(self.profile, self.setting, source)
        encoding = rgb_space(source)
        stages = self.profile.render(self.setting).stages
        decode = () if encoding.is_linear else (Decode(encoding),)
        matrix = matrix_between(encoding.linear.name, self.profile.raw_space) / self.multipliers[:, None]
        return Transform((*decode, MatrixStage(matrix), *stages))

    def between(self, source: str, target: str) -> Transform:
        """Colours of a space → the camera's rendering of them, in another space."""
        space = rgb_space(target)
        from_srgb = MatrixStage(matrix_between("linear-srgb", space.linear.name))
        encode = () if space.is_linear else (Encode(space),)
        to_target = () if space.name == "srgb" else (Decode(rgb_space("srgb")), from_srgb, *encode)
        return Transform((*self.seen_from(source).stages, *to_target))


def setting_of(profile: CameraProfile, to: str) -> str:
    """STYLE/WB as it is; STYLE alone with the profile's white balance daylight, or the first where it has none."""
    balances = profile.white_balances
    return to if "/" in to else f"{to}/{'daylight' if 'daylight' in balances else next(iter(balances))}"


def look_of(profile: CameraProfile, to: str) -> Look:
    """The camera's look at STYLE/WB or STYLE. Raises SettingsError or ProfileError on an unknown one."""
    selector = profile.selector(setting_of(profile, to))
    multipliers = profile.multipliers(selector)
    rendering = profile.render(selector)

    def render(balanced: Array) -> Array:
        return rendering(np.asarray(balanced) / multipliers)

    return Look(profile, selector.style, str(selector.white_balance), render, multipliers)


@dataclass(frozen=True)
class Script:
    """A script by which a program develops a RAW file with a preset of a kit.

    program: its command; suffix: of the presets. lines: shell commands that develop $raw to $picture with the preset
    $look. They can use $here, the kit's folder, $work, a temporary folder, and `refuse REASON FILE`, which ends the
    script with an error that quotes a line of the file.
    """

    program: str
    suffix: str
    lines: str


@dataclass(frozen=True)
class KitFiles:
    """The result of writing a kit: the user's steps, for its README, and the error of each file, by its name."""

    steps: list[str]
    errors: dict[str, FileError]


@dataclass(frozen=True)
class Kit:
    """A kind of kit: how one program shows a look.

    program: the name that `--for` takes; title: its name for people; source: the profiles that the kit can be made
    from; tried: the program and version that it was tried with. write: adds the files of a look to a folder. script:
    develops a RAW file without a window; None for a program that cannot.
    """

    program: str
    title: str
    source: Source
    tried: str
    write: Callable[[Look, Path], KitFiles]
    script: Script | None = None


def write_script(path: Path, program: str, lines: str) -> None:
    """Write an executable script that needs a program: `lines`, with $here, the kit's folder."""
    head = f"""#!/bin/sh
set -eu
if ! command -v {program} >/dev/null; then echo "{program} is not installed" >&2; exit 2; fi
here=$(cd "$(dirname "$0")" && pwd)
"""
    path.write_text(head + lines, encoding="utf-8", newline="\n")
    path.chmod(0o755)


def write_develop_script(path: Path, script: Script, look: str) -> None:
    """Write `develop.sh RAW OUT.tif [LOOK]`. look: the name of the preset that is the default."""
    # Programs ignore a damaged profile without an error, so the script compares the kit's profiles with their SHA-256.
    profiles = sorted(file for file in path.parent.iterdir() if file.suffix in (".icc", ".dcp"))
    sums = "".join(f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in profiles)
    begin = f"""# Develops a RAW file with the camera's look: develop.sh RAW OUT.tif [LOOK] (sRGB, 16 bit).
if [ $# -ne 2 ] && [ $# -ne 3 ]; then echo "usage: $0 RAW OUT.tif [LOOK]" >&2; exit 2; fi
if [ ! -r "$1" ]; then echo "$1: cannot be read" >&2; exit 2; fi
name=$1
look=${{3:-{look}}}
if [ ! -r "$here/$look{script.suffix}" ]; then echo "the kit holds no look of the name $look" >&2; exit 2; fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
picture="$work/developed.tif"
case "$1" in /*) raw=$1;; *) raw=$PWD/$1;; esac  # darktable follows no link that is named from here
refuse() {{
  why=$(grep -i -m 1 'fail\\|error\\|cannot\\|could not\\|unsupported\\|mismatch' "$2" || tail -n 1 "$2")
  echo "$name: $1: $why" | cut -c 1-300 >&2
  exit 1
}}
check=$(command -v sha256sum || command -v shasum || echo :)
(cd "$here" && LC_ALL=C $check -c >"$work/sums" 2>&1) <<'SUMS' ||
{sums}SUMS
  refuse "a camera profile of the kit is damaged, make the kit again" "$work/sums"
"""
    write_script(path, script.program, begin + script.lines + 'mv -f "$picture" "$2"\n')
