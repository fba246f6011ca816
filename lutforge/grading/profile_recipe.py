"""Grade pictures by camera profiles, each from its own settings to other settings, or to those of another camera."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import ProfileError, SettingsError
from lutforge.grading.baked_grades import BakedGrades, SettingChange
from lutforge.grading.grade import Grade, Recipe
from lutforge.grading.image_colours import ADOBE_RGB_METADATA
from lutforge.grading.picture_settings import AS_IT_IS, AS_SHOT, NAMED_BY_FILE, choose_camera, source_selector
from lutforge.images.output_spec import IN_SRGB
from lutforge.luts.ocio_transforms import of_codes
from lutforge.model.camera_profile import CameraProfile, load_profile, same_light
from lutforge.model.provenance import Pictures
from lutforge.model.raw_transfer import RawTransfer, load_transfer
from lutforge.model.white_balance import LIGHT_SOURCES
from lutforge.settings import Multipliers, Selector, Shift, StyleName, parse_selector, split_shift
from lutforge.shots.discover import RAW_SUFFIXES
from lutforge.shots.metadata import ShotMetadata, read_picture_settings, software_tag

STALE = (
    "Exif:MakerNote", "Exif:Saturation", "Exif:Contrast", "Exif:CustomRendered",
    "(Canon|Nikon|Olympus|Panasonic|Pentax|Fujifilm|Sony):.*",
)  # fmt: skip
"""Metadata on the camera's rendering, which a graded picture no longer has; names are regular expressions."""


@dataclass(frozen=True)
class RecipeFromProfiles(Recipe):
    """The common part of recipes with camera profiles.

    profiles: of one camera or several; the profile of the camera that a picture names applies to it. source: STYLE/WB
    of all pictures, by default that in the metadata of each. target: STYLE/WB of the graded pictures, "as-shot" for a
    picture's own style or white balance. ev: exposure change in stops.
    """

    profiles: tuple[Path, ...]
    source: str | None = None
    target: str | None = None
    ev: float = 0.0

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, or the settings of all pictures, are wrong."""
        for camera in self.cameras.values():
            if self.stated_setting.style != AS_SHOT and self.stated_setting.white_balance not in NAMED_BY_FILE:
                camera.selector(self.stated_setting)

    @cached_property
    def cameras(self) -> dict[str, CameraProfile]:
        """The profiles by camera, in lower case. Raises ProfileError where two are of one camera."""
        cameras: dict[str, CameraProfile] = {}
        for path in self.profiles:
            profile = load_profile(path)
            if cameras.setdefault(profile.camera.lower(), profile) is not profile:
                raise ProfileError(f"{path}: a second profile of {profile.camera}; give one profile per camera")
        return cameras

    @cached_property
    def stated_setting(self) -> Selector:
        """The pictures' own settings, as the user states them."""
        return parse_selector(self.source) if self.source else AS_IT_IS

    @cached_property
    def target_setting(self) -> Selector:
        """The settings that pictures are graded to."""
        return parse_selector(self.target) if self.target else AS_IT_IS

    @cached_property
    def baked_grades(self) -> BakedGrades:
        """The LUTs of the grades, shared by all pictures."""
        return BakedGrades()


