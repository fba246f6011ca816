"""Look: a photograph with other settings while the sliders move, graded by what the exports hold."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.errors import SettingsError
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.transform import Transform
from lutforge.pipeline.file_kinds import PHOTOGRAPH_SUFFIXES
from lutforge.pipeline.looks import ChosenLook, add_baked, bake_steps, look_lut, slow_steps, usual_setting
from lutforge.pipeline.photographs import Photograph, open_photograph
from lutforge.settings import Selector
from lutforge.studio import ui
from lutforge.studio.controls import as_text, end_moves_of
from lutforge.studio.look_view import LookView
from lutforge.studio.session import Session
from lutforge.studio.setting_control import BY_MULTIPLIERS, BY_TEMPERATURE, LABEL_AS_SHOT, SettingControl, in_short
from lutforge.studio.thumbnails import addresses
from lutforge.studio.workspace import WorkspaceError

BAKING = "preparing the look"
UNSEEN = (
    "How this photograph was taken is not known, so the picture is shown as it is. Choose its style and white balance "
    "under “Taken as”, or begin with the camera's usual ones."
)
KEPT_LOOK = "kept look"
"""The entry of `Session.look_view` that holds the look which was kept as B, with its name."""


class LookPage:
    """The page of the fourth step: a photograph, the settings it was taken with, and those wanted."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._covered: tuple[CameraProfile, Selector] | None = None  # the setting that the view marks unsure colours of
        self.listed = ui.select("Photograph in the folders", ui.NOTHING)
        self.path = ui.entry("or its path")
        opening = session.page.button("Show", self._open_named, variant="contained", width=80, margin=(8, 8))
        self.drop = pmui.FileInput(label="Drop a photograph here", sizing_mode="stretch_width", size="small")
        self.drop.param.watch(session.page.guarded(lambda event: self._open_dropped()), "value")
        session.page.watch(self._open_named, self.path, of="enter_pressed")
        session.page.watch(lambda: self.path.param.update(value="", value_input=""), self.listed)
        self.wanted = SettingControl("Wanted")
        self.source = SettingControl("Taken as", asks=True)
        self.ev = ui.slider("Exposure, EV", 0.0, -3.0, 3.0, 0.05)
        self.widgets = {widget.label: widget for widget in (self.ev, *self.wanted.widgets, *self.source.widgets)}
        for name, widget in self.widgets.items():
            session.page.watch(self._look_changed, widget, take=partial(self._record_move, name))
        end_moves_of(session, *self.widgets.values())
        if not session.state.look_controls:
            self._store_controls()
        self.remembered = (self.listed, self.path)
        self.words = ui.text(min_height=44)  # two lines, so that no slider leaves the pointer that moves it
        self.main = self.view = LookView()
        self.view.on_help = session.page.guarded(self._assume_usual)
        self.view.on_choose = session.page.guarded(self._choose)
        self._remember_view()
        if session.photograph is not None:
            self.view.show(session.photograph.picture, session.photograph.path.name)
        rare = (f"{self.source.title}: temperature, tint, multipliers", pn.Column(*self.source.numbers, **ui.TOGETHER))
        self.controls = [
            self.drop, self.listed, pn.Row(self.path, opening, sizing_mode="stretch_width"),
            pn.Column(self.source.style, self.source.balance, **ui.TOGETHER), self.words,
            pn.Column(*self.wanted.widgets, self.ev, **ui.TOGETHER),
            pmui.Accordion(rare, disable_gutters=True, **{**ui.FULL_WIDTH, "margin": (4, 4)}),
        ]  # fmt: skip

    def refresh(self) -> None:
        """Offer the photographs of the folders and the settings of the session's profile, and grade with them."""
        names = self.session.folders.files(PHOTOGRAPH_SUFFIXES)
        self.listed.options = {**ui.NOTHING, **{name: name for name in names}}
        self.view.strip = addresses(self.session.folders, names)
        self._mark_present()
        if self.session.profile is None:
            self.words.object = ui.paragraphs("Compute a model, or open a profile.")
            return
        with self.session.page.setting():
            for control in (self.wanted, self.source):
                control.offer(self.session.profile)
            for name, value in self.session.state.look_controls.items():
                ui.set_possible(self.widgets[name], value)
            for control in (self.wanted, self.source):
                control.follow()
            self._store_controls()
        self._grade()

    def _remember_view(self) -> None:
        """Let the view be as the page before has left it, and remember its settings for the next."""
        values = self.session.look_view
        if KEPT_LOOK in values:
            self.view.keep(*values[KEPT_LOOK])
        self.view.param.update({name: values[name] for name in LookView.OF_VIEW if name in values})
        self.view.param.watch(
            lambda *events: values.update({event.name: event.new for event in events}), list(LookView.OF_VIEW)
        )
        self.view.param.watch(lambda event: values.update({KEPT_LOOK: self.view.kept_look}), "kept")

    def _mark_present(self) -> None:
        """Mark the photograph that is shown in the film strip."""
        folders, photograph = self.session.folders, self.session.photograph
        self.view.present = "" if photograph is None else folders.name(photograph.path)

    def _choose(self, name: str) -> None:
        """Open a photograph of the film strip."""
        self.view.chosen = ""
        with self.session.page.setting():
            self.listed.value = name
            self.path.param.update(value="", value_input="")
        self._open_named()

    def _store_controls(self) -> None:
        """Let the session hold the values of the controls, by their labels."""
        values = {name: widget.value for name, widget in self.widgets.items()}
        self.session.state = replace(self.session.state, look_controls=values)

    def _record_move(self, name: str, value: Any) -> None:
        """Let the change of a control be undone. A temperature or multipliers that change are used from then on."""
        session = self.session
        widget = self.widgets[name]
        before = session.state
        for control in (self.wanted, self.source):
            meant = {control.kelvin: BY_TEMPERATURE, control.multipliers: BY_MULTIPLIERS if value else ""}.get(widget)
            if meant:
                with session.page.setting():
                    control.balance.value = meant
        self._store_controls()
        if widget not in self.source.widgets:
            session.state = replace(session.state, look_chosen=True)
        key = name if widget in self._sliders else ""
        begin = session.history.before_move(session.step, key, before)
        old, new = as_text(widget, begin.look_controls.get(name)), as_text(widget, value)
        session.record_change(before, f"{name} {new} → {old}", f"{name} {old} → {new}", key)

    @property
    def _sliders(self) -> tuple[Any, ...]:
        return (
            self.ev,
            *(slider for control in (self.wanted, self.source) for slider in (control.kelvin, control.tint)),
        )

    def _assume_usual(self) -> None:
        """Take a photograph of unknown settings for one at the camera's usual ones, as the visitor has agreed to."""
        style, balance = usual_setting(self.session.require_profile()).rsplit("/", 1)
        before = self.session.state
        with self.session.page.setting():
            self.source.style.value = self.source.style.value or style
            self.source.balance.value = self.source.balance.value or balance
        self._store_controls()
        self.session.record_change(before, f"Taken as {style}/{balance}")
        self._look_changed()

    def _open_named(self) -> None:
        named = ui.written(self.path) or self.listed.value
        self._open(self.session.folders.inside(named))

    def _open_dropped(self) -> None:
        """Open a photograph that was dropped, its RAW file where there are several of one."""
        if not self.drop.value or not self.drop.filename:
            return
        paths = self.session.dropped.keep("photographs", self.drop.filename, self.drop.value)
        pictures = [path for path in paths if path.suffix.lower() in PHOTOGRAPH_SUFFIXES]
        if not pictures:
            raise WorkspaceError(f"{paths[0].name}: not a photograph that Look can show")
        with self.session.page.setting():
            self.listed.value = ""
            self.path.param.update(value="", value_input="")
        self._open(pictures[-1])

    def _open(self, path: Path) -> None:
        profile = self.session.require_profile()
        self.session.work.start(f"opening {path.name}", self._show, open_photograph, path, profile, short=True)

    def _show(self, photograph: Photograph) -> None:
        path = photograph.path
        taken_as = photograph.selector
        self.session.photograph = photograph
        self.view.show(photograph.picture, path.name)
        self._mark_present()
        news = f"{path.name} does not tell how it was taken: choose that under “Taken as”"
        with self.session.page.setting():
            if taken_as is not None:
                self.source.style.value = taken_as.style
                self.source.balance.value = LABEL_AS_SHOT
                news = f"{path.name}: taken as {in_short(taken_as)}, as its metadata say"
                if not self.session.state.look_chosen:
                    self.wanted.set(taken_as)
            else:
                self.source.style.value = photograph.style
                self.source.balance.value = ""
                self.source.tint.value = 0
            self._store_controls()
        self.session.page.say("; ".join([news, *photograph.notes]))
        self._look_changed()

    def _look_changed(self) -> None:
        with self.session.page.setting():
            for control in (self.wanted, self.source):
                control.follow()
        self._store_controls()
        self._grade()

    def _show_words(self) -> None:
        """Show in words what the photograph is graded from and to."""
        look = self.session.look
        target = f"{in_short(look.target)}, {look.ev:+g} EV."
        if self.session.is_unseen:
            words = "Shown as it is, until you choose what it was taken as."
        else:
            words = f"From {in_short(look.source)} to {target}" if look.source else f"Wanted: {target}"
        self.words.object = ui.paragraphs(words)
        self.session.page.on_look()

    def _grade(self) -> None:
        """Show the photograph as the controls say, at once or when what its look needs is baked."""
        profile = self.session.profile
        if profile is None:
            return
        is_known = bool(self.source.style.value and self.source.balance.value)
        self.session.is_unseen = self.session.photograph is not None and not is_known
        self.view.notice = UNSEEN if self.session.is_unseen else ""
        try:
            look = self._chosen_look(profile, is_known)
            if look is None:
                self._show_words()
                return
            slow = slow_steps(profile, look) if is_known else ()
            if slow:
                self._bake(profile, slow)
                return
            lut = look_lut(profile, look) if is_known else None
        except SettingsError as error:
            raise WorkspaceError(str(error)) from error
        self._show_look(profile, look, lut)

    def _chosen_look(self, profile: CameraProfile, is_known: bool) -> ChosenLook | None:
        """The look that the controls state; None where it is "as shot" and the settings of the photograph are unknown.

        is_known: whether the settings that it was taken with are. Raises WorkspaceError, SettingsError.
        """
        taken = None if self.session.photograph is None else self.session.photograph.selector
        source = self.source.text(taken) if is_known else ""
        if taken is None and is_known:
            taken = profile.selector(source)
        if taken is None and self.wanted.balance.value == LABEL_AS_SHOT:
            return None
        return ChosenLook(source, self.wanted.text(taken), float(self.ev.value))

    def _bake(self, profile: CameraProfile, steps: Sequence[Transform]) -> None:
        """Bake the slow steps of a look in another process, and grade then; not while another bake is under way."""
        if not self.session.work.is_busy:
            self.session.work.start(BAKING, partial(self._take_baked, profile, steps), bake_steps, steps, short=True)

    def _take_baked(self, profile: CameraProfile, steps: Sequence[Transform], luts: Sequence[Lut]) -> None:
        """Take over baked steps, and grade with them."""
        add_baked(profile, steps, luts)
        self._grade()

    def _show_look(self, profile: CameraProfile, look: ChosenLook, lut: Lut | None) -> None:
        """Show a look. lut: of the look; None shows the picture as it is, where its settings are unknown."""
        title = f"{in_short(look.target)}{f' {look.ev:+g} EV' if look.ev else ''}"
        self.view.grade(lut, "as it is" if lut is None else title)
        source = profile.selector(look.source) if look.source else None
        covered = None if source is None else (profile, source)
        if covered != self._covered:
            self._covered = covered
            unsure = None if source is None else Lut(lattice_ops(confidence(profile.styles[source.style])))
            self.view.cover(unsure)
        self.session.state = replace(self.session.state, chosen=look)
        self._show_words()
