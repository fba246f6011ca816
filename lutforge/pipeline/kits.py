"""Use case: a profile → a kit, the folder that makes one program show the camera's look; and the check of a kit."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.atomic_write import scratch_folder
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.developers.developer import run_command
from lutforge.errors import LutForgeError, SettingsError, ShotError
from lutforge.images.development import Development
from lutforge.images.read import read_image
from lutforge.kits.art import ArtKit
from lutforge.kits.blender import BlenderKit
from lutforge.kits.darktable import DarktableKit
from lutforge.kits.kit import Kit, Look, look_of
from lutforge.kits.lightroom import LightroomKit
from lutforge.kits.lumix import LumixKit
from lutforge.kits.nuke import NukeKit
from lutforge.kits.rawtherapee import RawTherapeeKit
from lutforge.kits.resolve import ResolveKit
from lutforge.kits.srgb_cubes import SRGB_CUBE_KITS
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.pipeline.raw_substitutes import DEVELOPERS
from lutforge.progress import Progress, silent
from lutforge.samples.extract import extract
from lutforge.samples.tiles import cell_size
from lutforge.shots.cells import raw_on_jpeg_cells
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot

KITS: dict[str, Kit] = {
    kit.program: kit
    for kit in (
        DarktableKit(), RawTherapeeKit(), ArtKit(), LightroomKit(), ResolveKit(), NukeKit(), BlenderKit(),
        *SRGB_CUBE_KITS, LumixKit(),
    )
}  # fmt: skip
"""The programs that `--for` names."""

SCRIPT = "develop.sh"


@dataclass(frozen=True)
class KitCheck:
    """How far a kit's program is from the camera's JPEG on one shot: ΔE00 (CIE 2000) of its flat tiles.

    tiles: how many were compared; p95: the 95th percentile.
    """

    shot: str
    tiles: int
    mean: float
    p95: float
    maximum: float


def write_kit(profile: CameraProfile, to: str, folder: str | Path, program: str | None = None) -> Path:
    """Write a kit: LUT or camera profile, the preset that places it, a README, and develop.sh where it can be run.

    program: as `--for` names it; without one, the program that developed the profile's pictures, else RawTherapee,
    whose camera profile others read. folder: must be new, empty, or an older kit, which is replaced.
    Raises SettingsError where the profile's pairs are not what the program feeds to a LUT, LutForgeError where the
    folder holds other files.
    """
    look = look_of(profile, to)
    kit = KITS[one_of("kit", program or _own_program(look), KITS)]
    _require_source(kit, look)
    target = Path(folder).resolve()  # behind a link stays what it leads to
    if target.exists() and not _may_be_replaced(target):
        raise LutForgeError(f"{target}: holds other files; name a new folder for the kit")
    check_output(target / "README.md")
    with scratch_folder(beside=target) as scratch:
        filled = scratch / "kit"
        filled.mkdir()
        steps = kit.write(look, filled)
        (filled / "README.md").write_text(_readme(kit, look, steps, filled), encoding="utf-8")
        if target.exists():
            target.replace(scratch / "old")
        filled.replace(target)
    return Path(folder)


def kits_of(profile: CameraProfile, to: str) -> list[str]:
    """The programs that a kit of a look can be for. Raises SettingsError on an unknown look."""
    look, programs = look_of(profile, to), []
    for name, kit in KITS.items():
        try:
            _require_source(kit, look)
        except SettingsError:
            continue
        programs.append(name)
    return programs


def check_kit(
    folder: str | Path, shots: Sequence[str | Path], progress: Progress = silent
) -> tuple[list[KitCheck], list[str]]:
    """Develop RAW files with a kit's own program, and compare them with the camera's JPEGs.

    Returns what was measured, and notes: what the kit's script noted, and a line for each shot that could not be
    measured. Raises LutForgeError where the kit runs no program, ShotError where no shot could be measured.
    """
    script = Path(folder) / SCRIPT
    if not script.is_file():
        raise LutForgeError(f"{folder}: holds no {SCRIPT}: its program cannot be run from the command line")
    files = discover(shots)
    checks: list[KitCheck] = []
    notes: list[str] = []
    for index, file in enumerate(files):
        progress(file.name, index / len(files))
        try:
            check, said = _checked(script, file)
            checks.append(check)
            notes += [text for text in said if text not in notes]
        except LutForgeError as error:
            notes.append(str(error))
    progress("done", 1.0)
    if not checks:
        raise ShotError("no shot could be compared: " + "; ".join(notes))
    return checks, notes


def compare_with_jpeg(raw: Path, picture: Path) -> KitCheck:
    """Compare a picture that any program developed of a RAW file, in encoded sRGB, with the camera's JPEG of the shot.

    The tiles are chosen from the RAW and the JPEG alone, so a tile that the program clips counts; a tile that its
    picture crops does not. Raises ImageError where a file cannot be read, ShotError where the pictures do not match.
    """
    pixels = np.asarray(read_image(picture).pixels[..., :3], dtype=np.float32)
    own = read_shot(raw)
    samples = extract(own).samples
    samples = samples.select(np.char.startswith(samples.patch.astype(np.str_), "tile_"))
    developed = read_shot(raw, Development(pixels, "srgb", picture.name))
    turns = [turn for turn in range(4) if np.array_equal(np.rot90(own.jpeg, turn), developed.jpeg)]
    if not turns:
        raise ShotError(f"{raw}: {picture.name} matches another JPEG than the RAW does")
    if turns[0]:
        upright = np.ascontiguousarray(np.rot90(pixels, -turns[0]))
        developed = read_shot(raw, Development(upright, "srgb", picture.name))
    cell = cell_size(own.registration)
    corners = np.array([name.split("_")[1:] for name in samples.patch], dtype=np.intp).reshape(-1, 2)
    shown = raw_on_jpeg_cells(developed, cell).mean[corners[:, 1] // cell, corners[:, 0] // cell]
    inside = np.isfinite(shown).all(axis=1)
    if not inside.any():
        raise ShotError(f"{raw}: no flat tiles to compare")
    difference = delta_e_2000(np.clip(shown[inside], 0.0, 1.0), samples.srgb[inside])
    return KitCheck(
        raw.name, len(difference), float(difference.mean()), float(np.quantile(difference, 0.95)),
        float(difference.max()),
    )  # fmt: skip


def _checked(script: Path, raw: Path) -> tuple[KitCheck, list[str]]:
    """Compare one file; and what the kit's script noted."""
    with scratch_folder() as folder:
        output = folder / "developed.tif"
        said = run_command([str(script.resolve()), str(raw.resolve()), str(output)], script.name, raw, output)
        notes = [line.removeprefix("note: ") for line in said.splitlines() if line.startswith("note: ")]
        return compare_with_jpeg(raw, output), notes


