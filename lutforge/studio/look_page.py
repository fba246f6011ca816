"""Look: a photograph with other settings while the sliders move, graded by what the exports hold."""

from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
import panel as pn

from lutforge.apply.baked_grades import BakedGrades
from lutforge.apply.candidates import read_small
from lutforge.apply.source_settings import choose_camera, source_selector
from lutforge.boundary import reading
from lutforge.errors import ImageError, SettingsError
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.white_balance import temperature_range
from lutforge.settings import Selector
from lutforge.shots.picture_settings import read_picture_settings
from lutforge.studio.elements import NOTHING, TOGETHER, WIDE, entry, select, slider, text
from lutforge.studio.look.view import LookView
from lutforge.studio.session import Look, Session
from lutforge.studio.workspace import WorkspaceError

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
AS_SHOT, BY_TEMPERATURE, BY_MULTIPLIERS = "as shot", "by temperature", "by multipliers"


@lru_cache(4)
def grades_of(profile: CameraProfile) -> BakedGrades:
    """The baked steps of a profile, kept between changes of the look."""
    return BakedGrades()


def look_lut(profile: CameraProfile, look: Look) -> Lut | None:
    """The LUT that `apply` grades with; None where the look changes nothing. Raises SettingsError."""
    given, wanted = profile.selector(look.source), profile.selector(look.target)
    if not look.ev and str(given) == str(wanted):
        return None
    return grades_of(profile).refinish(profile, given, profile, wanted, look.ev)


@lru_cache(8)
def coverage_lut(profile: CameraProfile, style: str) -> Lut:
    """Encoded colours of a style → (confidence, unclipped, covered), as of `confidence`, without a wanted look."""
    return Lut(lattice_ops(confidence(profile.styles[style])))


def thumbnail(picture: bytes) -> bytes:
    """A picture file in small, upright, as JPEG."""
    from PIL import Image, ImageOps

    with Image.open(BytesIO(picture)) as file:
        file.draft("RGB", (232, 156))  # a JPEG is decoded at a fraction of its size
        small = ImageOps.exif_transpose(file.convert("RGB"))
    small.thumbnail((232, 156))
    buffer = BytesIO()
    small.save(buffer, format="JPEG")
    return buffer.getvalue()


def picture_bytes(path: Path) -> bytes:
    """A picture as a file that browsers read: itself, or as PNG of at most 8 million pixels. Raises ImageError."""
    if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
        return path.read_bytes()
    from PIL import Image

    pixels, buffer = read_small(path, 8_000_000), BytesIO()
    Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


@dataclass(frozen=True)
class Taken:
    """The photograph that is shown. selector: what it was taken as, None where neither it nor its name tells."""

    path: Path
    selector: Selector | None


class SettingControl:
    """STYLE/WB by a preset, a temperature and tint, multipliers, or as the photograph was shot."""

    def __init__(self, title: str) -> None:
        self.style = select(f"{title}: style", NOTHING)
        self.balance = select(f"{title}: white balance", NOTHING)
        self.kelvin = slider(f"{title}: temperature, K", 5200, 2000, 10000, 50)
        self.tint = slider(f"{title}: tint", 0, -50, 50, 1)
        self.multipliers = entry(f"{title}: multipliers r,g,b", placeholder="2.10,1,1.43")
        self.widgets = (self.style, self.balance, self.kelvin, self.tint, self.multipliers)
        self.layout = pn.Column(*self.widgets, **TOGETHER)

    def offer(self, profile: CameraProfile) -> None:
        """Offer the settings of a profile; what is chosen stays where it has that."""
        try:
            kelvins = None if profile.raw_camera else temperature_range(profile.white_balances)
        except SettingsError:
            kelvins = None
        others = [AS_SHOT, *([BY_TEMPERATURE] if kelvins else []), *([] if profile.raw_camera else [BY_MULTIPLIERS])]
        for widget, values in ((self.style, list(profile.styles)), (self.balance, [*profile.white_balances, *others])):
            chosen = widget.value if widget.value in values else values[0]
            widget.options, widget.value = values, chosen
        if kelvins is not None:
            low, high = round(kelvins[0] + 50, -2), round(kelvins[1] - 50, -2)
            self.kelvin.param.update(start=low, end=high, value=min(max(self.kelvin.value, low), high))
        self.tint.disabled = bool(profile.raw_camera)
        self.enable()

    def enable(self) -> None:
        """Enable what the white balance is set by; nothing moves."""
        self.kelvin.disabled = self.balance.value != BY_TEMPERATURE
        self.multipliers.disabled = self.balance.value != BY_MULTIPLIERS

    def text(self, taken: Selector | None) -> str:
        """The selector, STYLE/WB. Raises WorkspaceError where it is not complete."""
        tint = f"{self.tint.value:+g}" if self.tint.value else ""
        if self.balance.value == AS_SHOT:
            if taken is None:
                raise WorkspaceError("the photograph does not tell its white balance: choose one")
            if tint and not isinstance(taken.white_balance, str):
                raise WorkspaceError("a tint goes with a named white balance or a temperature")
            return f"{Selector(self.style.value, taken.white_balance)}{tint}"
        if self.balance.value == BY_TEMPERATURE:
            return f"{self.style.value}/{self.kelvin.value:g}K{tint}"
        if self.balance.value == BY_MULTIPLIERS:
            return f"{self.style.value}/{(self.multipliers.value or '').strip()}"
        return f"{self.style.value}/{self.balance.value}{tint}"


