"""A calibrated camera: its white balances, its matrix, and per picture style the models of its rendering."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from lutforge.arrays import Array
from lutforge.boundary import path_of
from lutforge.colour.rgb_spaces import from_linear_srgb, rgb_space
from lutforge.errors import ProfileError, SettingsError, alternatives
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.neutral_highlights import neutral_highlights as highlights_between
from lutforge.model.profile import CameraModel, ProfileData
from lutforge.model.profile_file import described, read_profile, write_profile
from lutforge.model.provenance import Pictures, ReferenceRaw
from lutforge.model.raw_transfer import RawTransfer
from lutforge.model.transform import (
    Clip,
    Decode,
    Encode,
    Gain,
    MatrixStage,
    Purpose,
    Stage,
    Transform,
    through_stages,
)
from lutforge.model.white_balance import resolve, shifted, temperature_of
from lutforge.settings import Kelvin, Multipliers, Selector, Shift, parse_selector, require_exposure, split_shift

ModelName = Literal["lattice", "model"]
MODELS: tuple[ModelName, ...] = get_args(ModelName)


@dataclass(frozen=True, eq=False)
class CameraProfile(ProfileData):
    """A calibrated camera, and the transforms that it offers."""

    def __repr__(self) -> str:
        styles, balances = ", ".join(sorted(self.styles)), ", ".join(sorted(self.white_balances))
        return f"CameraProfile({self.camera}: styles {styles}; white balances {balances})"

    def selector(self, text: str | Selector) -> Selector:
        """A selector whose style and white balance this profile knows. Raises SettingsError listing the known ones."""
        selector = text if isinstance(text, Selector) else parse_selector(text)
        if selector.style not in self.styles:
            known = alternatives(selector.style, sorted(self.styles))
            raise SettingsError(f'{self.camera}: unknown style "{selector.style}"; {known}')
        balance, known_balances = selector.white_balance, self.white_balances
        step = split_shift(balance) if isinstance(balance, str) and balance not in known_balances else None
        if step is not None and step[0] in known_balances:  # a known one with a step: "daylight+10", "auto+500K"
            return replace(selector, white_balance=self.shifted(known_balances[step[0]].factors, step[1]))
        try:
            resolve(balance, known_balances, self.matrix, self.from_xyz)
        except SettingsError as error:
            raise SettingsError(f"{self.camera}: {error}") from None
        return selector

    def notes_on(self, selector: Selector) -> list[str]:
        """What is to be known of a setting: that the camera sets it anew for each shot, or that it comes on top."""
        known = self.white_balances.get(str(selector.white_balance))
        if isinstance(self.provenance, Pictures) and isinstance(selector.white_balance, Multipliers):
            return [
                f"the profile is of {self.provenance}, whose white balance is in it already: {selector.white_balance} "
                "comes on top of that, and 1,1,1 changes nothing"
            ]
        if known is None or known.spread <= 0.02:
            return []
        r, g, b = known.multipliers
        return [
            f"{self.camera} sets {selector.white_balance} anew for each shot (by up to {known.spread:.0%}); this LUT "
            f"is for its middle one, {r:.3f},{g:g},{b:.3f}; name a shot's own multipliers for an exact one"
        ]

    def shifted(self, factors: Array, shift: Shift) -> Multipliers:
        """Tw (3,) moved by a step along or across the locus of natural light; its gain stays.

        Raises SettingsError where no natural light is so far off.
        """
        if isinstance(self.provenance, Pictures) and shift != Shift():
            raise SettingsError(f"{self.camera}: colour temperatures need RAW, and the profile is of {self.provenance}")
        r, g, b = (float(value) for value in shifted(factors, shift, self.white_balances, self.matrix, self.from_xyz))
        return Multipliers((r / g, 1.0, b / g), g)

    def multipliers(self, text: str | Selector) -> Array:
        """Tw (3,) that a selector asks for: white-balance multipliers times the gain of the setting."""
        return resolve(self.selector(text).white_balance, self.white_balances, self.matrix, self.from_xyz)

    def render(self, to: str | Selector, model: ModelName | None = None) -> Transform:
        """RAW before white balance, of the reference camera if there is one → the camera's JPEG, encoded [0, 1]."""
        stages = self._render(to, model).stages
        if isinstance(self.provenance, ReferenceRaw):
            stages = (MatrixStage(self.provenance.transfer), *stages)
        return Transform(stages, _purpose("render", f"{self.camera} RAW to {to}", target=(self, to)))

    def render_balanced(self, to: str | Selector, model: ModelName | None = None) -> Transform:
        """White-balanced RAW → the camera's JPEG, encoded [0, 1]: the same for all white balances of a style."""
        return self._render(to, model).without_gain()

    def _render(self, to: str | Selector, model: ModelName | None) -> Transform:
        selector = self.selector(to)
        gain, style, fitted = self.multipliers(selector), self.styles[selector.style], self._model(selector, model)
        if fitted is None:
            if style.render is None:
                raise ProfileError(f"{self.camera}: style {selector.style} holds no lattice for rendering")
            return Transform((Gain(gain), Clip(), style.render))
        forward, response = fitted.gamut_map, Encode(fitted.response)
        if not isinstance(self.provenance, ReferenceRaw):
            return Transform((Gain(gain), Clip(), MatrixStage(fitted.matrix), forward, response))

        # Another camera's RAW replaces this one's. Its sensor saturates at 1, but this camera may expose brighter.
        brightest = fitted.linearize(grid(uniform_levels(5))).max(axis=(0, 1, 2))
        reach = np.maximum(brightest, 1.0)
        within = MatrixStage(np.diag(1 / reach))
        return Transform((Gain(gain), within, Clip(), MatrixStage(fitted.matrix * reach), forward, response))

    def linearize(self, source: str | Selector, space: str = "raw", model: ModelName | None = None) -> Transform:
        """Take the camera's JPEG, encoded [0, 1], to RAW before white balance, or to linear values of an RGB space.

        space: "raw", or a name of `lutforge.colour.rgb_spaces`, scene-linear or encoded, such as "acescg" or "vlog".
        Raises SettingsError on an unknown space, and ProfileError where the camera's own RAW is asked for and another
        camera's replaced it.
        """
        if space == "raw" and isinstance(self.provenance, ReferenceRaw):
            raise ProfileError(
                f"{self.camera} has no RAW: this profile was calibrated through the RAW of {self.provenance.camera}; "
                "refinish works, or linearize to linear-srgb, acescg or aces2065-1"
            )
        stages = self._linearize(source, space, model).stages
        if space != "raw" and not rgb_space(space).is_linear:
            stages = (*stages, Encode(rgb_space(space)))
        title = f"{self.camera} {source} to {space}"
        return Transform(stages, _purpose("linearize", title, (self, source), space=space))

    def linearize_to_own_raw(self, source: str | Selector) -> Transform:
        """JPEG → the RAW, before white balance, that the camera has or would have: Tc of a reference camera's."""
        return self._linearize(source, "raw", None)

    def _linearize(self, source: str | Selector, space: str, model: ModelName | None) -> Transform:
        selector = self.selector(source)
        gain, style, fitted = self.multipliers(selector), self.styles[selector.style], self._model(selector, model)
        scene = np.diag(1 / gain) if space == "raw" else from_linear_srgb(space) @ self.matrix
        if fitted is None:
            if style.linearize is None:
                raise ProfileError(f"{self.camera}: style {selector.style} holds no lattice for linearizing")
            return Transform((Clip(), style.linearize, MatrixStage(scene)))
        scene = scene @ np.linalg.inv(fitted.matrix)
        return Transform((Clip(), Decode(fitted.response), fitted.inverse_gamut_map, MatrixStage(scene)))

    def refinish(
        self,
        source: str | Selector,
        target: str | Selector,
        ev: float = 0.0,
        model: ModelName | None = None,
        neutral_highlights: bool = True,
    ) -> Transform:
        """A finished JPEG → the JPEG that the camera would have made with other settings (6.1); ev in stops.

        neutral_highlights: white stays neutral; the bare model turns burnt-out white into a colour.
        """
        return match(self, source, self, target, ev, model=model, neutral_highlights=neutral_highlights)

    def raw_to_linear_srgb(self, selector: Selector) -> Array:
        """(3, 3): Ts Tw for a setting; of a reference camera's RAW Ts Tw Tc."""
        return (self.matrix * self.multipliers(selector)) @ self.from_reference

    @property
    def from_reference(self) -> Array:
        """Tc (3, 3) from the RAW of the reference camera; the identity where the camera has RAW."""
        return self.provenance.transfer if isinstance(self.provenance, ReferenceRaw) else np.eye(3)

    @property
    def raw_camera(self) -> str:
        """The camera whose RAW a render takes: the reference camera, else this one."""
        return self.provenance.camera if isinstance(self.provenance, ReferenceRaw) else self.camera

    def is_same_calibration(self, profile: CameraProfile) -> bool:
        """True of a profile of the same camera with the same models; what is noted of them may differ."""
        (first, arrays), (second, arrays_of_second) = described(self), described(profile)
        same = all(first[part] == second[part] for part in first if part not in ("shots", "options", "notes"))
        return same and all(np.array_equal(array, arrays_of_second[name]) for name, array in arrays.items())

    def save(self, path: str | Path) -> None:
        """Write the profile to a file (.npz), atomically; `lutforge.load_profile` reads it."""
        write_profile(path, self)

    def _model(self, selector: Selector, model: ModelName | None) -> CameraModel | None:
        """The camera model fitted for this white balance, else the style's first; None where a lattice takes part."""
        style = self.styles[selector.style]
        if model == "lattice" or (model is None and style.render is not None):
            return None
        if not style.models:
            raise ProfileError(f"{self.camera}: style {selector.style} holds no camera model; take its lattice")
        return next(
            (fitted for fitted in style.models if selector.white_balance in fitted.white_balances), style.models[0]
        )


