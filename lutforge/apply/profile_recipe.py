"""Refinish pictures with camera profiles, each from its own settings to others, or to another camera's."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from lutforge.apply.baked_grades import BakedGrades
from lutforge.apply.colours import TELL_ADOBE_RGB
from lutforge.apply.grade import Grade, Rebuilt, fingerprint, unchanged
from lutforge.apply.setting_change import SettingChange
from lutforge.apply.source_settings import AS_SHOT, NAMED_BY_FILE, choose_camera, source_selector
from lutforge.arrays import Array
from lutforge.errors import ProfileError, SettingsError
from lutforge.images.write import IN_SRGB
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile, load_profile, same_light
from lutforge.model.raw_transfer import RawTransfer, chained, load_transfer
from lutforge.model.white_balance import LIGHT_SOURCES
from lutforge.settings import Multipliers, Selector, Shift, parse_selector, split_shift
from lutforge.shots.discover import RAW_SUFFIXES
from lutforge.shots.maker_settings import ADOBE_RGB
from lutforge.shots.picture_settings import PictureSettings, read_picture_settings, software_tag

STALE = (
    "Exif:MakerNote", "Exif:Saturation", "Exif:Contrast", "Exif:CustomRendered",
    "(Canon|Nikon|Olympus|Panasonic|Pentax|Fujifilm|Sony):.*",
)  # fmt: skip
"""What the camera wrote about a rendering that is no longer the picture's."""


