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
from lutforge.model.profile import CameraModel, PictureStyle, ProfileData
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
    PurposeKind,
    Stage,
    Transform,
    through_stages,
)
from lutforge.model.white_balance import WhiteBalanceModel
from lutforge.settings import Kelvin, Multipliers, Selector, Shift, parse_selector, require_exposure, split_shift

ModelName = Literal["lattice", "model"]
MODELS: tuple[ModelName, ...] = get_args(ModelName)


@dataclass(frozen=True, eq=False)
class CameraProfile(ProfileData):
    """A calibrated camera, and the transforms that it offers."""

    def __repr__(self) -> str:
        styles, balances = ", ".join(sorted(self.styles)), ", ".join(sorted(self.white_balances))
        return f"CameraProfile({self.camera}: styles {styles}; white balances {balances})"

    @property
    def white_balance_model(self) -> WhiteBalanceModel:
        """The white balances that the profile knows, and those of other lights by its matrices."""
        return WhiteBalanceModel(self.white_balances, self.matrix, self.from_xyz)

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
            self.white_balance_model.multipliers(balance)
        except SettingsError as error:
            raise SettingsError(f"{self.camera}: {error}") from None
        return selector

    def notes_on(self, selector: Selector) -> list[str]:
        """Notes on a setting that the camera sets anew for each shot, or that comes on top of another white balance."""
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
        r, g, b = (float(value) for value in self.white_balance_model.shifted(factors, shift))
        return Multipliers((r / g, 1.0, b / g), g)

    def multipliers(self, text: str | Selector) -> Array:
        """Tw (3,) that a selector asks for: white-balance multipliers times the gain of the setting."""
        return self.white_balance_model.multipliers(self.selector(text).white_balance)

    def render(self, to: str | Selector, model: ModelName | None = None) -> Transform:
        """RAW before white balance, of the reference camera if there is one → the camera's JPEG, encoded [0, 1]."""
        stages = self._render(to, model).stages
        if isinstance(self.provenance, ReferenceRaw):
            stages = (MatrixStage(self.provenance.transfer), *stages)
        return Transform(stages, _purpose(PurposeKind.RENDER, f"{self.camera} RAW to {to}", target=(self, to)))

    def render_balanced(self, to: str | Selector, model: ModelName | None = None) -> Transform:
        """White-balanced RAW → the camera's JPEG, encoded [0, 1]: the same for all white balances of a style."""
        return self._render(to, model).without_gain()

    def _render(self, to: str | Selector, model: ModelName | None) -> Transform:
        selector = self.selector(to)
        gain = self.multipliers(selector)
        if self._uses_lattice(selector, model):
            lattice = self.styles[selector.style].render
            if lattice is None:
                raise ProfileError(f"{self.camera}: style {selector.style} holds no lattice for rendering")
            return Transform((Gain(gain), Clip(), lattice))
        fitted = self._camera_model(selector)
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
        return Transform(stages, _purpose(PurposeKind.LINEARIZE, title, source=(self, source), space=space))

    def linearize_to_own_raw(self, source: str | Selector, model: ModelName | None = None) -> Transform:
        """JPEG → the RAW, before white balance, that the camera has or would have: Tc of a reference camera's."""
        return self._linearize(source, "raw", model)

    def _linearize(self, source: str | Selector, space: str, model: ModelName | None) -> Transform:
        selector = self.selector(source)
        gain = self.multipliers(selector)
        scene = np.diag(1 / gain) if space == "raw" else from_linear_srgb(space) @ self.matrix
        if self._uses_lattice(selector, model):
            lattice = self.styles[selector.style].linearize
            if lattice is None:
                raise ProfileError(f"{self.camera}: style {selector.style} holds no lattice for linearizing")
            return Transform((Clip(), lattice, MatrixStage(scene)))
        fitted = self._camera_model(selector)
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

    def _uses_lattice(self, selector: Selector, model: ModelName | None) -> bool:
        """True where a style is transformed by its lattices: as asked, or by default where it has one for rendering."""
        return model == "lattice" or (model is None and self.styles[selector.style].render is not None)

    def _camera_model(self, selector: Selector) -> CameraModel:
        """The camera model fitted for this white balance, else the style's first. Raises ProfileError without one."""
        models = self.styles[selector.style].models
        if not models:
            raise ProfileError(f"{self.camera}: style {selector.style} holds no camera model; take its lattice")
        return next((fitted for fitted in models if selector.white_balance in fitted.white_balances), models[0])


