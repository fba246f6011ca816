"""Grade pictures with camera profiles, each by its own settings: to other settings, another camera's, or to light."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.colour.rgb_spaces import CHROMATICITIES, INTEROP_IDS, from_linear_srgb, rgb_space
from lutforge.errors import ImageError, ProfileError, SettingsError
from lutforge.grading.grade import Grade, Recipe
from lutforge.grading.image import TELL_ADOBE_RGB
from lutforge.images.write import IN_SRGB
from lutforge.luts.bake import bake, grading_lut, grading_steps
from lutforge.luts.ops import Cube, Matrix, Range
from lutforge.luts.sequence import Lut, of_codes
from lutforge.model.camera_profile import CameraProfile, load_profile, match, raw_to_balanced, same_light
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.provenance import Pictures, ReferenceRaw
from lutforge.model.raw_transfer import RawTransfer, load_transfer
from lutforge.model.transform import Transform, through_stages
from lutforge.model.white_balance import LIGHT_SOURCES, temperatures_of
from lutforge.progress import Progress, silent
from lutforge.settings import (
    KELVIN_RANGE,
    Kelvin,
    Multipliers,
    Selector,
    Shift,
    StyleName,
    parse_selector,
    require_exposure,
    split_shift,
)
from lutforge.shots.discover import RAW_SUFFIXES
from lutforge.shots.metadata import ShotMetadata, read_picture_settings, software_tag


@dataclass(frozen=True)
class SettingChange:
    """What a refinish changes: `given` settings of a camera to those wanted of `look`, the same or another camera.

    ev: exposure change in stops. transfer: RAW → RAW between the two cameras, where one was measured.
    """

    camera: CameraProfile
    given: Selector
    look: CameraProfile
    wanted: Selector
    ev: float = 0.0
    transfer: RawTransfer | None = None

    @property
    def transform(self) -> Transform:
        """The refinish (6.1), exact to the model."""
        return match(self.camera, self.given, self.look, self.wanted, self.ev, transfer=self.transfer)

    @property
    def is_none(self) -> bool:
        """True where both settings render alike."""
        if self.look is not self.camera or self.ev or self.given.style != self.wanted.style:
            return False
        before, after = self.camera.multipliers(self.given), self.camera.multipliers(self.wanted)
        return bool(np.allclose(before, after, rtol=1e-4))

    def history(self, source: str) -> str:
        """What was done, in one line for an image's history. source: what the picture was, settings or RAW."""
        exposure = f", {self.ev:+g} EV" if self.ev else ""
        return f"{self.camera.camera}: {source} -> {self.look.camera}: {self.wanted}{exposure}"


class BakedGrades:
    """LUTs of refinishes and renders, each linearize and render step baked once for all white balances."""

    def __init__(self) -> None:
        self._luts: dict[object, Lut] = {}
        # Only the last ones are kept: pictures on automatic white balance each have a grade of their own.
        self.refinish: Callable[[SettingChange], Lut] = lru_cache(16)(
            lambda change: grading_lut(change.transform, self.baked)
        )
        self.processor: Callable[..., OCIO.CPUProcessor] = lru_cache(32)(Lut.processor)

    def develop(self, change: SettingChange) -> OCIO.CPUProcessor:
        """The processor that renders RAW; highlights, clipped before less exposure darkens them, stay neutral."""
        camera, given, look, wanted, transfer = change.camera, change.given, change.look, change.wanted, change.transfer
        before = camera.multipliers(given if look is not camera else wanted)
        k = 2.0**change.ev
        stages = raw_to_balanced(camera, given, look, wanted, transfer=transfer)
        balanced = through_stages(stages, grid(uniform_levels(2)) / before)
        gain, dimmed = Matrix(np.diag(before * max(k, 1.0))), Matrix(min(k, 1.0) * np.eye(3))
        exposed = (gain, Range(), Cube(balanced, "trilinear"), dimmed)
        return Lut((*exposed, *self.baked(look.render_balanced(wanted)).ops)).processor()

    def slow_steps(self, refinish: Transform) -> tuple[Transform, ...]:
        """The steps of a refinish that take seconds to bake, gamut maps, and that have not been baked."""
        steps = () if refinish.is_identity else (grading_steps(refinish)[0], grading_steps(refinish)[-1])
        return tuple(step for step in steps if isinstance(_core(step), GamutMap) and _core(step) not in self._luts)

    def add(self, step: Transform, lut: Lut) -> None:
        """Take over a step that was baked elsewhere."""
        self._luts[_core(step)] = lut

    def baked(self, step: Transform) -> Lut:
        """Return the LUT of a step that is the same under all white balances."""
        core = _core(step)
        if core not in self._luts:
            (self._luts[core],) = baked_steps([step])
        return self._luts[core]


