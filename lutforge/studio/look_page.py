"""Look: a photograph with other settings while the sliders move, graded by what the exports hold."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import panel as pn

from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range
from lutforge.progress import silent
from lutforge.settings import Selector, Shift
from lutforge.studio.elements import NOTHING, TOGETHER, WIDE, entry, paragraphs, select, slider, text, written
from lutforge.studio.look_view import LookView
from lutforge.studio.pictures import (
    IMAGE_SUFFIXES,
    Photograph,
    bake_all,
    change_of,
    coverage_lut,
    graded,
    grades_of,
    look_lut,
    open_photograph,
)
from lutforge.studio.session import ChosenLook, Session, usual_setting
from lutforge.studio.workspace import WorkspaceError

AS_SHOT, BY_TEMPERATURE, BY_MULTIPLIERS = "as shot", "by temperature", "by multipliers"
UNKNOWN = "not known: choose"
BAKING = "preparing the look"


class SettingControl:
    """STYLE/WB by a preset, a temperature and tint, multipliers, or as the photograph was shot.

    asks: nothing is chosen before the visitor, or the photograph's metadata, say so.
    """

    def __init__(self, title: str, asks: bool = False) -> None:
        self.profile: CameraProfile
        self.has_tint, self.unknown = False, {UNKNOWN: ""} if asks else {}
        self.style = select(f"{title}: style", self.unknown or NOTHING)
        self.balance = select(f"{title}: white balance", self.unknown or NOTHING)
        self.kelvin = slider(f"{title}: temperature, K", 5200, 2000, 10000, 50)
        self.tint = slider(f"{title}: tint", 0, -50, 50, 1)
        self.multipliers = entry(f"{title}: multipliers r,g,b", placeholder="2.10,1,1.43")
        self.widgets = (self.style, self.balance, self.kelvin, self.tint, self.multipliers)
        self.layout = pn.Column(*self.widgets, **TOGETHER)

    def offer(self, profile: CameraProfile) -> None:
        """Offer the settings of a profile; what is chosen stays where it has that.

        A control that does not ask begins at the camera's usual setting.
        """
        self.profile = profile
        try:
            kelvins = None if profile.raw_camera else temperature_range(profile.white_balances)
        except SettingsError:
            kelvins = None
        self.has_tint = kelvins is not None
        others = [AS_SHOT, *([BY_TEMPERATURE] if kelvins else []), *([] if profile.raw_camera else [BY_MULTIPLIERS])]
        offered = (
            sorted(profile.styles, key=lambda name: name.lower() != "standard"),
            [*profile.white_balances, *others],
        )
        for widget, values, usual in zip(
            (self.style, self.balance), offered, usual_setting(profile).split("/"), strict=True
        ):
            chosen = widget.value if widget.value in values else "" if self.unknown else usual
            widget.options, widget.value = {**self.unknown, **{value: value for value in values}}, chosen
        if kelvins is not None:
            low, high = round(kelvins[0] + 50, -2), round(kelvins[1] - 50, -2)
            self.kelvin.param.update(start=low, end=high, value=min(max(self.kelvin.value, low), high))
        self.enable()

    def enable(self) -> None:
        """Enable the controls that set the white balance, and disable the others; the layout stays as it is."""
        self.kelvin.disabled = self.balance.value != BY_TEMPERATURE
        self.multipliers.disabled = self.balance.value != BY_MULTIPLIERS
        self.tint.disabled = not self.has_tint
        if self.balance.value == BY_MULTIPLIERS and not written(self.multipliers):
            gains = self.profile.multipliers(usual_setting(self.profile))
            begin = ",".join(f"{gain:.4g}" for gain in gains / gains[1])
            self.multipliers.param.update(value=begin, value_input=begin)

    def set(self, selector: Selector) -> None:
        """Set the settings of a photograph: by its preset, where it has one of those offered, else as it was shot."""
        preset = selector.white_balance in self.balance.options.values()
        self.style.value, self.tint.value = selector.style, 0
        self.balance.value = selector.white_balance if preset else AS_SHOT

    @property
    def is_known(self) -> bool:
        """Whether both a style and a white balance are chosen."""
        return bool(self.style.value and self.balance.value)

    def text(self, taken: Selector | None) -> str:
        """The selector, STYLE/WB. Raises WorkspaceError where it is not complete, SettingsError."""
        style, tint = self.style.value, 0.0 if self.tint.disabled else self.tint.value
        if self.balance.value == AS_SHOT and taken is None:
            raise WorkspaceError("the photograph does not tell its white balance: choose one")
        plain = {
            AS_SHOT: "" if taken is None else f"{taken.white_balance}",
            BY_TEMPERATURE: f"{self.kelvin.value:g}K",
            BY_MULTIPLIERS: written(self.multipliers),
        }.get(self.balance.value, self.balance.value)
        if not tint:
            return f"{style}/{plain}"
        if "," not in plain and not (self.balance.value == AS_SHOT and plain.lower().endswith("k")):
            return f"{style}/{plain}{tint:+g}"  # a name or a temperature takes its tint in words
        moved = self.profile.shifted(self.profile.multipliers(f"{style}/{plain}"), Shift(tint=tint))
        return f"{style}/" + ",".join(f"{value:.6g}" for value in moved.rgb)


class LookPage:
    """The fourth step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.shown: Photograph | None = None
        self._known: tuple[CameraProfile, Selector] | None = None  # what the pipette's RAW is of
        self.opened: dict[Path, Photograph] = {}  # of the film strip, without their pictures
        self.sources: dict[Path, tuple[str, list[Any]]] = {}  # what each was taken as, and by which controls
        self.listed, self.path = select("Photograph in the folders", NOTHING), entry("or its path")
        opening = session.button("Show", self._open_named, variant="contained", **WIDE)
        self.wanted, self.source = SettingControl("Wanted"), SettingControl("Taken as", asks=True)
        self.ev = slider("Exposure, EV", 0.0, -3.0, 3.0, 0.05)
        session.watch(self._choose_look, self.ev, *self.wanted.widgets)
        session.watch(self._change, *self.source.widgets)
        self.words = text()
        self.view = LookView(raw_name="RAW, by the model")
        self.view.param.watch(session.guarded(lambda event: self._choose(event.new)), "chosen")
        self.main = self.view
        self._look = ChosenLook()
        self._tell_soon = session.rested(self._told)  # the page's words wait while the picture moves
        self.controls = [
            self.listed, self.path, opening, self.words, self.wanted.layout, self.ev, self.source.layout,
        ]  # fmt: skip

    def refresh(self) -> None:
        """The settings of the session's profile, and the look with it."""
        names = self.session.folders.files(IMAGE_SUFFIXES)
        self.listed.options = {**NOTHING, **{name: name for name in names}}
        if not self.session.has_profile:
            self.words.object = paragraphs("Compute a model, or open a profile.")
            return
        for control in (self.wanted, self.source):
            control.offer(self.session.profile)
        self._grade()

    def _start(self, title: str, done: Callable[[Any], None], function: Callable[..., Any], *arguments: Any) -> None:
        """Work in another process, or here where no page waits for it."""
        if pn.state.curdoc is not None:
            self.session.start_short(title, done, function, *arguments)
        else:
            done(function(*arguments, silent))

    def _open_named(self) -> None:
        self._open(self.session.folders.inside(written(self.path) or self.listed.value))

    def _choose(self, index: int) -> None:
        path = list(self.opened)[index]
        if self.shown is None or self.shown.path != path:
            self._open(path)

    def _open(self, path: Path) -> None:
        self._start(f"opening {path.name}", self._show, open_photograph, path, self.session.profile)

    def _show(self, photograph: Photograph) -> None:
        path, given = photograph.path, photograph.selector
        self.shown = self.opened[path] = replace(photograph, picture=b"")
        self.view.show(photograph.picture, path.name)
        told = f"{path.name} does not tell how it was taken: choose that under “Taken as” below"
        with self.session.setting():
            if given is not None:
                self.source.style.value, self.source.balance.value = given.style, AS_SHOT
                told = f"{path.name}: taken as {given}, as its metadata say"
                if not self.session.look_chosen:
                    self.wanted.set(given)
            elif path in self.sources:
                told = f"{path.name}: taken as {self.sources[path][0]}, as you said"
                for widget, value in zip(self.source.widgets, self.sources[path][1], strict=True):
                    widget.value = value
            else:
                self.source.style.value, self.source.balance.value, self.source.tint.value = photograph.style, "", 0
        self.session.say("; ".join([told, *photograph.notes]))
        self._change()

    def _choose_look(self) -> None:
        self.session.look_chosen = True
        self._change()

    def _change(self) -> None:
        for control in (self.wanted, self.source):
            control.enable()
        self._grade()

    def _told(self) -> None:
        """The words of the look, and the other photographs with it."""
        look = self._look
        unknown = "" if self.shown is None else "From what it was taken as, which is to be chosen below, to "
        taken = f"From {look.source} to " if look.source else unknown or "Wanted: "
        self.words.object = paragraphs(f"{taken}{look.target}, {look.ev:+g} EV.")
        if self.shown is not None:
            strip = [(each.path.name, graded(each.small, self._lut_of(each))) for each in self.opened.values()]
            self.view.film(strip, list(self.opened).index(self.shown.path))
        self.session.on_look()

    def _lut_of(self, photograph: Photograph) -> Any:
        """The look of a photograph of the film strip; None where it is not known, or takes seconds to prepare."""
        source = self.sources.get(
            photograph.path, ("" if photograph.selector is None else f"{photograph.selector}", [])
        )
        try:
            look = ChosenLook(source[0], self.wanted.text(photograph.selector), float(self.ev.value))
            return None if not look.source or self._slow_steps(look) else self._lut(look)
        except (SettingsError, WorkspaceError):
            return None

    def _lut(self, look: ChosenLook) -> Any:
        return look_lut(self.session.profile, look.source, look.target, look.ev)

    def _slow_steps(self, look: ChosenLook) -> tuple[Any, ...]:
        profile = self.session.profile
        return grades_of(profile).slow_steps(change_of(profile, look.source, look.target, look.ev).transform)

    def _grade(self) -> None:
        """The photograph as the controls say."""
        if not self.session.has_profile:
            return
        profile, taken = self.session.profile, None if self.shown is None else self.shown.selector
        known = self.source.is_known
        try:
            look = ChosenLook(self.source.text(taken) if known else "", self.wanted.text(taken), float(self.ev.value))
            slow = self._slow_steps(look) if known else ()
            if slow and (not self.session.is_busy or pn.state.curdoc is None):
                self._start(BAKING, lambda luts: self._baked(slow, luts), bake_all, slow)
            if slow:
                return
            lut = self._lut(look) if known else None
        except SettingsError as error:
            raise WorkspaceError(str(error)) from error
        self.view.grade(lut, f"{look.target}{f' {look.ev:+g} EV' if look.ev else ''}" if known else "as it is")
        self._inspect(profile, profile.selector(look.source) if known else None)
        if self.shown is not None and known:
            self.sources[self.shown.path] = look.source, [widget.value for widget in self.source.widgets]
        self.session.chosen = look
        self._look = look
        self._tell_soon()

    def _baked(self, steps: tuple[Any, ...], luts: tuple[Any, ...]) -> None:
        for step, lut in zip(steps, luts, strict=True):
            grades_of(self.session.profile).add(step, lut)
        self._grade()

    def _inspect(self, profile: CameraProfile, given: Selector | None) -> None:
        """What the marks of coverage and the pipette's RAW are of."""
        known = None if given is None else (profile, given)
        if known != self._known:
            self._known = known
            self.view.cover(None if given is None else coverage_lut(profile, given.style))
            self.view.raw_of = None if given is None or profile.raw_camera else profile.linearize(given)
