"""Use case: a profile → a kit, the folder that makes one program show the camera's look."""

from __future__ import annotations  # so that help() shows the names of types

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from lutforge import __version__
from lutforge.atomic_write import scratch_folder
from lutforge.errors import LutForgeError, SettingsError
from lutforge.kits.all_kits import KITS
from lutforge.kits.kit import Kit, KitFiles, Look, look_of, write_develop_script
from lutforge.kits.lumix import base_style_kit
from lutforge.kits.manifest import MANIFEST, SCRIPT, kit_errors, names_in, read_manifest
from lutforge.luts.description import LICENCE
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.progress import Progress, silent


def kit_named(word: str) -> str:
    """The name of a kit, in upper or lower case. Raises SettingsError on any other word.

    The error names the kit that is for a program of that name, such as ffmpeg for mpv.
    """
    letters = re.sub(r"\W", "", word.lower())
    for name, kit in KITS.items():
        if letters != name and len(letters) > 2 and letters in re.sub(r"\W", "", kit.title.lower()):
            raise SettingsError(f'unknown kit "{word}"; did you mean {name}, for {kit.title}?')
    return one_of("kit", word, KITS)


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
    name = kit_named(program or "rawtherapee")
    if (base is not None or look is not None) and name != "lumix":
        raise SettingsError(f"--base and --as go with --for lumix, not with {name}")
    if look is not None and base is None:
        raise SettingsError("--as goes with --base STYLE, the style of the camera that the LUT lies on")
    kit = KITS[name] if base is None else base_style_kit(profile, base)
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


def kit_contents(folder: Path) -> tuple[str, ...]:
    """A line on the files of a kit, and one on the error of each that was read back."""
    files = ", ".join(sorted(path.name for path in folder.iterdir()))
    errors = kit_errors(folder).items()
    return (
        f"{files}; read README.md first",
        *(f"{name}: read back, against the model: {error}" for name, error in errors),
    )


def _require_replaceable(target: Path) -> None:
    """Raise LutForgeError where a folder holds other files than those that its manifest lists."""
    if not target.exists():
        return
    names = {path.name for path in target.iterdir()} if target.is_dir() else {target.name}
    if names and names != set(names_in(read_manifest(target), "files")):
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


def kits_of(profile: CameraProfile, to: str) -> list[str]:
    """The programs that a kit of a look can be for. Raises SettingsError on an unknown look."""
    look = look_of(profile, to)
    programs = []
    for name, kit in KITS.items():
        with suppress(SettingsError):
            _require_source(kit, look)
            programs.append(name)
    return programs


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
