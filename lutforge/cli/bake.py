"""`lutforge bake`: a profile's transform → LUT files, each read back and measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge import __version__
from lutforge.atomic_write import require_writable
from lutforge.cli.console import note, progress_bar, say
from lutforge.errors import LutError, SettingsError

if TYPE_CHECKING:
    from lutforge.luts.sequence import Lut
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.model.transform import Transform

KINDS = ("render", "linearize", "refinish", "match")


def bake(
    profile: Annotated[Path, typer.Argument(help="The profile (.npz).", show_default=False)],
    kind: Annotated[str, typer.Argument(help="render, linearize, refinish or match.", show_default=False)],
    other: Annotated[Path | None, typer.Argument(help="For match: the profile whose look is wanted.")] = None,
    output: Annotated[
        list[Path] | None, typer.Option("-o", "--output", help="A LUT file; may repeat. The suffix picks the format.")
    ] = None,
    source: Annotated[str | None, typer.Option("--from", help="STYLE/WB of the JPEG that comes in.")] = None,
    target: Annotated[str | None, typer.Option("--to", help="STYLE/WB of the JPEG that comes out.")] = None,
    ev: Annotated[
        float, typer.Option(help="Exposure change in stops (refinish, match; render from scene-linear light).")
    ] = 0.0,
    space: Annotated[
        str,
        typer.Option(
            help="Scene-linear side of linearize and render: raw, or linear-srgb, acescg, aces2065-1 (render: values "
            "beyond 1 included)."
        ),
    ] = "raw",
    reader: Annotated[
        str | None,
        typer.Option("--for", help="The program that will read it: resolve, ffmpeg, …; without -o it names the files."),
    ] = None,
    size: Annotated[int | None, typer.Option(help="Nodes per axis of the cube.")] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Instead of a size: the ΔE00 that 99 % of colours keep within.")
    ] = None,
    interpolation: Annotated[
        str | None, typer.Option(help="trilinear or tetrahedral: how the reader interpolates.")
    ] = None,
    model: Annotated[str | None, typer.Option(help="lattice or rbf, where the profile holds both.")] = None,
    transfer: Annotated[
        list[Path] | None, typer.Option(help="For match: RAW to RAW, from `lutforge transfer`; may repeat, in steps.")
    ] = None,
    stages: Annotated[
        bool,
        typer.Option("--stages", help=".clf, .ctf: each step a cube of its own; lattices of a profile stay exact."),
    ] = False,
) -> None:
    """Bake RAW → JPEG (render), JPEG → scene (linearize), JPEG → JPEG (refinish), or camera → camera (match)."""
    from lutforge.interpolation import INTERPOLATIONS
    from lutforge.luts.bake import bake_forms
    from lutforge.luts.ends import ends_of
    from lutforge.luts.programs import program_named, target_of
    from lutforge.luts.steps import bake_steps
    from lutforge.model.profile_file import load_profile

    if interpolation is not None and interpolation not in INTERPOLATIONS:
        raise SettingsError(f'unknown interpolation "{interpolation}"; choose {" or ".join(INTERPOLATIONS)}')
    if reader is not None:
        interpolation = interpolation or program_named(reader).interpolation
    if stages and tolerance is not None:
        raise SettingsError("--stages goes with --size: steps that are exact alone need no tolerance")
    for path in output or []:
        require_writable(path)
    camera = load_profile(profile)
    partner = load_profile(other) if other is not None else None
    transform, title = choose_transform(
        camera, kind, partner, source, target, ev, space, model, transfer or (), neutral_highlights=not stages
    )
    outputs, ends = _outputs(output or [], reader, title, stages), ends_of(kind, space)
    scenes = kind == "render" and space != "raw"
    targets = [target_of(path, program, size, interpolation, scenes) for path, program in outputs.items()]
    comments = (f"LutForge {__version__}", *ends.comments, *_held_out(camera, kind, source, target))
    with progress_bar("baking") as report:
        if stages:
            steps = bake_steps(transform, size, interpolation=interpolation, title=title, comments=comments)
            luts = [steps] * len(targets)
        else:
            luts = bake_forms(
                transform,
                targets,
                tolerance=tolerance,
                display_referred=kind != "linearize",
                title=title,
                comments=comments,
                progress=report,
            )
    for path, lut in zip(outputs, luts, strict=True):
        _write(path, lut, transform, kind)
    if kind in ("render", "linearize"):
        note("; ".join(ends.comments))


def _outputs(named: list[Path], reader: str | None, title: str, stages: bool) -> "dict[Path, str | None]":
    """Files to write, each once, and the program of each; without names, those that suit the program."""
    from lutforge.luts.formats.clf import KINDS as PROCESS_LISTS
    from lutforge.luts.programs import files_for

    if not named and reader is None:
        raise LutError(
            "no output: name a file with -o, for example -o look.cube or -o look.clf; or a program with --for"
        )
    if not named and reader is not None:
        return files_for(reader, title)
    outputs: dict[Path, str | None] = {}
    for path in named:
        if path.resolve() in {known.resolve() for known in outputs}:
            note(f"{path}: named twice, written once")
            continue
        if stages and path.suffix.lower() not in PROCESS_LISTS:
            raise LutError(f"{path}: --stages writes {' and '.join(PROCESS_LISTS)}; other files hold one cube")
        outputs[path] = reader
    return outputs


def _write(path: Path, lut: "Lut", transform: "Transform", kind: str) -> None:
    from lutforge.luts.sequence import format_of
    from lutforge.luts.verify import verify

    error = verify(lut.write(path), transform, lut, display_referred=kind != "linearize")
    say(f"{path}: {lut.summary}, {lut.interpolation}")
    say(f"  read back, against the model: {error}")
    if kind == "linearize" and format_of(path).bits is not None:
        note(f"{path}: whole numbers hold linear light badly: the darks band, and values beyond 1 are lost; use .clf")


def choose_transform(
    camera: "CameraProfile",
    kind: str,
    partner: "CameraProfile | None",
    source: str | None,
    target: str | None,
    ev: float,
    space: str,
    model: str | None,
    transfers: Sequence[Path] = (),
    neutral_highlights: bool = True,
) -> tuple["Transform", str]:
    """The transform that the words ask for, and its title. Raises SettingsError where one is missing or unknown."""
    from lutforge.colour.scene_spaces import SCENE_SPACES
    from lutforge.model.camera_profile import MODELS, match
    from lutforge.model.raw_transfer import chained, load_transfer
    from lutforge.model.scene_render import through_camera

    if kind not in KINDS:
        raise SettingsError(f'unknown transform "{kind}"; choose {", ".join(KINDS)}')
    if model is not None and model not in MODELS:
        raise SettingsError(f'unknown model "{model}"; choose {" or ".join(MODELS)}')
    if space not in SCENE_SPACES:
        raise SettingsError(f'unknown space "{space}"; choose {", ".join(SCENE_SPACES)}')
    if (partner is not None) != (kind == "match"):
        raise SettingsError("match needs two profiles, A.npz match B.npz; the other transforms need one")
    if transfers and kind != "match":
        raise SettingsError("--transfer goes with match")
    if space != "raw" and kind in ("refinish", "match"):
        raise SettingsError(f"--space goes with linearize and render; a {kind} has JPEGs on both sides")
    if ev and (kind == "linearize" or (kind == "render" and space == "raw")):
        raise SettingsError(f"--ev goes with refinish and match; scale the RAW values to expose a {kind} anew")
    if kind == "render":
        wanted = _needed(target, "--to", kind, camera)
        if space != "raw":
            exposure = f", {ev:+g} EV" if ev else ""
            return through_camera(camera, wanted, space, ev, model), f"{camera.camera} {space} to {wanted}{exposure}"
        return camera.render(wanted, model), f"{camera.camera} RAW to {wanted}"
    given = _needed(source, "--from", kind, camera)
    if kind == "linearize":
        return camera.linearize(given, space, model), f"{camera.camera} {given} to {space}"
    end = partner or camera
    wanted = _needed(target, "--to", kind, end)
    exposure = f", {ev:+g} EV" if ev else ""
    name = f"{end.camera} {wanted}" if partner else wanted
    step = chained([load_transfer(path) for path in transfers]) if transfers else None
    return match(
        camera, given, end, wanted, ev, model, step, neutral_highlights
    ), f"{camera.camera} {given} to {name}{exposure}"


def _needed(selector: str | None, option: str, kind: str, profile: "CameraProfile") -> str:
    if selector is None:
        raise SettingsError(
            f"{kind} needs {option} STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
            f"and the white balances {', '.join(profile.white_balances)}"
        )
    chosen = profile.selector(selector)
    known = profile.white_balances.get(str(chosen.white_balance))
    if known is not None and known.spread > 0.02:
        r, g, b = known.multipliers
        note(
            f"{profile.camera} sets {chosen.white_balance} anew for each shot (by up to {known.spread:.0%}); this LUT "
            f"is for its median, {r:.3f},{g:g},{b:.3f}; name a shot's own multipliers for an exact one"
        )
    return selector


def _held_out(camera: "CameraProfile", kind: str, source: str | None, target: str | None) -> tuple[str, ...]:
    """The held-out errors of the styles that take part, for the file's comments."""
    lines = []
    for selector, direction in ((source, "linearize"), (target, "render")):
        used = selector is not None and direction in {"refinish": "linearize render"}.get(kind, kind)
        if used and selector is not None:
            style = camera.styles[camera.selector(selector).style]
            if f"{direction}_mean" in style.errors:
                lines.append(f"held-out {direction} error: mean {style.errors[f'{direction}_mean']:.4f}")
    return tuple(lines)
