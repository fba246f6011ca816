"""Use case: a profile and settings → a transform."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass
from pathlib import Path

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import MODELS, CameraProfile, as_profile, match, through_camera
from lutforge.model.provenance import ResponseOnly
from lutforge.model.raw_transfer import RawTransfer, load_transfer
from lutforge.model.transform import Transform
from lutforge.pipeline.outputs import one_of

KINDS = ("render", "linearize", "refinish", "match")


@dataclass(frozen=True)
class TransformRequest:
    """The options of `transform`. Raises SettingsError where one is not for the kind of transform.

    kind: one of KINDS; space: "raw", or the name of a colour space; both are given in upper or lower case, and stored
    in their standard spelling.
    """

    kind: str
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    space: str = "raw"
    model: str | None = None
    look: CameraProfile | Path | None = None
    transfer: RawTransfer | Path | None = None

    def __post_init__(self) -> None:
        kind = one_of("transform", self.kind, KINDS)
        is_raw = self.space.strip().lower() == "raw"
        space = "raw" if is_raw else rgb_space(self.space).name
        if (self.look is not None) != (kind == "match"):
            raise SettingsError("match needs two profiles, A.npz match B.npz; the other transforms need one")
        if self.transfer is not None and kind != "match":
            raise SettingsError("--transfer goes with match")
        if space != "raw" and kind in ("refinish", "match"):
            raise SettingsError(f"--space goes with linearize and render; a {kind} has JPEGs on both sides")
        if self.ev and (kind == "linearize" or (kind == "render" and space == "raw")):
            instead = "scale the scene" if kind == "linearize" else "name a scene with --space, or scale the RAW values"
            raise SettingsError(f"--ev does not go with a {kind}{' of camera RAW' * (kind == 'render')}: {instead}")
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "space", space)


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
    transfer: RawTransfer | str | Path | None = None,
) -> Transform:
    """Return a transform of a profile by its kind and settings: a function of colours (…, 3), exact to the model.

    JPEG values are encoded, RAW and scenes linear, with 1 = full scale.

    Args:
        profile: a profile, or the path of its file.
        kind: "render" (RAW → JPEG), "linearize" (JPEG → scene), "refinish" (JPEG → JPEG) or "match" (camera → camera).
        source: STYLE/WB of the input JPEG.
        target: STYLE/WB of the output JPEG.
        ev: exposure change in stops.
        space: the input of render, the output of linearize: "raw", or a colour space such as "acescg" or "vlog".
        model: "lattice", or "model" for the camera model itself, where the profile holds both.
        look: for match, the profile of the output's camera.
        transfer: for match, the transfer from RAW to RAW, or its file.

    Returns:
        The transform; its `purpose` has a title, and notes on settings that replace others.

    Raises:
        SettingsError: a setting is missing or unknown, or an option does not go with the kind.
        ProfileError: a profile or transfer cannot be read, or holds no such model.
    """
    look = Path(look) if isinstance(look, str) else look
    transfer = Path(transfer) if isinstance(transfer, str) else transfer
    request = TransformRequest(kind, source, target, ev, space, model, look, transfer)
    return choose_transform(as_profile(profile), request)


def choose_transform(camera: CameraProfile, request: TransformRequest) -> Transform:
    """Return the transform that a request names. Raises SettingsError where a setting is missing or unknown."""
    model = None if request.model is None else one_of("model", request.model, MODELS)
    look = camera if request.look is None else as_profile(request.look)
    _require_settings(request, camera, look)
    source = request.source or ""
    target = request.target or ""
    space = request.space

    if request.kind == "linearize":
        if space == "raw" and isinstance(camera.provenance, ResponseOnly):
            space = "linear-srgb"
        return camera.linearize(source, space, model)
    if request.kind == "render":
        scene = camera.fed_to if space == "raw" else space
        if scene == "raw":
            return camera.render(target, model)
        return through_camera(camera, target, scene, request.ev, model)
    transfer = load_transfer(request.transfer) if isinstance(request.transfer, Path) else request.transfer
    return match(camera, source, look, target, request.ev, model, transfer)


def _require_settings(request: TransformRequest, camera: CameraProfile, look: CameraProfile) -> None:
    """Raise SettingsError where a setting is missing. camera, look: the profiles of the input and the output JPEG."""
    settings = []
    if request.kind != "render":
        settings.append(("--from", request.source, camera))
    if request.kind != "linearize":
        settings.append(("--to", request.target, look))
    for option, selector, profile in settings:
        if selector is None:
            raise SettingsError(
                f"{request.kind} needs {option} STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
                f"and the white balances {', '.join(profile.white_balances)}"
            )
