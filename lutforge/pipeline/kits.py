"""Use case: a profile → a kit, the folder that makes one program show the camera's look; and the check of a kit."""

from __future__ import annotations  # so that help() shows the names of types

import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge import __version__
from lutforge.atomic_write import scratch_folder
from lutforge.child_processes import run_command
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutForgeError, SettingsError, ShotError
from lutforge.images.orientation import inverse, orientation_between, upright
from lutforge.images.read import Development, read_image
from lutforge.kits.install import JOURNAL, install, is_installed, targets_of, uninstall
from lutforge.kits.kit import Kit, KitFiles, Look, look_of, write_develop_script
from lutforge.kits.lumix import lumix_kit
from lutforge.kits.places import KEPT, Machine, place_of
from lutforge.kits.programs import KITS
from lutforge.luts.description import LICENCE
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.progress import Progress, silent
from lutforge.samples.extract import extract
from lutforge.samples.tiles import cell_size
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot

SCRIPT, MANIFEST = "develop.sh", "kit.json"


@dataclass(frozen=True)
class KitCheck:
    """How far a kit's program is from the camera's JPEG on one shot: ΔE00 (CIE 2000) of its flat tiles.

    tiles: how many were compared; p95: the 95th percentile; codes: the mean absolute difference of 8-bit values.
    calibrated: the profile was calibrated from this shot, which flatters it.
    """

    shot: str
    tiles: int
    mean: float
    p95: float
    maximum: float
    codes: float
    calibrated: bool = False