def _own_program(look: Look) -> str:
    """The program that a kit is for where none is named."""
    if look.space == "raw":
        return "rawtherapee"
    program = look.developer.split(" ")[0]
    if program not in KITS:  # pictures that were exported say nothing of their program
        raise SettingsError(f"the profile is of {look.developer}: name the program that made them with --for")
    return program


def _may_be_replaced(folder: Path) -> bool:
    """Whether a folder is empty, or holds a kit and nothing but what its README names."""
    if not folder.is_dir():
        return False
    names = {path.name for path in folder.iterdir()}
    if not names:
        return True
    readme = folder / "README.md"
    text = readme.read_text(encoding="utf-8", errors="replace") if readme.is_file() else ""
    listed = re.findall(r"^Files: (.*)\. Tried with: ", text, flags=re.MULTILINE)
    return len(listed) == 1 and names == {"README.md", *listed[0].split(", ")}


def _readme(kit: Kit, look: Look, steps: Sequence[str], folder: Path) -> str:
    """One page: what it is, what to do, what it was tried with."""
    made = f"pictures that {look.developer} developed" if look.developer else "RAW files"
    lines = [
        f"# {look.camera}, style {look.style}: for {kit.title}",
        "",
        f"The camera's own JPEG look, calibrated on pairs of {made} and the camera's JPEGs by LutForge.",
        "",
        *(f"{number}. {step}" for number, step in enumerate(steps, 1)),
        "",
    ]
    if (folder / SCRIPT).is_file():
        lines += ["On the command line: `./develop.sh RAW OUT.tif` (sRGB, 16 bit).", ""]
    files = ", ".join(sorted(path.name for path in folder.iterdir()))
    return "\n".join([*lines, f"Files: {files}. Tried with: {kit.tried}.", ""])


def _require_source(kit: Kit, look: Look) -> None:
    """Raise SettingsError, with the command that helps, where a profile's pairs are not what a kit can be made from."""
    if kit.source == "developed" and look.space == "raw":
        raise SettingsError(
            f"{kit.title} feeds no camera RAW to a LUT: calibrate on what it develops, "
            f"lutforge calibrate SHOT… --developer {kit.program} -o camera.npz"
        )
    if look.space != "raw" and look.white_balance.lower() not in look.profile.white_balances:
        own = ", ".join(f"{look.style}/{name}" for name in look.profile.white_balances)
        raise SettingsError(
            f"the profile is of {look.developer}, whose white balance is in it already: instead of "
            f"{look.white_balance} name one of its own, {own}"
        )
    if kit.source == "raw" and look.space != "raw":
        raise SettingsError(
            f"a kit for {kit.title} needs a profile of RAW files; this one is of {look.developer}: "
            "lutforge calibrate SHOT… -o camera.npz"
        )
    developer = look.developer.split(" ")[0]
    if kit.program in DEVELOPERS and developer in DEVELOPERS and kit.program != developer:
        raise SettingsError(
            f"{kit.title} develops otherwise than {look.developer}, which the profile is of: "
            f"lutforge calibrate SHOT… --developer {kit.program} -o camera.npz"
        )