class LookPage:
    """The fourth step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.taken: Taken | None = None
        self._known: tuple[CameraProfile, Selector] | None = None  # what the pipette's RAW is of
        self.opened: dict[Path, bytes] = {}  # the thumbnails of the film strip
        self.listed, self.path = select("Photograph in the folders", NOTHING), entry("or its path")
        opening = session.button("Show", self._open_named, variant="contained", **WIDE)
        self.wanted, self.source = SettingControl("Wanted"), SettingControl("Taken as")
        self.ev = slider("Exposure, EV", 0.0, -3.0, 3.0, 0.05)
        session.watch(self._change, self.ev, *self.wanted.widgets, *self.source.widgets)
        self.told = text()
        self.view = LookView(raw_name="RAW, by the model")
        self.view.param.watch(session.guarded(lambda event: self._choose(event.new)), "chosen")
        self.main = self.view
        self._tell = session.rested(self._told)  # the page's words wait while the picture moves
        self.controls = [
            self.listed, self.path, opening, self.told, self.wanted.layout, self.ev, self.source.layout,
        ]  # fmt: skip

    def refresh(self) -> None:
        """The settings of the session's profile, and the look with it."""
        names = self.session.folders.files(IMAGE_SUFFIXES)
        self.listed.options = {**NOTHING, **{name: name for name in names}}
        if not self.session.has_profile:
            self.told.object = "<p>Compute a model, or open a profile.</p>"
            return
        for control in (self.wanted, self.source):
            control.offer(self.session.profile)
        self._grade()

    def _open_named(self) -> None:
        self._open(self.session.folders.inside(self.path.value_input or self.path.value or self.listed.value))

    def _choose(self, index: int) -> None:
        path = list(self.opened)[index]
        if self.taken is None or self.taken.path != path:
            self._open(path)

    def _open(self, path: Path) -> None:
        profile = self.session.profile
        settings, picture = read_picture_settings(path), picture_bytes(path)
        if path not in self.opened:
            with reading(path, "a picture", ImageError):
                self.opened[path] = thumbnail(picture)
        self.view.show(picture, path.name)
        notes: tuple[str, ...]
        try:
            choose_camera(path, settings, {profile.camera.lower(): profile}, asked=False)
            given, notes = source_selector(path, settings, profile, None)
            self.taken = Taken(path, given)
            self.source.style.value, self.source.balance.value = given.style, AS_SHOT
            told = f"{path.name}: taken as {given}, as its metadata say"
        except SettingsError:
            self.taken, notes = Taken(path, None), ()
            if self.source.balance.value == AS_SHOT:
                self.source.balance.value = next(iter(profile.white_balances))
            told = f"{path.name} does not tell how it was taken: choose that under “Taken as” below"
        self.view.film([(each.name, small) for each, small in self.opened.items()], list(self.opened).index(path))
        self.session.say("; ".join([told, *settings.notes, *notes]))
        self._grade()

    def _change(self) -> None:
        for control in (self.wanted, self.source):
            control.enable()
        self._grade()

    def _told(self) -> None:
        look = self.session.look
        self.told.object = f"<p>From {look.source} to {look.target}, {look.ev:+g} EV.</p>"
        self.session.on_look()

    def _grade(self) -> None:
        """The photograph as the controls say."""
        if not self.session.has_profile:
            return
        profile, taken = self.session.profile, None if self.taken is None else self.taken.selector
        try:
            look = Look(self.source.text(taken), self.wanted.text(taken), float(self.ev.value))
            lut = look_lut(profile, look)
        except SettingsError as error:
            raise WorkspaceError(str(error)) from error
        given = profile.selector(look.source)
        self.view.grade(lut, f"{look.target}{f' {look.ev:+g} EV' if look.ev else ''}")
        if (profile, given) != self._known:
            self._known = (profile, given)
            self.view.cover(coverage_lut(profile, given.style))
            self.view.raw_of = profile.linearize(given)
        self.session.look = look
        self._tell()