def load_profile(path: str | Path) -> CameraProfile:
    """Read a profile.

    Args:
        path: of a file that `lutforge calibrate` or `profile.save` wrote (.npz).

    Returns:
        The profile.

    Raises:
        ProfileError: it is none, in one line.
    """
    return CameraProfile(**vars(read_profile(path_of(path, "a profile"))))


def as_profile(profile: CameraProfile | str | Path) -> CameraProfile:
    """Return a profile as it is, or the one of a file. Raises ProfileError."""
    if not isinstance(profile, CameraProfile | str | Path):
        raise ProfileError(f"{profile!r:.80} is not a profile: give a CameraProfile, or the path of its file")
    return profile if isinstance(profile, CameraProfile) else load_profile(profile)


def match(
    source_camera: CameraProfile,
    source: str | Selector,
    target_camera: CameraProfile,
    target: str | Selector,
    ev: float = 0.0,
    model: ModelName | None = None,
    transfer: RawTransfer | None = None,
    neutral_highlights: bool = True,
) -> Transform:
    """One camera's JPEG → the JPEG of another, or of itself under other settings (6.1, 6.3).

    neutral_highlights: as for `CameraProfile.refinish`.

    transfer: Tc, measured on common scenes. Without it Tc = (Ts_b Tw_b)⁻¹ Ts_a Tw_a, with both white balances those of
    the source's light (see `same_light`); where the target camera does not know it, it is its target white balance.
    Between profiles of one RAW, a camera's own or a common reference's, Tc is what takes both to that.
    Raises SettingsError on an exposure beyond ±20 stops, ProfileError on a transfer between other cameras.
    """
    words = (source, target)
    source, target = source_camera.selector(source), target_camera.selector(target)
    exposed = raw_to_balanced(source_camera, source, target_camera, target, ev, transfer)
    target_name = "" if target_camera is source_camera else f"{target_camera.camera} "
    title = f"{source_camera.camera} {words[0]} to {target_name}{words[1]}"
    kind = "match" if target_name else "refinish"
    purpose = _purpose(kind, title, (source_camera, words[0]), (target_camera, words[1]), ev=ev)
    if ev == 0 and source_camera is target_camera and source.style == target.style:
        by_white_balance = len(source_camera.styles[source.style].models) > 1  # one for each white balance
        multipliers = source_camera.multipliers(source), source_camera.multipliers(target)
        if source == target or (not by_white_balance and np.array_equal(*multipliers)):
            return Transform((), purpose)

    balanced = (*source_camera._linearize(source, "raw", model).stages, *exposed)
    render = target_camera.render_balanced(target, model)
    if not neutral_highlights:
        return Transform((*balanced, *render.stages), purpose)

    # White that is burnt out in the source's picture becomes grey in the output.
    to_balanced = through_stages(exposed, np.eye(3)).T
    back = MatrixStage(np.diag(source_camera.multipliers(source)) @ np.linalg.inv(to_balanced))
    shown = partial(through_stages, (back, *source_camera.render_balanced(source, model).stages))
    highlights = highlights_between(Transform(balanced), shown, render, 2.0**ev, target_camera.matrix, render.highest())
    return Transform((*balanced, highlights, *render.stages), purpose)


