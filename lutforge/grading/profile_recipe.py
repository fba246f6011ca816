"""Grade pictures with camera profiles, each by its own settings: to other settings, or to another camera's."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import ProfileError, SettingsError
from lutforge.grading.baked_grades import BakedGrades, SettingChange
from lutforge.grading.grade import Grade, Recipe
from lutforge.grading.image_colours import TELL_ADOBE_RGB
from lutforge.grading.picture_settings import AS_IT_IS, AS_SHOT, NAMED_BY_FILE, choose_camera, source_selector
from lutforge.images.write import IN_SRGB
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
"""What the camera wrote about a rendering that is no longer the picture's."""


@dataclass(frozen=True)
class RecipeOfProfiles(Recipe):
    """What recipes of camera profiles share.

    profiles: of one camera or of several; the camera that a picture names decides which applies. source: STYLE/WB of
    all pictures, by default what each one's metadata tell. target: STYLE/WB wanted; "as-shot" keeps a picture's own
    style or white balance. ev: exposure change in stops.
    """

    profiles: tuple[Path, ...]
    source: str | None = None
    target: str | None = None
    ev: float = 0.0

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, or the settings of all pictures, are wrong."""
        for camera in self.cameras.values():
            if self.stated.style != AS_SHOT and self.stated.white_balance not in NAMED_BY_FILE:
                camera.selector(self.stated)

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
    def stated(self) -> Selector:
        """The pictures' own settings, as the user states them."""
        return parse_selector(self.source) if self.source else AS_IT_IS

    @cached_property
    def goal(self) -> Selector:
        """The settings that pictures are graded to."""
        return parse_selector(self.target) if self.target else AS_IT_IS

    @cached_property
    def baked_grades(self) -> BakedGrades:
        """The LUTs of the grades, which pictures share."""
        return BakedGrades()


