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
from lutforge.images.developed import Development
from lutforge.images.orientation import inverse, orientation_between, upright
from lutforge.images.read import read_image
from lutforge.kits.all_kits import KITS
from lutforge.kits.install import INSTALLED_KITS, install, is_installed, targets_of, uninstall
from lutforge.kits.kit import Kit, KitFiles, Look, look_of, write_develop_script
from lutforge.kits.lumix import lumix_kit
from lutforge.kits.places import KEPT, Machine, place_of
from lutforge.luts.description import LICENCE
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.progress import Progress, silent
from lutforge.samples.extract import extract
from lutforge.samples.tiles import cell_size
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot

SCRIPT = "develop.sh"
MANIFEST = "kit.json"


@dataclass(frozen=True)
class KitCheck:
    """The difference between a kit's program and the camera's JPEG on one shot: ΔE00 (CIE 2000) of its flat tiles.

    tiles: their number; p95: the 95th percentile; codes: the mean absolute difference of 8-bit values. calibrated: the
    profile was calibrated from this shot, so that the difference is smaller than on others.
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
    """Write a kit: camera profile or LUT, a preset that applies it, a README, and develop.sh where it can be run.

    Args:
        profile: a profile, or the path of its file.
        to: STYLE/WB, or STYLE; "all" for every style.
        folder: a new or empty one, or an older kit, which is replaced.
        program: the program that shows the look, such as "darktable"; by default RawTherapee.
        base: for Lumix bodies, the style after which the body applies the LUT.
        look: with `base`, the profile of the look `to`, where it is another camera's.
        progress: called with the name of the present step, and the share that is done.

    Returns:
        The folder.

    Raises:
        SettingsError: an option is unknown or excludes another, or the program needs another kind of profile.
        LutForgeError: the folder holds other files, or nothing can be written there.
    """
    profile = as_profile(profile)
    name = one_of("kit", program or "rawtherapee", KITS)
    if (base is not None or look is not None) and name != "lumix":
        raise SettingsError(f"--base and --as go with --for lumix, not with {name}")
    if look is not None and base is None:
        raise SettingsError("--as goes with --base STYLE, the style of the camera that the LUT lies on")
    kit = KITS[name] if base is None else lumix_kit(profile, base)
    look_profile = profile if look is None else as_profile(look)
    looks = [look_of(look_profile, setting) for setting in (look_profile.styles if to.lower() == "all" else [to])]
    for chosen in looks:
        _require_source(kit, chosen)

    target = Path(folder).resolve()  # a link to a folder stays a link
    _require_replaceable(target)
    check_output(target / "README.md")
    with scratch_folder(next_to=target) as scratch:
        new = scratch / "kit"
        new.mkdir()
        _fill(new, kit, looks, progress)
        if target.exists():
            target.replace(scratch / "old")
        new.replace(target)
    return Path(folder)


def _require_replaceable(target: Path) -> None:
    """Raise LutForgeError where a folder holds other files than those that its manifest lists."""
    if not target.exists():
        return
    names = {path.name for path in target.iterdir()} if target.is_dir() else {target.name}
    if names and names != set(_names(_manifest(target), "files")):
        raise LutForgeError(f"{target}: holds other files; name a new folder for the kit")


def _fill(folder: Path, kit: Kit, looks: Sequence[Look], progress: Progress) -> None:
    """Write the files of a kit to an empty folder: those of each look, the script, the README and the manifest."""
    written = []
    for number, look in enumerate(looks):
        progress(look.title, number / len(looks))
        written.append(kit.write(look, folder))
    if kit.script is not None:
        write_develop_script(folder / SCRIPT, kit.script, looks[0].file_name)
    files = sorted(["README.md", MANIFEST, *(path.name for path in folder.iterdir())])
    (folder / "README.md").write_text(_readme(kit, looks, written, files), encoding="utf-8")

    profile = looks[0].profile
    manifest = {
        "lutforge": __version__, "program": kit.program, "camera": profile.camera, "files": files,
        "styles": [look.style for look in looks], "shots": list(profile.shots),
        "errors": {name: str(error) for kit_files in written for name, error in kit_files.errors.items()},
    }  # fmt: skip
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def kit_errors(folder: str | Path) -> dict[str, str]:
    """The error of each file of a kit against the model, in words, by the file's name."""
    errors = _manifest(Path(folder)).get("errors", {})
    return dict(errors) if isinstance(errors, dict) else {}


@dataclass(frozen=True)
class Installation:
    """The installation of a kit. files: where they are, or would be; use: what the user does in the program.

    found: the program is on this machine, so that the files were installed.
    """

    program: str
    files: tuple[Path, ...]
    found: bool
    use: str