def _purpose(
    kind: str,
    title: str,
    source: tuple[CameraProfile, str | Selector] | None = None,
    target: tuple[CameraProfile, str | Selector] | None = None,
    space: str = "raw",
    ev: float = 0.0,
) -> Purpose:
    """What a transform is for: a note on each setting that stands for others, and the held-out errors of its ends."""
    notes: list[str] = []
    comments = []
    for direction, end in (("linearize", source), ("render", target)):
        if end is None:
            continue
        profile, selector = end[0], end[0].selector(end[1])
        notes += profile.notes_on(selector)
        errors = profile.styles[selector.style].errors
        if f"{direction}_mean" in errors:
            seen = errors.get(f"{direction}_de00_mean")
            shown = "" if seen is None else f", ΔE00 {seen:.2f}"
            comments.append(
                f"held-out {direction} error: mean {255 * errors[f'{direction}_mean']:.2f} codes of 255{shown}"
            )
    light = (source or target or (None,))[0]
    from_setting, to_setting = ("" if end is None else str(end[1]) for end in (source, target))
    raw = light.raw_space if light is not None and space == "raw" else space
    title += f", {ev:+g} EV" if ev else ""
    return Purpose(kind, title, space, raw, from_setting, to_setting, tuple(dict.fromkeys(notes)), tuple(comments))