@dataclass(frozen=True)
class ProfileRecipe(RecipeOfProfiles):
    """Grade each picture from the settings that it was made with to other settings.

    look: the profile of the camera whose look is wanted. transfer: RAW → RAW from another camera to it.
    """

    look: Path | None = None
    transfer: Path | None = None

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, the transfer or the settings asked for are wrong."""
        super().check()
        for camera in [self._look] if self._look else self.cameras.values():
            style = self.goal.style if self.goal.style != AS_SHOT else next(iter(camera.styles))
            first = next(iter(camera.white_balances))
            camera.selector(Selector(style, self.goal.white_balance if self.shift is None else first))
        _ = self._transfer

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        if source.suffix.lower() in RAW_SUFFIXES:
            return self._developed(source, settings, camera)
        needed = self._look not in (None, camera) or self.shift != Shift()
        given, doubts = source_selector(source, settings, camera, self.stated, needed)
        change, grades = self.change(camera, given), self.baked_grades
        if change.is_none:  # it is copied, or saved in another format
            nothing = OCIO.Config.CreateRaw().getProcessor(OCIO.MatrixTransform())
            return Grade(
                nothing.getDefaultCPUProcessor(),
                change.history(str(given)),
                notes=("it was made with these settings: nothing to change",),
                unchanged=True,
                codes=of_codes(nothing),
            )
        lut = grades.refinish(change)
        return Grade(
            grades.processor(lut),
            change.history(str(given)),
            attributes=_attributes(change.look, change.target, given),
            notes=(*settings.notes, *notes, *doubts),
            lut=lut,
            codes=grades.processor(lut, codes=True),
            for_srgb=given.colour_space == "srgb",
        )

    def _developed(self, source: Path, settings: ShotMetadata, camera: CameraProfile) -> Grade:
        """The grade of a RAW file: rendered, with its own white balance or the one asked for."""
        if isinstance(camera.provenance, Pictures):
            raise SettingsError(
                f"{source}: the profile is of {camera.provenance}, not of RAW: develop it with `lutforge kit`"
            )
        stated = (settings.style, str(replace(StyleName.parse(settings.style), colour_space="srgb")))
        style = next((name for name in stated if name in camera.styles), next(iter(camera.styles)))
        stated_here = Selector(style, self.stated.white_balance)
        given, notes = source_selector(source, replace(settings, style=style), camera, stated_here)
        if self.goal.style == AS_SHOT and style not in stated:
            notes = (*notes, f'the file does not tell a style of this profile; "{style}" is used')
        change = self.change(camera, given)
        return Grade(
            self.baked_grades.develop(change),
            change.history("RAW"),
            attributes=_attributes(change.look, change.target),
            raw=True,
            vignettings=camera.vignettings,
            notes=notes,
        )

    @cached_property
    def shift(self) -> Shift | None:
        """The step from a picture's own white balance ("as-shot", "as-shot+500K"); None where another is wanted."""
        balance = str(self.goal.white_balance)
        name, shift = split_shift(balance) or (balance, Shift())
        return shift if name in NAMED_BY_FILE else None

    @cached_property
    def _look(self) -> CameraProfile | None:
        if self.look is None:
            return None
        look = load_profile(self.look)
        same = [path for path in self.profiles if path.resolve() == self.look.resolve()]
        return self.cameras[look.camera.lower()] if same else look

    @cached_property
    def _transfer(self) -> RawTransfer | None:
        if self.transfer is None:
            return None
        if self._look is None:
            raise SettingsError("--transfer goes with --as: it leads to the RAW of the camera whose look is wanted")
        transfer = load_transfer(self.transfer)
        if transfer.source.lower() not in self.cameras or transfer.target != self._look.camera:
            raise SettingsError(
                f"{self.transfer}: leads from {transfer.source} to {transfer.target}, not from "
                f"{', '.join(camera.camera for camera in self.cameras.values())} to {self._look.camera}"
            )
        return transfer

    def change(self, camera: CameraProfile, given: Selector) -> SettingChange:
        """What is changed of a picture with given settings.

        "as-shot" ones are those of the picture, for another camera those under which the same light is neutral.
        """
        look = self._look or camera
        transfer = self._transfer
        if look is camera or (transfer is not None and transfer.source != camera.camera):
            transfer = None
        style = given.style if self.goal.style == AS_SHOT else self.goal.style
        balance = given.white_balance
        if self.shift is None:
            balance = self.goal.white_balance
        elif look is not camera:
            light = same_light(camera, given, look)
            if light is not None:
                balance = light
            elif transfer is not None:
                neutral = transfer(1 / camera.multipliers(given))
                red, _, blue = (neutral[1] / neutral).tolist()
                balance = Multipliers((red, 1.0, blue))
            else:
                # Where the light is unknown to the other camera, any setting that it knows serves to stay neutral.
                balance = next(iter(look.white_balances))
        target = look.selector(Selector(style, balance))
        if self.shift not in (None, Shift()):
            target = Selector(style, look.shifted(look.multipliers(target), self.shift))
        return SettingChange(camera, given, look, target, self.ev, transfer)


def _attributes(look: CameraProfile, target: Selector, given: Selector | None = None) -> dict[str, object]:
    """EXIF tags of the new rendering, and the stale ones of the old as None. given: the settings of a picture."""
    light_source = 255  # EXIF's code of any other
    if isinstance(target.white_balance, str):
        light_source = LIGHT_SOURCES.get(target.white_balance, 0)
    software = software_tag(look.camera, str(target))
    space: Mapping[str, object] = {}
    if target.colour_space == "adobe rgb":
        space = TELL_ADOBE_RGB
    elif given is not None and given.colour_space == "adobe rgb":
        space = {"ICCProfile": None, "Exif:ColorSpace": IN_SRGB}
    return {
        **dict.fromkeys(STALE),
        "Software": software,
        "Exif:WhiteBalance": 1,
        "Exif:LightSource": light_source,
        **space,
    }