def write_kit(
    profile: CameraProfile | str | Path,
    to: str,
    folder: str | Path,
    program: str | None = None,
    *,
    base: str | None = None,
    look: CameraProfile | str | Path | None = None,
    progress: Progress = silent,
) -> Path:
    """Write a kit: camera profile or LUT, the preset that places it, a README, and develop.sh where it can be run.

    Args:
        profile: a profile, or the path of its file.
        to: STYLE/WB, or STYLE; "all" for every style.
        folder: a new or empty one, or an older kit, which is replaced.
        program: the program that shows the look, such as "darktable"; RawTherapee without one.
        base: for Lumix bodies, the style that the LUT lies on.
        look: with `base`, the profile whose style `to` is, where it is not the camera's own.
        progress: called with what is being done, and the share that is done.

    Returns:
        The folder.

    Raises:
        SettingsError: an option is unknown, does not go with another, or the profile is not what the program takes.
        LutForgeError: the folder holds other files, or nothing can be written there.
    """
    profile = as_profile(profile)
    name = one_of("kit", program or "rawtherapee", KITS)
    if (base is not None or look is not None) and name != "lumix":
        raise SettingsError(f"--base and --as go with --for lumix, not with {name}")
    if look is not None and base is None:
        raise SettingsError("--as goes with --base STYLE, the style of the camera that the LUT lies on")
    kit = KITS[name] if base is None else lumix_kit(profile, base)
    shown = profile if look is None else as_profile(look)
    looks = [look_of(shown, each) for each in (shown.styles if to.lower() == "all" else [to])]
    for each in looks:
        _require_source(kit, each)
    target = Path(folder).resolve()  # behind a link stays what it leads to
    if target.exists():  # an empty folder, or a kit and nothing but what its manifest lists, is replaced
        names = {path.name for path in target.iterdir()} if target.is_dir() else {target.name}
        if names and names != set(_names(_manifest(target), "files")):
            raise LutForgeError(f"{target}: holds other files; name a new folder for the kit")
    check_output(target / "README.md")
    with scratch_folder(beside=target) as scratch:
        filled = scratch / "kit"
        filled.mkdir()
        written = []
        for number, each in enumerate(looks):
            progress(each.title, number / len(looks))
            written.append(kit.write(each, filled))
        if kit.script is not None:
            write_develop_script(filled / SCRIPT, kit.script, looks[0].file_name)
        files = sorted(["README.md", MANIFEST, *(path.name for path in filled.iterdir())])
        (filled / "README.md").write_text(_readme(kit, looks, written, files), encoding="utf-8")
        manifest = {
            "lutforge": __version__, "program": kit.program, "camera": shown.camera, "files": files,
            "styles": [each.style for each in looks], "shots": list(shown.shots),
            "errors": {name: str(error) for each in written for name, error in each.errors.items()},
        }  # fmt: skip
        (filled / MANIFEST).write_text(json.dumps(manifest, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        if target.exists():
            target.replace(scratch / "old")
        filled.replace(target)
    return Path(folder)


def kit_errors(folder: str | Path) -> dict[str, str]:
    """The error of each file of a kit against the model, in words, by the file's name."""
    errors = _manifest(Path(folder)).get("errors", {})
    return dict(errors) if isinstance(errors, dict) else {}


@dataclass(frozen=True)
class Installation:
    """Where a kit's files went, or would go. found: the program is on this machine; use: what to do in it then."""

    program: str
    files: tuple[Path, ...]
    found: bool
    use: str


def install_kit(folder: str | Path, into: str | Path | None = None) -> Installation:
    """Put a kit where its program looks for it. into: the program's folder of settings, where it is not the usual one.

    Where the program is not on this machine, nothing is written, and the files are those that would be. Raises
    LutForgeError where a file is there already that LutForge did not write.
    """
    kit = Path(folder)
    manifest = _manifest(kit)
    program = str(manifest.get("program", ""))
    if program not in KITS:
        raise LutForgeError(f"{kit}: is no kit, or its {MANIFEST} is damaged: make it again")
    place = place_of(program, Machine(sys.platform, os.environ, Path.home()))
    if into is not None:
        if not Path(into).is_dir():
            raise LutForgeError(f"{into}: no such folder; --into names the folder where {program} keeps its settings")
        place = replace(place, settings=Path(into).resolve())
    targets = targets_of(program, kit, place, _data_folder() / "kits")
    found = place.use == KEPT or is_installed(place)
    if found and targets:
        install(program, targets, _data_folder() / JOURNAL)
    return Installation(KITS[program].title, tuple(targets), found and bool(targets), place.use)


def uninstall_kit(program: str) -> tuple[list[Path], list[Path]]:
    """Take a program's kits away again. Returns the files that were removed, and those changed since, which stay.

    Raises SettingsError on an unknown program, LutForgeError where nothing is installed for it.
    """
    return uninstall(one_of("kit", program, KITS), _data_folder() / JOURNAL)


def _data_folder() -> Path:
    """Where LutForge keeps what it has to remember of this user."""
    import platformdirs  # which does not load on every system, and is needed here alone

    return platformdirs.user_data_path("lutforge", appauthor=False)


def kits_of(profile: CameraProfile, to: str) -> list[str]:
    """The programs that a kit of a look can be for. Raises SettingsError on an unknown look."""
    look, programs = look_of(profile, to), []
    for name, kit in KITS.items():
        with suppress(SettingsError):
            _require_source(kit, look)
            programs.append(name)
    return programs


def check_kit(
    folder: str | Path, shots: Sequence[str | Path], progress: Progress = silent
) -> tuple[list[KitCheck], list[str]]:
    """Develop RAW files with a kit's own program, and compare them with the camera's JPEGs.

    Returns what was measured, and a note for each shot that could not be measured. Raises LutForgeError where the kit
    runs no program, ShotError where no shot could be measured.
    """
    script = Path(folder) / SCRIPT
    if not script.is_file():
        raise LutForgeError(f"{folder}: holds no {SCRIPT}: its program cannot be run from the command line")
    files, calibrated = discover(shots), set(_names(_manifest(Path(folder)), "shots"))
    checks: list[KitCheck] = []
    notes: list[str] = []
    for index, file in enumerate(files):
        progress(file.name, index / len(files))
        try:
            with scratch_folder() as scratch:
                output = scratch / "developed.tif"
                run_command([str(script.resolve()), str(file.resolve()), str(output)], script.name, file, output)
                check = compare_with_jpeg(file, output)
            checks.append(replace(check, calibrated=file.stem in calibrated))
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
    shot = read_shot(raw)
    sampled = extract(shot)
    samples = sampled.samples.select(np.arange(sampled.patches, sampled.kept))
    developed = read_shot(raw, Development(pixels, "srgb", picture.name), source=shot.jpeg_source)
    orientation = orientation_between(shot.jpeg, developed.jpeg)
    if orientation is None:
        raise ShotError(f"{raw}: {picture.name} matches another JPEG than the RAW does")
    if orientation != 1:
        as_the_sensor = upright(pixels, inverse(orientation))
        developed = read_shot(raw, Development(as_the_sensor, "srgb", picture.name), source=shot.jpeg_source)
    cell = cell_size(shot.registration)
    shown = developed.raw_cells(cell).mean[tuple(sampled.tile_cells.T)]
    inside = np.isfinite(shown).all(axis=1)
    if not inside.any():
        raise ShotError(f"{raw}: no flat tiles to compare")
    seen, wanted = np.clip(shown[inside], 0.0, 1.0), samples.srgb[inside]
    difference, codes = delta_e_2000(seen, wanted), 255 * float(np.abs(seen - wanted).mean())
    mean, p95, most = float(difference.mean()), float(np.quantile(difference, 0.95)), float(difference.max())
    return KitCheck(raw.name, len(difference), mean, p95, most, codes)


def _manifest(folder: Path) -> dict[str, object]:
    """What a folder's manifest holds by name; nothing of a folder without one."""
    data: object = None
    with suppress(OSError, ValueError):
        data = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return data if isinstance(data, dict) else {}


def _names(manifest: Mapping[str, object], key: str) -> list[str]:
    """A list of names in a manifest; empty where it has none."""
    values = manifest.get(key)
    return [str(value) for value in values] if isinstance(values, list) else []


def _readme(kit: Kit, looks: Sequence[Look], written: Sequence[KitFiles], files: Sequence[str]) -> str:
    """One page: what it is, what to do, what it was tried with."""
    look = looks[0]
    provenance = look.profile.provenance
    made = f"pictures that {provenance} developed" if isinstance(provenance, Pictures) else "RAW files"
    styles = ", ".join(each.style for each in looks)
    lines = [
        f"# {look.profile.camera}, {'styles' if len(looks) > 1 else 'style'} {styles}: for {kit.title}",
        "",
        f"The camera's own JPEG look, calibrated on pairs of {made} and the camera's JPEGs by LutForge.",
        "",
        *(f"{number}. {step}" for number, step in enumerate(written[0].steps, 1)),
        "",
    ]
    if len(looks) > 1:
        lines += [f"The files of the other styles are used alike: {', '.join(each.title for each in looks[1:])}.", ""]
    if SCRIPT in files:
        lines += ["On the command line: `./develop.sh RAW OUT.tif [LOOK]` (sRGB, 16 bit).", ""]
    errors = {name: error for each in written for name, error in each.errors.items()}
    if errors:
        lines += [
            "The files, read back, against the model (1 = full scale; black to beyond what the camera clips):",
            "",
        ]
        lines += [*(f"- {name}: {error}" for name, error in errors.items()), ""]
    lines += [f"Licence of the files: {LICENCE}.", ""]
    return "\n".join([*lines, f"Files: {', '.join(files)}. Tried with: {kit.tried}.", ""])


def _require_source(kit: Kit, look: Look) -> None:
    """Raise SettingsError, with the command that helps, where a profile's pairs are not what a kit can be made from."""
    if kit.source == "raw" and isinstance(look.profile.provenance, Pictures):
        raise SettingsError(
            f"a kit for {kit.title} needs a profile of RAW files; this one is of {look.profile.provenance}: "
            "lutforge calibrate SHOT… -o camera.npz"
        )
    if isinstance(look.profile.provenance, Pictures) and look.white_balance.lower() not in look.profile.white_balances:
        known = ", ".join(f"{look.style}/{name}" for name in look.profile.white_balances)
        raise SettingsError(
            f"the profile is of {look.profile.provenance}, whose white balance is in it already: instead of "
            f"{look.white_balance} name one of its own, {known}"
        )