@dataclass(frozen=True)
class ProfileRecipe(Rebuilt):
    """Grade each picture from the settings that it was made with to other settings.

    profiles: of one camera or of several; the camera that a picture names decides which applies. source: STYLE/WB of
    all pictures, by default what each one's metadata tell. target: STYLE/WB wanted; "as-shot" keeps a picture's own
    style or white balance. ev: exposure change in stops. look: the profile of the camera whose look is wanted.
    transfers: RAW → RAW from other cameras to that one, in steps where they go through a third.
    """

    profiles: tuple[Path, ...]
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    look: Path | None = None
    transfers: tuple[Path, ...] = ()

    @cached_property
    def key(self) -> str:
        """Identify the profiles and settings by their contents."""
        files = (*self.profiles, *((self.look,) if self.look else ()), *self.transfers)
        return fingerprint("profile", *files, self.source, self.target, self.ev)

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, the transfers or the settings asked for are wrong."""
        cameras = self.cameras
        asked = parse_selector(self.source) if self.source else None
        for camera in cameras.values():
            if asked is not None and asked.style != AS_SHOT and asked.white_balance not in NAMED_BY_FILE:
                camera.selector(asked)
        target = self._target
        for camera in [self._look] if self._look else cameras.values():
            style = target.style if target.style != AS_SHOT else next(iter(camera.styles))
            own = _own_shift(target) is not None
            camera.selector(Selector(style, next(iter(camera.white_balances)) if own else target.white_balance))
        _ = self._transfers

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        if source.suffix.lower() in RAW_SUFFIXES:
            return self._developed(source, settings, camera)
        other = self._look not in (None, camera)
        needed = other or not self.keeps_white_balance or _own_shift(self._target) not in (None, Shift())
        given, doubts = source_selector(source, settings, camera, self.source, needed)
        change = self.change(camera, given)
        if change.is_none:
            return unchanged(change.history(str(given)))
        chain = self.chain(change)
        return Grade(
            self._baked_grades.processor(chain),
            change.history(str(given)),
            attributes=_attributes(change.look, change.wanted, given),
            confidence=self._baked_grades.confidence(change),
            notes=(*settings.notes, *notes, *doubts),
            lut=chain,
            codes=self._baked_grades.codes(chain),
            for_srgb=not given.style.endswith(ADOBE_RGB),
        )

    @property
    def keeps_white_balance(self) -> bool:
        """True where pictures keep the white balance that they were shot with."""
        return _own_shift(self._target) is not None

    def chain(self, change: SettingChange) -> Lut:
        """The refinish as LUTs, the same for all pictures with the same settings."""
        return self._baked_grades.refinish(change)

    def _developed(self, source: Path, settings: PictureSettings, camera: CameraProfile) -> Grade:
        """The grade of a RAW file: rendered, with its own white balance or the one asked for."""
        if camera.developer:
            raise SettingsError(
                f"{source}: the profile is of {camera.developer}, not of RAW: develop it with `lutforge kit`"
            )
        told = (settings.style, settings.style.removesuffix(f" {ADOBE_RGB}"))
        style = next((name for name in told if name in camera.styles), next(iter(camera.styles)))
        asked = parse_selector(self.source) if self.source else Selector(AS_SHOT, AS_SHOT)
        text = str(Selector(style, asked.white_balance)) if self.source else None
        given, notes = source_selector(source, replace(settings, style=style), camera, text)
        if self._target.style == AS_SHOT and style not in told:
            notes = (*notes, f'the file does not tell a style of this profile; "{style}" is used')
        change = self.change(camera, given)
        return Grade(
            self._baked_grades.develop(change),
            change.history("RAW"),
            attributes=_attributes(change.look, change.wanted),
            raw=True,
            falloffs=camera.falloffs,
            notes=notes,
        )

    @cached_property
    def cameras(self) -> dict[str, CameraProfile]:
        """The profiles by camera, in lower case."""
        return cameras_of(self.profiles)

    @cached_property
    def _look(self) -> CameraProfile | None:
        if self.look is None:
            return None
        look = load_profile(self.look)
        same = [path for path in self.profiles if path.resolve() == self.look.resolve()]
        return self.cameras[look.camera.lower()] if same else look

    @cached_property
    def _target(self) -> Selector:
        return parse_selector(self.target) if self.target else Selector(AS_SHOT, AS_SHOT)

    @cached_property
    def _transfers(self) -> dict[str, RawTransfer]:
        """The transfer to the wanted look, by the camera at which it begins; steps may be given in any order."""
        if self.transfers and self._look is None:
            raise SettingsError("--transfer goes with --as: it leads to the RAW of the camera whose look is wanted")
        steps = {step.source: step for step in map(load_transfer, self.transfers)}
        found = {}
        for camera in self.cameras.values():
            path: list[RawTransfer] = []
            at = camera.camera
            while self._look is not None and at != self._look.camera and at in steps and len(path) < len(steps):
                path.append(steps[at])
                at = steps[at].target
            if path and self._look is not None and at == self._look.camera:
                found[camera.camera] = chained(path)
        if steps and not found:
            raise SettingsError(
                f"no transfer leads from {', '.join(camera.camera for camera in self.cameras.values())} to "
                f"{self._look.camera if self._look else ''}; those given begin at {', '.join(steps)}"
            )
        return found

    @cached_property
    def _baked_grades(self) -> BakedGrades:
        return BakedGrades()

    def change(self, camera: CameraProfile, given: Selector) -> SettingChange:
        """What is changed of a picture with given settings.

        "as-shot" ones are those of the picture, for another camera those under which the same light is neutral.
        """
        look = self._look or camera
        transfer = None if look is camera else self._transfers.get(camera.camera)
        return SettingChange(camera, given, look, self._wanted(camera, given, look, transfer), self.ev, transfer)

    def _wanted(
        self, camera: CameraProfile, given: Selector, look: CameraProfile, transfer: RawTransfer | None
    ) -> Selector:
        """The settings to render with."""
        style = given.style if self._target.style == AS_SHOT else self._target.style
        shift = _own_shift(self._target)
        if shift is None:
            return look.selector(Selector(style, self._target.white_balance))
        balance = given.white_balance
        if look is not camera:
            light = same_light(camera, given, look)
            if light is not None:
                balance = light
            elif transfer is not None:
                neutral = transfer(1 / camera.multipliers(given))
                balance = _multipliers(neutral[1] / neutral)
            else:
                # Where the light is unknown to the other camera, any setting that it knows serves to stay neutral.
                balance = next(iter(look.white_balances))
        wanted = look.selector(Selector(style, balance))
        if shift != Shift():
            wanted = Selector(style, look.shifted(look.multipliers(wanted), shift))
        return wanted


def cameras_of(profiles: tuple[Path, ...]) -> dict[str, CameraProfile]:
    """Return profiles by camera, in lower case. Raises ProfileError where two are of one camera."""
    cameras: dict[str, CameraProfile] = {}
    for path in profiles:
        profile = load_profile(path)
        if cameras.setdefault(profile.camera.lower(), profile) is not profile:
            raise ProfileError(f"{path}: a second profile of {profile.camera}; give one profile per camera")
    return cameras


def _own_shift(target: Selector) -> Shift | None:
    """The step from a picture's own white balance ("as-shot", "as-shot+500K"); None where another is wanted."""
    name, shift = split_shift(str(target.white_balance)) or (str(target.white_balance), Shift())
    return shift if name in NAMED_BY_FILE else None


def _multipliers(values: Array) -> Multipliers:
    r, g, b = (float(value) for value in values)
    return Multipliers((r / g, 1.0, b / g))


def _attributes(look: CameraProfile, wanted: Selector, given: Selector | None = None) -> dict[str, object]:
    """EXIF tags of the new rendering, and the stale ones of the old as None. given: the settings of a picture."""
    light = LIGHT_SOURCES.get(wanted.white_balance, 0) if isinstance(wanted.white_balance, str) else 255  # other
    software = software_tag(look.camera, str(wanted))
    space: Mapping[str, object] = {}
    if wanted.style.endswith(ADOBE_RGB):
        space = TELL_ADOBE_RGB
    elif given is not None and given.style.endswith(ADOBE_RGB):
        space = {"ICCProfile": None, "Exif:ColorSpace": IN_SRGB}
    return {**dict.fromkeys(STALE), "Software": software, "Exif:WhiteBalance": 1, "Exif:LightSource": light, **space}