def baked_steps(steps: Sequence[Transform], progress: Progress = silent) -> tuple[Lut, ...]:
    """Bake steps of a look that are the same under all white balances."""
    baked = []
    for number, step in enumerate(steps):
        progress("baking", number / len(steps))
        baked.append(bake(step, display_referred=False))
    return tuple(baked)


def _core(step: Transform) -> Lattice | GamutMap:
    return next(stage for stage in step.stages if isinstance(stage, Lattice | GamutMap))


# --- The grades as LUTs: what `apply` does to pixels, and what the studio's preview shows -----------------------------


STALE = (
    "Exif:MakerNote", "Exif:Saturation", "Exif:Contrast", "Exif:CustomRendered",
    "(Canon|Nikon|Olympus|Panasonic|Pentax|Fujifilm|Sony):.*",
)  # fmt: skip
"""What the camera wrote about a rendering that is no longer the picture's."""

UNIT_EXPOSURE = 2.0**-10
"""Time in seconds · ISO / 100 / f-number² of a picture that keeps its values: 1/60 s at f/4 and ISO 100, nearly.

Half floats hold noon and a lit room beside it without loss.
"""


@dataclass(frozen=True)
class _OfProfiles(Recipe):
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
            if self.asked.style != AS_SHOT and self.asked.white_balance not in NAMED_BY_FILE:
                camera.selector(self.asked)

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
    def asked(self) -> Selector:
        """What the user says of the pictures' own settings."""
        return parse_selector(self.source) if self.source else AS_IT_IS

    @cached_property
    def _wanted(self) -> Selector:
        return parse_selector(self.target) if self.target else AS_IT_IS

    @cached_property
    def baked_grades(self) -> BakedGrades:
        """The LUTs of the grades, which pictures share."""
        return BakedGrades()


@dataclass(frozen=True)
class ProfileRecipe(_OfProfiles):
    """Grade each picture from the settings that it was made with to other settings.

    look: the profile of the camera whose look is wanted. transfer: RAW → RAW from another camera to it.
    """

    look: Path | None = None
    transfer: Path | None = None

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles, the transfer or the settings asked for are wrong."""
        super().check()
        for camera in [self._look] if self._look else self.cameras.values():
            style = self._wanted.style if self._wanted.style != AS_SHOT else next(iter(camera.styles))
            first = next(iter(camera.white_balances))
            camera.selector(Selector(style, self._wanted.white_balance if self.shift is None else first))
        _ = self._transfer

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        if source.suffix.lower() in RAW_SUFFIXES:
            return self._developed(source, settings, camera)
        needed = self._look not in (None, camera) or self.shift != Shift()
        given, doubts = source_selector(source, settings, camera, self.asked, needed)
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
            attributes=_attributes(change.look, change.wanted, given),
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
        asked = Selector(style, self.asked.white_balance)
        given, notes = source_selector(source, replace(settings, style=style), camera, asked)
        if self._wanted.style == AS_SHOT and style not in stated:
            notes = (*notes, f'the file does not tell a style of this profile; "{style}" is used')
        change = self.change(camera, given)
        return Grade(
            self.baked_grades.develop(change),
            change.history("RAW"),
            attributes=_attributes(change.look, change.wanted),
            raw=True,
            vignettings=camera.vignettings,
            notes=notes,
        )

    @cached_property
    def shift(self) -> Shift | None:
        """The step from a picture's own white balance ("as-shot", "as-shot+500K"); None where another is wanted."""
        balance = str(self._wanted.white_balance)
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
        style = given.style if self._wanted.style == AS_SHOT else self._wanted.style
        balance = given.white_balance
        if self.shift is None:
            balance = self._wanted.white_balance
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
        wanted = look.selector(Selector(style, balance))
        if self.shift not in (None, Shift()):
            wanted = Selector(style, look.shifted(look.multipliers(wanted), self.shift))
        return SettingChange(camera, given, look, wanted, self.ev, transfer)