def install_kit(folder: str | Path, into: str | Path | None = None) -> Installation:
    """Copy a kit to where its program looks for it. into: the program's folder of settings, if not the default.

    Where the program is not on this machine, nothing is written, and the result has the paths that would be. Raises
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
    is_found = place.use == KEPT or is_installed(place)
    if is_found and targets:
        install(program, targets, _data_folder() / INSTALLED_KITS)
    return Installation(KITS[program].title, tuple(targets), is_found and bool(targets), place.use)


def uninstall_kit(program: str) -> tuple[list[Path], list[Path]]:
    """Remove a program's kits. Returns the files that were removed, and those that the user changed, which stay.

    Raises SettingsError on an unknown program, LutForgeError where nothing is installed for it.
    """
    return uninstall(one_of("kit", program, KITS), _data_folder() / INSTALLED_KITS)


def _data_folder() -> Path:
    """The folder where LutForge keeps files of this user."""
    import platformdirs  # imported here: only installations need it

    return platformdirs.user_data_path("lutforge", appauthor=False)


def kits_of(profile: CameraProfile, to: str) -> list[str]:
    """The programs that a kit of a look can be for. Raises SettingsError on an unknown look."""
    look = look_of(profile, to)
    programs = []
    for name, kit in KITS.items():
        with suppress(SettingsError):
            _require_source(kit, look)
            programs.append(name)
    return programs


def check_kit(
    folder: str | Path, shots: Sequence[str | Path], progress: Progress = silent
) -> tuple[list[KitCheck], list[str]]:
    """Develop RAW files with a kit's program, and compare them with the camera's JPEGs.

    Returns the differences, and a note for each shot that could not be measured. Raises LutForgeError where the kit has
    no script, ShotError where no shot could be measured.
    """
    script = Path(folder) / SCRIPT
    if not script.is_file():
        raise LutForgeError(f"{folder}: holds no {SCRIPT}: its program cannot be run from the command line")
    files = discover(shots)
    calibrated = set(_names(_manifest(Path(folder)), "shots"))
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
    """Compare a picture that a program developed from a RAW file, encoded sRGB, with the camera's JPEG of the shot.

    The tiles are chosen from the RAW and the JPEG only, so that a tile which the program clips counts; a tile that is
    outside its picture does not. Raises ImageError where a file cannot be read, ShotError where pictures do not match.
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
        sensor_oriented = upright(pixels, inverse(orientation))
        developed = read_shot(raw, Development(sensor_oriented, "srgb", picture.name), source=shot.jpeg_source)

    cell = cell_size(shot.registration)
    means = developed.raw_cells(cell).mean[tuple(sampled.tile_cells.T)]
    inside = np.isfinite(means).all(axis=1)
    if not inside.any():
        raise ShotError(f"{raw}: no flat tiles to compare")
    by_program = np.clip(means[inside], 0.0, 1.0)
    by_camera = samples.srgb[inside]
    difference = delta_e_2000(by_program, by_camera)
    return KitCheck(
        shot=raw.name,
        tiles=len(difference),
        mean=float(difference.mean()),
        p95=float(np.quantile(difference, 0.95)),
        maximum=float(difference.max()),
        codes=255 * float(np.abs(by_program - by_camera).mean()),
    )


def _manifest(folder: Path) -> dict[str, object]:
    """A kit's manifest; empty for a folder without one."""
    data: object = None
    with suppress(OSError, ValueError):
        data = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return data if isinstance(data, dict) else {}


def _names(manifest: Mapping[str, object], key: str) -> list[str]:
    """A list of names in a manifest; empty where it has none."""
    values = manifest.get(key)
    return [str(value) for value in values] if isinstance(values, list) else []


def _readme(kit: Kit, looks: Sequence[Look], written: Sequence[KitFiles], files: Sequence[str]) -> str:
    """The README of a kit, one page: what it is, what to do, what it was tried with."""
    look = looks[0]
    provenance = look.profile.provenance
    sources = f"pictures that {provenance} developed" if isinstance(provenance, Pictures) else "RAW files"
    styles = ", ".join(shown.style for shown in looks)
    lines = [
        f"# {look.profile.camera}, {'styles' if len(looks) > 1 else 'style'} {styles}: for {kit.title}",
        "",
        f"The camera's own JPEG look, calibrated on pairs of {sources} and the camera's JPEGs by LutForge.",
        "",
        *(f"{number}. {step}" for number, step in enumerate(written[0].steps, 1)),
        "",
    ]
    if len(looks) > 1:
        titles = ", ".join(more.title for more in looks[1:])
        lines += [f"The files of the other styles are used alike: {titles}.", ""]
    if SCRIPT in files:
        lines += ["On the command line: `./develop.sh RAW OUT.tif [LOOK]` (sRGB, 16 bit).", ""]
    errors = {name: error for kit_files in written for name, error in kit_files.errors.items()}
    if errors:
        lines += [
            "The files, read back, against the model (1 = full scale; black to beyond what the camera clips):",
            "",
        ]
        lines += [*(f"- {name}: {error}" for name, error in errors.items()), ""]
    lines += [f"Licence of the files: {LICENCE}.", ""]
    return "\n".join([*lines, f"Files: {', '.join(files)}. Tried with: {kit.tried}.", ""])


def _require_source(kit: Kit, look: Look) -> None:
    """Raise SettingsError, with advice, where a kit cannot be made from a look's kind of profile."""
    if kit.source == "raw" and isinstance(look.profile.provenance, Pictures):
        raise SettingsError(
            f"a kit for {kit.title} needs a profile of RAW files; this one is of {look.profile.provenance}: "
            "lutforge calibrate SHOT… -o camera.npz"
        )
    if isinstance(look.profile.provenance, Pictures) and look.white_balance.lower() not in look.profile.white_balances:
        settings = ", ".join(f"{look.style}/{name}" for name in look.profile.white_balances)
        raise SettingsError(
            f"the profile is of {look.profile.provenance}, whose white balance is in it already: instead of "
            f"{look.white_balance} name one of its own, {settings}"
        )