def load_profile(path: str | Path) -> CameraProfile:
    """Read a profile.

    Args:
        path: of a file that `lutforge calibrate` or `profile.save` wrote (.npz).

    Returns:
        The profile.

    Raises:
        ProfileError: the file is no profile; the message is one line.
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

    neutral_highlights: as for `CameraProfile.refinish`. transfer: Tc, measured on common scenes; without it Tc follows
    from the profiles, as in `raw_to_raw`.

    Raises SettingsError on an exposure beyond ±20 stops, ProfileError on a transfer between other cameras.
    """
    from_setting, to_setting = source_camera.selector(source), target_camera.selector(target)
    exposed = raw_to_balanced(source_camera, from_setting, target_camera, to_setting, ev, transfer)
    target_name = "" if target_camera is source_camera else f"{target_camera.camera} "
    title = f"{source_camera.camera} {source} to {target_name}{target}"
    kind = PurposeKind.MATCH if target_name else PurposeKind.REFINISH
    purpose = _purpose(kind, title, source=(source_camera, source), target=(target_camera, target), ev=ev)
    if ev == 0 and source_camera is target_camera and _are_equal(source_camera, from_setting, to_setting):
        return Transform((), purpose)

    balanced = (*source_camera.linearize_to_own_raw(from_setting, model).stages, *exposed)
    render = target_camera.render_balanced(to_setting, model)
    if not neutral_highlights:
        return Transform((*balanced, *render.stages), purpose)

    # White that is burnt out in the source's picture becomes grey in the output.
    linear = (MatrixStage(stage.at_white) if isinstance(stage, RawTransfer) else stage for stage in exposed)
    to_balanced = through_stages(tuple(linear), np.eye(3)).T
    back = MatrixStage(np.diag(source_camera.multipliers(from_setting)) @ np.linalg.inv(to_balanced))
    shown = partial(through_stages, (back, *source_camera.render_balanced(from_setting, model).stages))
    highlights = highlights_between(Transform(balanced), shown, render, 2.0**ev, target_camera.matrix, render.highest())
    return Transform((*balanced, highlights, *render.stages), purpose)


def _are_equal(profile: CameraProfile, first: Selector, second: Selector) -> bool:
    """True where two settings of a camera render every scene the same."""
    if first == second:
        return True
    if first.style != second.style or len(profile.styles[first.style].models) > 1:  # a model for each white balance
        return False
    return np.array_equal(profile.multipliers(first), profile.multipliers(second))


def _purpose(
    kind: PurposeKind,
    title: str,
    source: tuple[CameraProfile, str | Selector] | None = None,
    target: tuple[CameraProfile, str | Selector] | None = None,
    space: str = "raw",
    ev: float = 0.0,
) -> Purpose:
    """The purpose of a transform: with notes on settings that stand for others, and the held-out errors of its styles.

    source, target: the profile and the setting of the JPEG that comes in, and of the one that comes out.
    """
    notes: list[str] = []
    comments: list[str] = []
    for direction, jpeg in (("linearize", source), ("render", target)):
        if jpeg is not None:
            profile, setting = jpeg
            selector = profile.selector(setting)
            notes += profile.notes_on(selector)
            comments += _held_out_errors(profile.styles[selector.style], direction)

    raw = space
    if space == "raw":
        profile_of_raw = next(jpeg[0] for jpeg in (source, target) if jpeg is not None)
        raw = profile_of_raw.raw_space
    from_setting, to_setting = ("" if jpeg is None else str(jpeg[1]) for jpeg in (source, target))
    title += f", {ev:+g} EV" if ev else ""
    return Purpose(
        kind=kind,
        title=title,
        space=space,
        light=raw,
        source=from_setting,
        target=to_setting,
        notes=tuple(dict.fromkeys(notes)),
        comments=tuple(comments),
    )


def _held_out_errors(style: PictureStyle, direction: str) -> list[str]:
    """The held-out error of a style as a comment; none where it was not measured."""
    mean = style.errors.get(f"{direction}_mean")
    if mean is None:
        return []
    de00 = style.errors.get(f"{direction}_de00_mean")
    in_de00 = "" if de00 is None else f", ΔE00 {de00:.2f}"
    return [f"held-out {direction} error: mean {255 * mean:.2f} codes of 255{in_de00}"]


def raw_to_balanced(
    source_camera: CameraProfile,
    source: Selector,
    target_camera: CameraProfile,
    target: Selector,
    ev: float = 0.0,
    transfer: RawTransfer | None = None,
) -> tuple[Stage, ...]:
    """The stages from one camera's RAW under `source` to white-balanced RAW of `target`; styles do not count.

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
    if transfer is not None:
        light = same_light(source_camera, source, target_camera)
        under = None if light is None else target_camera.multipliers(Selector(target.style, light))
        return transfer.under(source_camera.multipliers(source), under), balance
    return MatrixStage(raw_to_raw(source_camera, source, target_camera, target)), balance


def raw_to_raw(source_camera: CameraProfile, source: Selector, target_camera: CameraProfile, target: Selector) -> Array:
    """Tc (3, 3), from one camera's RAW to another's, both before white balance, where it was not measured.

    Between profiles of one RAW, a camera's own or a common reference's, Tc is what takes both to that. Else
    Tc = (Ts_b Tw_b)⁻¹ Ts_a Tw_a, with both white balances those of the source's light (see `same_light`); where the
    target camera does not know that light, its target white balance is taken.
    """
    if source_camera.raw_camera == target_camera.raw_camera:
        return target_camera.from_reference @ np.linalg.inv(source_camera.from_reference)
    light = same_light(source_camera, source, target_camera)
    light_of_target = target_camera.multipliers(Selector(target.style, light or target.white_balance))
    to_target = np.linalg.inv(target_camera.matrix * light_of_target)
    return np.asarray(to_target @ (source_camera.matrix * source_camera.multipliers(source)))


def same_light(
    source_camera: CameraProfile, source: Selector, target_camera: CameraProfile
) -> str | Kelvin | Multipliers | None:
    """Return the target camera's white balance for the light that the source's setting is for.

    It is that of the same name, else of the same temperature and tint; None where the camera knows neither.
    """
    if isinstance(source.white_balance, str) and source.white_balance in target_camera.white_balances:
        return source.white_balance
    try:
        light = source_camera.white_balance_model.temperature_of(source_camera.multipliers(source))
        target_camera.white_balance_model.multipliers(light)
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
    return Transform(stages, _purpose(PurposeKind.RENDER, title, target=(profile, to), space=space, ev=ev))