@dataclass(frozen=True)
class ProfileRecipe(RecipeFromProfiles):
    """Grade each picture from the settings that it was made with to other settings.

    look: the profile of the camera whose look the pictures get. transfer: RAW → RAW from another camera to it.
    """

    look: Path | None = None
    transfer: Path | None = None

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, the transfer or the target settings are wrong."""
        super().check()
        for camera in [self.look_profile] if self.look_profile else self.cameras.values():
            style = self.target_setting.style if self.target_setting.style != AS_SHOT else next(iter(camera.styles))
            first = next(iter(camera.white_balances))
            camera.selector(Selector(style, self.target_setting.white_balance if self.shift is None else first))
        _ = self.raw_transfer

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        if source.suffix.lower() in RAW_SUFFIXES:
            return self._developed(source, settings, camera)
        needs_balance = self.look_profile not in (None, camera) or self.shift != Shift()
        made_with, setting_notes = source_selector(source, settings, camera, self.stated_setting, needs_balance)
        change = self.change(camera, made_with)
        if change.is_none:  # the picture is copied, or saved in another format
            identity = OCIO.Config.CreateRaw().getProcessor(OCIO.MatrixTransform())
            return Grade(
                processor=identity.getDefaultCPUProcessor(),
                history=change.history(str(made_with)),
                notes=("it was made with these settings: nothing to change",),
                unchanged=True,
                codes=of_codes(identity),
            )

        grades = self.baked_grades
        lut = grades.refinish(change)
        return Grade(
            processor=grades.processor(lut),
            history=change.history(str(made_with)),
            attributes=_attributes(change.look, change.target, made_with),
            notes=(*settings.notes, *notes, *setting_notes),
            lut=lut,
            codes=grades.processor(lut, codes=True),
            for_srgb=made_with.colour_space == "srgb",
        )

    def _developed(self, source: Path, settings: ShotMetadata, camera: CameraProfile) -> Grade:
        """The grade of a RAW file: its rendering, with its own white balance or that of the target."""
        if isinstance(camera.provenance, Pictures):
            raise SettingsError(
                f"{source}: the profile is of {camera.provenance}, not of RAW: develop it with `lutforge kit`"
            )
        names = (settings.style, str(replace(StyleName.parse(settings.style), colour_space="srgb")))
        style = next((name for name in names if name in camera.styles), next(iter(camera.styles)))
        stated = Selector(style, self.stated_setting.white_balance)
        made_with, notes = source_selector(source, replace(settings, style=style), camera, stated)
        if self.target_setting.style == AS_SHOT and style not in names:
            notes = (*notes, f'the file does not state a style of this profile; "{style}" is used')
        change = self.change(camera, made_with)
        return Grade(
            processor=self.baked_grades.develop(change),
            history=change.history("RAW"),
            attributes=_attributes(change.look, change.target),
            raw=True,
            vignettings=camera.vignettings,
            notes=notes,
        )

    @cached_property
    def shift(self) -> Shift | None:
        """The step from a picture's own white balance ("as-shot", "as-shot+500K"); None for another white balance."""
        balance = str(self.target_setting.white_balance)
        name, shift = split_shift(balance) or (balance, Shift())
        return shift if name in NAMED_BY_FILE else None

    @cached_property
    def look_profile(self) -> CameraProfile | None:
        """The profile of the camera whose look is wanted; None where each picture gets that of its own camera."""
        if self.look is None:
            return None
        look = load_profile(self.look)
        is_a_source = any(path.resolve() == self.look.resolve() for path in self.profiles)
        return self.cameras[look.camera.lower()] if is_a_source else look

    @cached_property
    def raw_transfer(self) -> RawTransfer | None:
        """The transfer to the RAW of that camera; None where none was measured. Raises SettingsError."""
        if self.transfer is None:
            return None
        if self.look_profile is None:
            raise SettingsError("--transfer goes with --as: it leads to the RAW of the camera whose look is wanted")
        transfer = load_transfer(self.transfer)
        if transfer.source.lower() not in self.cameras or transfer.target != self.look_profile.camera:
            raise SettingsError(
                f"{self.transfer}: leads from {transfer.source} to {transfer.target}, not from "
                f"{', '.join(camera.camera for camera in self.cameras.values())} to {self.look_profile.camera}"
            )
        return transfer

    def change(self, camera: CameraProfile, source: Selector) -> SettingChange:
        """The change of a picture that was made with the settings `source`.

        A target "as-shot" keeps the picture's white balance; for another camera it is the one under which the same
        illuminant is neutral.
        """
        look = self.look_profile or camera
        transfer = self.raw_transfer
        if look is camera or (transfer is not None and transfer.source != camera.camera):
            transfer = None

        style = source.style if self.target_setting.style == AS_SHOT else self.target_setting.style
        balance = source.white_balance
        if self.shift is None:
            balance = self.target_setting.white_balance
        elif look is not camera:
            same_illuminant = same_light(camera, source, look)
            if same_illuminant is not None:
                balance = same_illuminant
            elif transfer is not None:
                neutral = transfer(1 / camera.multipliers(source))
                red, _, blue = (neutral[1] / neutral).tolist()
                balance = Multipliers((red, 1.0, blue))
            else:
                # The illuminant is unknown to the other camera. Greys stay neutral under any of its white balances.
                balance = next(iter(look.white_balances))
        target = look.selector(Selector(style, balance))
        if self.shift not in (None, Shift()):
            target = Selector(style, look.shifted(look.multipliers(target), self.shift))
        return SettingChange(camera, source, look, target, self.ev, transfer)


def _attributes(look: CameraProfile, target: Selector, source: Selector | None = None) -> dict[str, object]:
    """EXIF tags of the new rendering, and None for stale ones. source: settings of a picture, None for a RAW file."""
    light_source = 255  # EXIF's code of a light source that has no other
    if isinstance(target.white_balance, str):
        light_source = LIGHT_SOURCES.get(target.white_balance, 0)
    software = software_tag(look.camera, str(target))
    space: Mapping[str, object] = {}
    if target.colour_space == "adobe rgb":
        space = ADOBE_RGB_METADATA
    elif source is not None and source.colour_space == "adobe rgb":
        space = {"ICCProfile": None, "Exif:ColorSpace": IN_SRGB}
    return {
        **dict.fromkeys(STALE),
        "Software": software,
        "Exif:WhiteBalance": 1,
        "Exif:LightSource": light_source,
        **space,
    }
