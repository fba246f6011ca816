"""Use case: profiles and settings → a transform."""

from __future__ import annotations  # so that help() shows the names of types

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import MODELS, CameraProfile, as_profile, match, through_camera
from lutforge.model.raw_transfer import chained, load_transfer
from lutforge.model.response_profile import is_response_alone
from lutforge.model.transform import Transform
from lutforge.pipeline.outputs import one_of
from lutforge.settings import Multipliers

KINDS = ("render", "linearize", "refinish", "match")


@dataclass(frozen=True)
class TransformRequest:
    """The options that ask for a transform.

    kind: "render" (RAW → JPEG), "linearize" (JPEG → scene), "refinish" (JPEG → JPEG) or "match" (camera → camera).
    source, target: STYLE/WB of the JPEG that comes in, and of the one that comes out. ev: exposure change in stops.
    space: what render takes and linearize gives, "raw" or a name of `lutforge.colour.rgb_spaces`. model: "lattice" or
    "rbf", where the profile holds both. look: for match, the profile whose look is wanted; transfers: RAW → RAW to its
    camera, in steps. Raises SettingsError where an option does not go with the kind.
    """

    kind: str
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    space: str = "raw"
    model: str | None = None
    look: CameraProfile | Path | None = None
    transfers: Sequence[Path] = ()

    def __post_init__(self) -> None:
        kind, space = one_of("transform", self.kind, KINDS), _space_named(self.space)
        if (self.look is not None) != (kind == "match"):
            raise SettingsError("match needs two profiles, A.npz match B.npz; the other transforms need one")
        if self.transfers and kind != "match":
            raise SettingsError("--transfer goes with match")
        if space != "raw" and kind in ("refinish", "match"):
            raise SettingsError(f"--space goes with linearize and render; a {kind} has JPEGs on both sides")
        if self.ev and (kind == "linearize" or (kind == "render" and space == "raw")):
            instead = "scale the scene" if kind == "linearize" else "name a scene with --space, or scale the RAW values"
            raise SettingsError(f"--ev does not go with a {kind}{' of camera RAW' * (kind == 'render')}: {instead}")


@dataclass(frozen=True)
class DescribedTransform:
    """A transform with its description. title: what it is; notes: for the user; comments: its held-out errors."""

    transform: Transform
    kind: str
    space: str
    title: str
    notes: tuple[str, ...]
    comments: tuple[str, ...]


def transform(
    profile: CameraProfile | str | Path,
    kind: str,
    source: str | None = None,
    target: str | None = None,
    *,
    ev: float = 0.0,
    space: str = "raw",
    model: str | None = None,
    look: CameraProfile | str | Path | None = None,
    transfers: Sequence[str | Path] = (),
) -> Transform:
    """Return the transform of a profile that words ask for: a function of colours (…, 3), exact to the model.

    The options are those of `TransformRequest`; JPEG values are encoded, RAW and scenes linear, with 1 = full scale.
    Raises SettingsError where a setting is missing or unknown, or an option does not go with the kind.
    """
    beside = Path(look) if isinstance(look, str) else look
    wanted = TransformRequest(kind, source, target, ev, space, model, beside, tuple(map(Path, transfers)))
    return choose_transform(as_profile(profile), wanted).transform


def choose_transform(camera: CameraProfile, wanted: TransformRequest) -> DescribedTransform:
    """Return the transform that the words ask for. Raises SettingsError where a setting is missing or unknown."""
    kind, space = one_of("transform", wanted.kind, KINDS), _space_named(wanted.space)
    if space == "raw" and kind == "linearize" and is_response_alone(camera):
        space = "linear-srgb"
    if kind == "render" and space == "raw":
        space = _fed_to(camera)
    model = None if wanted.model is None else one_of("model", wanted.model, MODELS)
    exposure = f", {wanted.ev:+g} EV" if wanted.ev else ""
    end = camera if wanted.look is None else as_profile(wanted.look)
    notes: list[str] = []
    source = "" if kind == "render" else _needed(wanted.source, "--from", kind, camera, notes)
    target = "" if kind == "linearize" else _needed(wanted.target, "--to", kind, end, notes)
    made: Transform
    if kind == "linearize":
        made, title = camera.linearize(source, space, model), f"{camera.camera} {source} to {space}"
    elif kind == "render" and space == "raw":
        made, title = camera.render(target, model), f"{camera.camera} RAW to {target}"
    elif kind == "render":
        made = through_camera(camera, target, space, wanted.ev, model)
        title = f"{camera.camera} {space} to {target}{exposure}"
    else:
        step = chained([load_transfer(path) for path in wanted.transfers]) if wanted.transfers else None
        made = match(camera, source, end, target, wanted.ev, model, step)
        title = f"{camera.camera} {source} to {'' if end is camera else f'{end.camera} '}{target}{exposure}"
    errors = [
        f"held-out {direction} error: mean {figures[f'{direction}_mean']:.4f}"
        for profile, setting, direction in ((camera, source, "linearize"), (end, target, "render"))
        if setting and f"{direction}_mean" in (figures := profile.styles[profile.selector(setting).style].errors)
    ]
    return DescribedTransform(made, kind, space, title, tuple(notes), tuple(errors))


def _fed_to(camera: CameraProfile) -> str:
    """What a render of a profile takes: "raw", or the space in which pictures in the place of RAW were encoded."""
    pictures = re.fullmatch(r"pictures in (\S+)", camera.developer)
    return pictures[1] if pictures and not rgb_space(pictures[1]).is_linear else "raw"


def _space_named(word: str) -> str:
    """Return the word "raw", or the name of a colour space. Raises SettingsError, which lists them."""
    return "raw" if word.strip().lower() == "raw" else rgb_space(word).name


def _needed(selector: str | None, option: str, kind: str, profile: CameraProfile, notes: list[str]) -> str:
    """The selector, with a note where the camera sets its white balance anew for each shot."""
    if selector is None:
        raise SettingsError(
            f"{kind} needs {option} STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
            f"and the white balances {', '.join(profile.white_balances)}"
        )
    chosen = profile.selector(selector)
    known = profile.white_balances.get(str(chosen.white_balance))
    if profile.raw_space != "raw" and isinstance(chosen.white_balance, Multipliers):
        notes.append(
            f"the profile is of {profile.developer}, whose white balance is in it already: {chosen.white_balance} "
            "comes on top of that, and 1,1,1 changes nothing"
        )
    if known is not None and known.spread > 0.02:
        r, g, b = known.multipliers
        text = (
            f"{profile.camera} sets {chosen.white_balance} anew for each shot (by up to {known.spread:.0%}); this LUT "
            f"is for its middle one, {r:.3f},{g:g},{b:.3f}; name a shot's own multipliers for an exact one"
        )
        if text not in notes:
            notes.append(text)
    return selector