@dataclass(frozen=True)
class SceneRecipe(_OfProfiles):
    """Take each picture from the settings that it was made with to linear light of a colour space.

    target: whose white balance names the light that becomes neutral, "as-shot/WB"; by default a picture's own, or where
    exposures are minded one for all, daylight or else the profile's first. by_exposure: divide by time, ISO and
    aperture, as the file states them, so that pictures of one scene agree.
    """

    space: str = field(kw_only=True)
    by_exposure: bool = False

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles or the settings asked for are wrong."""
        if not rgb_space(self.space).is_linear:
            raise SettingsError(f"--space {self.space}: encoded; pictures become linear light, such as acescg")
        require_exposure(self.ev)
        if self._wanted.style != AS_SHOT:
            helps = f"write --to {AS_SHOT}/{self._wanted.white_balance}"
            raise SettingsError(f"--to {self.target}: light has no style, only a white balance; {helps}")
        super().check()
        for camera in self.cameras.values():
            self._neutral(camera, Selector(next(iter(camera.styles)), next(iter(camera.white_balances))))

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        if source.suffix.lower() in RAW_SUFFIXES:
            raise SettingsError(f"{source}: a RAW file; --space takes finished pictures")
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        given, doubts = source_selector(source, settings, camera, self.asked)
        scale = 2.0**self.ev
        if self.by_exposure:
            if not math.isfinite(settings.exposure):
                raise ImageError(f"{source}: the file does not tell its exposure; leave out --exposure exif")
            scale *= UNIT_EXPOSURE / settings.exposure
            doubts += settings.exposure_notes
        neutral, space = self._neutral(camera, given), rgb_space(self.space)
        # The LUT to light: the step to balanced RAW, baked once for each style, and a matrix.
        stages = camera.linearize_to_own_raw(given).stages
        to_balanced, to_raw = Transform(stages[:-1]), Transform(stages[-1:])
        raw = to_raw(np.eye(3)).T
        light = from_linear_srgb(self.space) @ camera.matrix @ np.diag(camera.multipliers(neutral))
        lut = Lut((*self.baked_grades.baked(to_balanced).ops, Matrix(scale * light @ raw)))
        details = f", {self.ev:+g} EV" * bool(self.ev) + ", by exposure" * self.by_exposure
        return Grade(
            self.baked_grades.processor(lut),
            f"{camera.camera}: {given} -> {self.space}, neutral {neutral.white_balance}{details}",
            attributes={
                **dict.fromkeys((*STALE, "ICCProfile", "Exif:ColorSpace", "oiio:ColorSpace", "oiio:Gamma")),
                "colorInteropID": INTEROP_IDS.get(space.name),
                "chromaticities": tuple(np.ravel(CHROMATICITIES[space.primaries]).tolist()),
            },
            notes=(*settings.notes, *notes, *doubts),
            gives_linear=True,
            lut=lut,
            for_srgb=given.colour_space == "srgb",
            marks_clipped=True,
        )

    def _neutral(self, camera: CameraProfile, given: Selector) -> Selector:
        """The setting whose light becomes neutral."""
        if self._wanted.white_balance not in NAMED_BY_FILE:
            return camera.selector(Selector(given.style, self._wanted.white_balance))
        if self.target is not None or not self.by_exposure:
            return given
        known = camera.white_balances
        return camera.selector(Selector(given.style, "daylight" if "daylight" in known else next(iter(known))))


def _attributes(look: CameraProfile, wanted: Selector, given: Selector | None = None) -> dict[str, object]:
    """EXIF tags of the new rendering, and the stale ones of the old as None. given: the settings of a picture."""
    light = LIGHT_SOURCES.get(wanted.white_balance, 0) if isinstance(wanted.white_balance, str) else 255  # other
    software = software_tag(look.camera, str(wanted))
    space: Mapping[str, object] = {}
    if wanted.colour_space == "adobe rgb":
        space = TELL_ADOBE_RGB
    elif given is not None and given.colour_space == "adobe rgb":
        space = {"ICCProfile": None, "Exif:ColorSpace": IN_SRGB}
    return {**dict.fromkeys(STALE), "Software": software, "Exif:WhiteBalance": 1, "Exif:LightSource": light, **space}


# --- Which of a profile's settings a picture was made with: by its metadata, or by what the user says of it -----------


AS_SHOT = "as-shot"
AS_IT_IS = Selector(AS_SHOT, AS_SHOT)
NAMED_BY_FILE = (AS_SHOT, "auto")
"""White balances that stand for the picture's own."""

STEADY = 0.02
"""A named setting whose multipliers vary by less from shot to shot is the same for all shots."""


