"""Use case: profiles and settings → a transform."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import MODELS, CameraProfile, as_profile, is_response_alone, match, through_camera
from lutforge.model.raw_transfer import RawTransfer, chained, load_transfer
from lutforge.model.transform import Transform
from lutforge.pipeline.outputs import one_of

KINDS = ("render", "linearize", "refinish", "match")


@dataclass(frozen=True)
class TransformRequest:
    """The options of `transform`, beside the profile. Raises SettingsError where one does not go with the kind."""

    kind: str
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    space: str = "raw"
    model: str | None = None
    look: CameraProfile | Path | None = None
    transfers: Sequence[RawTransfer | Path] = ()

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
    transfers: Sequence[RawTransfer | str | Path] = (),
) -> Transform:
    """Return the transform of a profile that words ask for: a function of colours (…, 3), exact to the model.

    JPEG values are encoded, RAW and scenes linear, with 1 = full scale.

    Args:
        profile: a profile, or the path of its file.
        kind: "render" (RAW → JPEG), "linearize" (JPEG → scene), "refinish" (JPEG → JPEG) or "match" (camera → camera).
        source: STYLE/WB of the JPEG that comes in.
        target: STYLE/WB of the JPEG that comes out.
        ev: exposure change in stops.
        space: what render takes and linearize gives: "raw", or a colour space such as "acescg" or "vlog".
        model: "lattice" or "rbf", where the profile holds both.
        look: for match, the profile whose look is wanted.
        transfers: for match, transfers from RAW to RAW or their files, in steps.

    Returns:
        The transform; its `purpose` has a title, and notes on settings that stand for others.

    Raises:
        SettingsError: a setting is missing or unknown, or an option does not go with the kind.
        ProfileError: a profile or transfer cannot be read, or holds no such model.
    """
    steps = tuple(each if isinstance(each, RawTransfer) else Path(each) for each in transfers)
    beside = Path(look) if isinstance(look, str) else look
    wanted = TransformRequest(kind, source, target, ev, space, model, beside, steps)
    return choose_transform(as_profile(profile), wanted)


def choose_transform(camera: CameraProfile, wanted: TransformRequest) -> Transform:
    """Return the transform that the words ask for. Raises SettingsError where a setting is missing or unknown."""
    kind, space = one_of("transform", wanted.kind, KINDS), _space_named(wanted.space)
    model = None if wanted.model is None else one_of("model", wanted.model, MODELS)
    end = camera if wanted.look is None else as_profile(wanted.look)
    source = "" if kind == "render" else _needed(wanted.source, "--from", kind, camera)
    target = "" if kind == "linearize" else _needed(wanted.target, "--to", kind, end)
    if kind == "linearize":
        return camera.linearize(source, "linear-srgb" if space == "raw" and is_response_alone(camera) else space, model)
    if kind == "render":
        fed = camera.fed_to if space == "raw" else space
        return camera.render(target, model) if fed == "raw" else through_camera(camera, target, fed, wanted.ev, model)
    steps = [each if isinstance(each, RawTransfer) else load_transfer(each) for each in wanted.transfers]
    step = chained(steps) if steps else None
    return match(camera, source, end, target, wanted.ev, model, step)


def _space_named(word: str) -> str:
    """Return the word "raw", or the name of a colour space. Raises SettingsError, which lists them."""
    return "raw" if word.strip().lower() == "raw" else rgb_space(word).name


def _needed(selector: str | None, option: str, kind: str, profile: CameraProfile) -> str:
    if selector is None:
        raise SettingsError(
            f"{kind} needs {option} STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
            f"and the white balances {', '.join(profile.white_balances)}"
        )
    return selector