def raw_to_balanced(
    source_camera: CameraProfile,
    source: Selector,
    target_camera: CameraProfile,
    target: Selector,
    ev: float = 0.0,
    transfer: RawTransfer | None = None,
) -> tuple[Stage, ...]:
    """The stages from one camera's RAW under `source` to white-balanced RAW of `target`, for any style of both.

    Arguments and errors are those of `match`.
    """
    require_exposure(ev)
    if transfer is not None and (transfer.source, transfer.target) != (source_camera.camera, target_camera.camera):
        raise ProfileError(
            f"the RAW transfer is from {transfer.source} to {transfer.target}, "
            f"the profiles are of {source_camera.camera} and {target_camera.camera}"
        )
    balance = Gain(2.0**ev * target_camera.multipliers(target))
    if source_camera is target_camera:
        return (balance,)
    light = same_light(source_camera, source, target_camera)
    if transfer is not None:
        under = None if light is None else target_camera.multipliers(Selector(target.style, light))
        return MatrixStage(transfer.under(source_camera.multipliers(source), under).matrix), balance
    if source_camera.raw_camera == target_camera.raw_camera:
        return MatrixStage(target_camera.from_reference @ np.linalg.inv(source_camera.from_reference)), balance
    light_of_target = target_camera.multipliers(Selector(target.style, light or target.white_balance))
    to_target = np.linalg.inv(target_camera.matrix * light_of_target)
    return MatrixStage(to_target @ (source_camera.matrix * source_camera.multipliers(source))), balance


def same_light(
    source_camera: CameraProfile, source: Selector, target_camera: CameraProfile
) -> str | Kelvin | Multipliers | None:
    """Return the target camera's white balance for the light that the source's setting is for.

    It is that of the same name, else of the same temperature and tint; None where the camera knows neither.
    """
    if isinstance(source.white_balance, str) and source.white_balance in target_camera.white_balances:
        return source.white_balance
    try:
        multipliers = source_camera.multipliers(source)
        source_matrix, target_matrix = source_camera.matrix, target_camera.matrix
        light = temperature_of(multipliers, source_camera.white_balances, source_matrix, source_camera.from_xyz)
        resolve(light, target_camera.white_balances, target_matrix, target_camera.from_xyz)
    except SettingsError:
        return None
    return light


def through_camera(
    profile: CameraProfile, to: str | Selector, space: str, ev: float = 0.0, model: ModelName | None = None
) -> Transform:
    """Take footage in a colour space to the camera's JPEG: y = render(M decode(x)), equation (4.1).

    space: a name of `lutforge.colour.rgb_spaces`, scene-linear (values beyond 1 and below 0 included) or encoded.
    Linear 1 in all channels saturates the camera at ev 0; ev: exposure in stops. Raises SettingsError on an exposure
    beyond ±20 stops, an unknown space, or a RAW space, which `CameraProfile.render` takes.
    """
    require_exposure(ev)
    if space == "raw":
        raise SettingsError("footage is in a colour space such as acescg or vlog, not raw")
    encoding = rgb_space(space)
    decode = () if encoding.is_linear else (Decode(encoding),)
    selector = profile.selector(to)
    from_raw = from_linear_srgb(space) @ profile.raw_to_linear_srgb(selector)
    stages = (*decode, MatrixStage(2.0**ev * np.linalg.inv(from_raw)), *profile.render(selector, model).stages)
    title = f"{profile.camera} {space} to {to}"
    return Transform(stages, _purpose("render", title, target=(profile, to), space=space, ev=ev))