def choose_camera(
    path: Path, settings: ShotMetadata, cameras: Mapping[str, CameraProfile], asked: bool
) -> tuple[CameraProfile, tuple[str, ...]]:
    """The profile of the camera that took a picture. cameras: by name in lower case.

    asked: the user names the settings; then a single profile applies to any picture, and the notes say so.
    """
    found = cameras.get(settings.camera.lower())
    if found is not None:
        return found, ()
    named = f"is of {settings.camera}" if settings.camera else "does not name its camera"
    known = ", ".join(camera.camera for camera in cameras.values())
    if len(cameras) > 1 or not asked:
        raise SettingsError(
            f"{path}: the picture {named}, the profile{'s are' if len(cameras) > 1 else ' is'} of {known}; "
            f"name the settings with --from STYLE/WB to use a profile all the same"
        )
    return next(iter(cameras.values())), (f"the picture {named}; the profile is of {known}",)


def source_selector(
    path: Path, settings: ShotMetadata, camera: CameraProfile, asked: Selector = AS_IT_IS, needed: bool = True
) -> tuple[Selector, tuple[str, ...]]:
    """The settings of a picture: those asked for, completed by its metadata; and notes.

    needed: False where the white balance stays as it is, so that any serves where it is not told.
    """
    style = asked.style if asked.style != AS_SHOT else settings.style
    if style not in camera.styles:
        if asked.style != AS_SHOT:
            camera.selector(asked)  # raises: this error lists the styles
        known = f"{camera.camera} has the styles {', '.join(sorted(camera.styles))}"
        stated = f'its picture style is "{style}"' if style != "unknown" else "the file does not tell its picture style"
        balances = ", ".join(sorted(camera.white_balances))
        raise SettingsError(f"{path}: {stated}; {known} and the white balances {balances}: name it with --from")
    balance = _balance_of_file(settings, camera)
    chosen = balance if asked.white_balance in NAMED_BY_FILE else asked.white_balance
    if chosen is not None:
        given = camera.selector(Selector(style, chosen))
        named_style = settings.style if settings.style != "unknown" else style
        named = settings.white_balance if settings.white_balance != "unknown" else str(given.white_balance)
        if balance is None:
            same = named in (str(given.white_balance), "auto")
        else:
            stated_multipliers = camera.multipliers(Selector(style, balance))
            same = bool(np.allclose(stated_multipliers, camera.multipliers(given), rtol=2 * STEADY))
        if named_style == style and same:
            return given, ()
        named = str(given.white_balance) if same else named
        return given, (f"the file says {named_style}/{named}; it is taken for {given}, as --from says",)
    middle = camera.white_balances.get("auto")
    if asked.white_balance == "auto" and middle is not None:
        r, g, b = middle.multipliers
        text = f"the file does not tell its white balance; that of the middle shot, {r:.3f},{g:g},{b:.3f}, is used"
        return Selector(style, "auto"), (text,)
    if not needed:
        return Selector(style, next(iter(camera.white_balances))), ()
    stated = "the file does not tell its white balance"
    if settings.white_balance != "unknown":
        stated = (
            f'its white balance is "{settings.white_balance}", and the file does not tell which multipliers that were'
        )
    known = ", ".join(sorted(camera.white_balances))
    raise SettingsError(
        f"{path}: {stated}; put its RAW file beside it, name it with --from {style}/WB, where WB is {known}"
        f"{temperatures_of(camera.white_balances)}; `lutforge studio` shows how each looks"
    )


def _balance_of_file(settings: ShotMetadata, camera: CameraProfile) -> str | Kelvin | Multipliers | None:
    """The white balance that the metadata tell: the named setting, the temperature dialled in, or the multipliers."""
    name = settings.white_balance
    known = camera.white_balances.get(name)
    steady = known is not None and known.spread <= STEADY
    if settings.multipliers is not None and not isinstance(camera.provenance, ReferenceRaw):
        r, g, b = (float(value) for value in settings.multipliers)
        departure = 0.0 if known is None else float(np.max(np.abs(settings.multipliers / known.multipliers - 1)))
        if not steady or STEADY < departure <= 0.3:  # multipliers that depart further are not believed
            return Multipliers((r, g, b))
    if steady:
        return name
    if name.endswith("k") and name[:-1].replace(".", "", 1).isdigit():
        kelvin = float(name[:-1])
        return Kelvin(kelvin) if KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1] else None
    return None
