"""Look: a photograph with other settings while the sliders move, graded by what the exports hold.

The browser grades the picture: Python sends LUTs, and no pixels while sliders move.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
import param
from panel.custom import JSComponent

from lutforge.errors import LutError, SettingsError
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.transform import Transform
from lutforge.pipeline.looks import ChosenLook, add_baked, bake_steps, look_lut, slow_steps, usual_setting
from lutforge.pipeline.photographs import IMAGE_SUFFIXES, Photograph, open_photograph
from lutforge.settings import Selector, Shift
from lutforge.studio import ui
from lutforge.studio.session import Session, as_text
from lutforge.studio.thumbnails import addresses
from lutforge.studio.workspace import WorkspaceError

LABEL_AS_SHOT = "as shot"
BY_TEMPERATURE = "by temperature"
BY_MULTIPLIERS = "by multipliers"
NOT_CHOSEN = "not known: choose"
BAKING = "preparing the look"
UNSEEN = (
    "How this photograph was taken is not known, so the picture is shown as it is. Choose its style and white balance "
    "under “Taken as”, or begin with the camera's usual ones."
)


class SettingControl:
    """STYLE/WB by a preset, a temperature and tint, multipliers, or as the photograph was shot.

    asks: nothing is chosen before the visitor, or the photograph's metadata, say so.
    """

    def __init__(self, title: str, asks: bool = False) -> None:
        self.title = title
        self.profile: CameraProfile
        self.unknown = {NOT_CHOSEN: ""} if asks else {}
        self.style = ui.select(f"{title}: style", self.unknown or ui.NOTHING)
        self.balance = ui.select(f"{title}: white balance", self.unknown or ui.NOTHING)
        self.kelvin = ui.slider(f"{title}: temperature, K", 5200, 2000, 10000, 50)
        self.tint = ui.slider(f"{title}: tint", 0, -50, 50, 1)
        self.multipliers = ui.entry(f"{title}: multipliers r,g,b", placeholder="2.10,1,1.43")
        self.numbers = (self.kelvin, self.tint, self.multipliers)
        self.widgets = (self.style, self.balance, *self.numbers)

    def offer(self, profile: CameraProfile) -> None:
        """Offer the settings of a profile; what is chosen stays where it has that, else it is the usual setting."""
        self.profile = profile
        kelvins = None
        through_reference = isinstance(profile.provenance, ReferenceRaw)
        with suppress(SettingsError):
            kelvins = None if through_reference else profile.white_balance_model.temperature_range
        self.tint.disabled = self.kelvin.disabled = kelvins is None
        self.multipliers.disabled = through_reference
        other_ways = [
            LABEL_AS_SHOT,
            *([BY_TEMPERATURE] if kelvins else []),
            *([] if through_reference else [BY_MULTIPLIERS]),
        ]
        styles = sorted(profile.styles, key=lambda name: name.lower() != "standard")
        usual = usual_setting(profile)
        offered = {self.style: styles, self.balance: [*profile.white_balances, *other_ways]}
        for (widget, values), usual_value in zip(offered.items(), usual.rsplit("/", 1), strict=True):
            chosen = widget.value if widget.value in values else "" if self.unknown else usual_value
            widget.options = {**self.unknown, **{value: value for value in values}}
            widget.value = chosen
        if kelvins is not None:
            low, high = round(kelvins[0] + 50, -2), round(kelvins[1] - 50, -2)
            self.kelvin.param.update(start=low, end=high, value=min(max(self.kelvin.value, low), high))
        self.follow()

    def follow(self) -> None:
        """Let the temperature be that of the chosen white balance, and multipliers begin with the usual ones."""
        preset = self.profile.white_balances.get(self.balance.value)
        if preset is not None and preset.kelvin is not None:
            ui.set_possible(self.kelvin, preset.kelvin)
        if self.balance.value == BY_MULTIPLIERS and not ui.written(self.multipliers):
            gains = self.profile.multipliers(usual_setting(self.profile))
            begin = ",".join(f"{gain:.4g}" for gain in gains / gains[1])
            self.multipliers.param.update(value=begin, value_input=begin)

    def set(self, selector: Selector) -> None:
        """Set the settings of a photograph: by its preset, where it has one of those offered, else as it was shot."""
        preset = selector.white_balance in self.balance.options.values()
        self.style.value = selector.style
        self.tint.value = 0
        self.balance.value = selector.white_balance if preset else LABEL_AS_SHOT

    def text(self, taken: Selector | None) -> str:
        """The selector, STYLE/WB. Raises WorkspaceError where it is not complete, SettingsError."""
        style = self.style.value
        tint = 0.0 if self.tint.disabled else self.tint.value
        if self.balance.value == LABEL_AS_SHOT and taken is None:
            raise WorkspaceError("the photograph does not tell its white balance: choose one")
        plain = {
            LABEL_AS_SHOT: "" if taken is None else f"{taken.white_balance}",
            BY_TEMPERATURE: f"{self.kelvin.value:g}K",
            BY_MULTIPLIERS: ui.written(self.multipliers),
        }.get(self.balance.value, self.balance.value)
        if not tint:
            return f"{style}/{plain}"
        if "," not in plain and not (self.balance.value == LABEL_AS_SHOT and plain.lower().endswith("k")):
            return f"{style}/{plain}{tint:+g}"  # a name or a temperature takes its tint in words
        moved = self.profile.shifted(self.profile.multipliers(f"{style}/{plain}"), Shift(tint=tint))
        return f"{style}/" + ",".join(f"{value:.6g}" for value in moved.rgb)


class LookPage:
    """The page of the fourth step: a photograph, the settings it was taken with, and those wanted."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._known: tuple[CameraProfile, Selector] | None = None  # what the coverage is of
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
        self.moved = {widget.label: widget for widget in (self.ev, *self.wanted.widgets, *self.source.widgets)}
        for name, widget in self.moved.items():
            session.page.watch(self._change, widget, take=partial(self._take, name))
        session.end_moves_of(*self.moved.values())
        if not session.state.look_controls:
            self._store_controls()
        self.remembered = (self.listed, self.path)
        self.words = ui.text()
        self.main = self.view = LookView()
        self.view.on_help = session.page.guarded(self._suppose)
        self.view.on_choose = session.page.guarded(self._choose)
        self._keep_view()
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
        """The settings of the session's profile, and the look with it."""
        names = self.session.folders.files(IMAGE_SUFFIXES)
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
                ui.set_possible(self.moved[name], value)
            for control in (self.wanted, self.source):
                control.follow()
            self._store_controls()
        self._grade()

    def _keep_view(self) -> None:
        """Let the view be as the page before has left it, and be kept for the next."""
        kept = self.session.look_view
        if "b" in kept:
            self.view.keep(*kept["b"])
        self.view.param.update({name: kept[name] for name in LookView.OF_VIEW if name in kept})
        self.view.param.watch(
            lambda *events: kept.update({event.name: event.new for event in events}), list(LookView.OF_VIEW)
        )
        self.view.param.watch(lambda event: kept.update(b=self.view.kept_look), "kept")

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
        values = {name: widget.value for name, widget in self.moved.items()}
        self.session.state = replace(self.session.state, look_controls=values)

    def _take(self, name: str, value: Any) -> None:
        """Let a change be undone. Moving a temperature, or writing multipliers, chooses that way to set them."""
        session = self.session
        widget = self.moved[name]
        before = session.state
        for control in (self.wanted, self.source):
            meant = {control.kelvin: BY_TEMPERATURE, control.multipliers: BY_MULTIPLIERS if value else ""}.get(widget)
            if meant:
                with session.page.setting():
                    control.balance.value = meant
        self._store_controls()
        if widget not in self.source.widgets:
            session.state = replace(session.state, look_chosen=True)
        old, new = as_text(widget, before.look_controls.get(name)), as_text(widget, value)
        session.record_change(
            before, f"{name} {new} → {old}", f"{name} {old} → {new}", name if widget in self._sliders else ""
        )

    @property
    def _sliders(self) -> tuple[Any, ...]:
        return (
            self.ev,
            *(slider for control in (self.wanted, self.source) for slider in (control.kelvin, control.tint)),
        )

    def _suppose(self) -> None:
        """Take a photograph of unknown settings for one at the camera's usual ones, as the visitor has agreed to."""
        style, balance = usual_setting(self.session.require_profile()).rsplit("/", 1)
        before = self.session.state
        with self.session.page.setting():
            self.source.style.value = self.source.style.value or style
            self.source.balance.value = self.source.balance.value or balance
        self._store_controls()
        self.session.record_change(before, f"Taken as {style}/{balance}")
        self._change()

    def _open_named(self) -> None:
        named = ui.written(self.path) or self.listed.value
        self._open(self.session.folders.inside(named))

    def _open_dropped(self) -> None:
        """Open a photograph that was dropped, its RAW file where there are several of one."""
        if not self.drop.value or not self.drop.filename:
            return
        paths = self.session.keep_dropped("photographs", self.drop.filename, self.drop.value)
        known = [path for path in paths if path.suffix.lower() in IMAGE_SUFFIXES]
        if not known:
            raise WorkspaceError(f"{paths[0].name}: not a photograph that Look can show")
        with self.session.page.setting():
            self.listed.value = ""
            self.path.param.update(value="", value_input="")
        self._open(known[-1])

    def _open(self, path: Path) -> None:
        profile = self.session.require_profile()
        self.session.work.start(f"opening {path.name}", self._show, open_photograph, path, profile, short=True)

    def _show(self, photograph: Photograph) -> None:
        path = photograph.path
        given = photograph.selector
        self.session.photograph = photograph
        self.view.show(photograph.picture, path.name)
        self._mark_present()
        news = f"{path.name} does not tell how it was taken: choose that under “Taken as”"
        with self.session.page.setting():
            if given is not None:
                self.source.style.value = given.style
                self.source.balance.value = LABEL_AS_SHOT
                news = f"{path.name}: taken as {given}, as its metadata say"
                if not self.session.state.look_chosen:
                    self.wanted.set(given)
            else:
                self.source.style.value = photograph.style
                self.source.balance.value = ""
                self.source.tint.value = 0
            self._store_controls()
        self.session.page.say("; ".join([news, *photograph.notes]))
        self._change()

    def _change(self) -> None:
        with self.session.page.setting():
            for control in (self.wanted, self.source):
                control.follow()
        self._store_controls()
        self._grade()

    def _tell(self) -> None:
        """The words of the look."""
        look = self.session.look
        unknown = "" if self.session.photograph is None else "From what it was taken as, which is to be chosen, to "
        taken = f"From {look.source} to " if look.source else unknown or "Wanted: "
        self.words.object = ui.paragraphs(f"{taken}{look.target}, {look.ev:+g} EV.")
        self.session.page.on_look()

    def _grade(self) -> None:
        """The photograph as the controls say."""
        profile = self.session.profile
        taken = None if self.session.photograph is None else self.session.photograph.selector
        if profile is None:
            return
        known = bool(self.source.style.value and self.source.balance.value)
        self.session.is_unseen = self.session.photograph is not None and not known
        self.view.notice = UNSEEN if self.session.is_unseen else ""
        try:
            source = self.source.text(taken) if known else ""
            if taken is None and known:
                taken = profile.selector(source)
            if taken is None and self.wanted.balance.value == LABEL_AS_SHOT:
                self._tell()
                return
            look = ChosenLook(source, self.wanted.text(taken), float(self.ev.value))
            slow = slow_steps(profile, look) if known else ()
            if slow and not self.session.work.is_busy:
                self.session.work.start(BAKING, partial(self._baked, profile, slow), bake_steps, slow, short=True)
            if slow:
                return
            lut = look_lut(profile, look) if known else None
        except SettingsError as error:
            raise WorkspaceError(str(error)) from error
        self.view.grade(lut, f"{look.target}{f' {look.ev:+g} EV' if look.ev else ''}" if known else "as it is")
        given = profile.selector(look.source) if known else None
        if (inspected := None if given is None else (profile, given)) != self._known:
            self._known = inspected
            self.view.cover(None if given is None else Lut(lattice_ops(confidence(profile.styles[given.style]))))
        self.session.state = replace(self.session.state, chosen=look)
        self._tell()

    def _baked(self, profile: CameraProfile, steps: Sequence[Transform], luts: Sequence[Lut]) -> None:
        add_baked(profile, steps, luts)
        self._grade()


def packed(lut: Lut) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """The operations of a LUT as the page takes them, and their tables, float32, by a key of their content."""
    ops, tables = zip(*map(_packed, lut.ops), strict=True)
    return list(ops), {table["key"]: table for table in tables if table}


@lru_cache(32)
def _packed(op: Op) -> tuple[dict[str, Any], dict[str, Any]]:
    match op:
        case Matrix():
            return {"kind": "matrix", "matrix": op.matrix.ravel().tolist(), "offset": op.offset.tolist()}, {}
        case Range():
            return {"kind": "range", "low": op.low, "high": op.high}, {}
        case Curve() if op.inputs is None:
            values = op.outputs
            kind = {"kind": "curve", "low": op.low, "high": op.high}
        case Cube():
            values = op.values
            kind = {"kind": op.interpolation}
        case _:
            raise LutError("LUT: the page has no curves at free knots; bake the transform anew")
    table = np.ascontiguousarray(values, dtype=np.float32).tobytes()
    size = list(values.shape[:-1])
    key = f"{size} {blake2b(table, digest_size=16).hexdigest()}"
    return {**kind, "size": size, "key": key}, {"key": key, "size": size, "table": table}


class LookView(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """A picture with a look on it: wipe, zoom, pipette, waveform, overlays, a second setting beside the first.

    `show` sets the picture, `grade` its look. The browser grades what is on the screen with WebGL2: each operation of
    the LUT becomes a line of a shader, which interpolates in float32 as OpenColorIO does, so that a page shows what
    `lut.processor()` gives, within rounding. A table is sent once, as bytes in a message, while any LUT holds it; the
    page asks for those that it misses. Where there is no WebGL2, the page says so, and shows no picture.

    Parameters that the page changes, too: mode, wipe, beside_b, clipping, unsure, scopes. It alone sets kept, which
    counts "Keep as B" (`b` and `b_name` are then those of `a`).
    """

    picture = param.Bytes(doc="The picture as a file that browsers read, JPEG or PNG; it is shown upright.")
    title = param.String(doc="The picture's name.")
    a = param.List(doc="The look, as of `packed`; empty: the picture as it is.")
    b = param.List(doc="Another look, to compare with; empty: none.")
    coverage = param.List(doc="A LUT whose third channel is below 0.5 for colours that no sample tells of; or empty.")
    a_name = param.String(doc="What the look is called on the picture.")
    b_name = param.String(doc="What the other look is called.")
    number = param.Integer(0, doc="Counts the looks; the page says which one it shows in data-drawn.")
    mode = param.Selector(default="wipe", objects=["graded", "original", "wipe", "side"])
    wipe = param.Number(0.5, bounds=(0.0, 1.0), doc="Where the line is, as a share of the width.")
    beside_b = param.Boolean(False, doc="On the left is B; else the original.")
    clipping = param.Boolean(False, doc="Stripes over what clips in the graded picture.")
    unsure = param.Boolean(False, doc="Stripes over what `coverage` says no sample tells of.")
    scopes = param.Boolean(True, doc="The waveform and the histogram beside the picture.")
    kept = param.Integer(0)
    strip = param.List(doc="The photographs to choose from: name and url of a thumbnail of each.")
    chosen = param.String(doc="The name in `strip` of the photograph that was pressed; empty once that is heard.")
    present = param.String(doc="The name in `strip` of the photograph that is shown.")
    notice = param.String(doc="What hinders the look, in words over the picture, with a button that helps; or empty.")

    OF_VIEW = ("mode", "wipe", "beside_b", "clipping", "unsure", "scopes")

    _debounce = 8  # ms; what the page changes is told so late
    _esm = "\n".join((ui.HERE / name).read_text(encoding="utf-8") for name in ("grading.js", "look.js"))
    _stylesheets = [(ui.HERE / "look.css").read_text(encoding="utf-8")]  # noqa: RUF012 - Panel's own way to declare it

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"sizing_mode": "stretch_both", "min_height": 320, "margin": 0, **options})
        self._luts: dict[str, Lut | None] = {"a": None, "b": None, "coverage": None}
        self.on_help: Callable[[], None] = lambda: None
        self.on_choose: Callable[[str], None] = lambda name: None
        self._tables: dict[str, dict[str, Any]] = {}  # of those LUTs, by their keys
        self.param.watch(lambda event: self.keep(self._luts["a"], self.a_name or "kept"), "kept")
        self.param.watch(lambda event: self.on_choose(event.new) if event.new else None, "chosen")

    def show(self, picture: bytes, title: str = "") -> None:
        """Show another picture, a JPEG or PNG file, with the look that is set."""
        self.param.update(picture=picture, title=title)

    def grade(self, lut: Lut | None, name: str = "") -> None:
        """Set the look, a LUT of the picture's encoded RGB, or none. Raises LutError on curves at free knots."""
        self._set("a", lut, number=self.number + 1, a_name=name)

    @property
    def kept_look(self) -> tuple[Lut | None, str]:
        """B, and what it is called."""
        return self._luts["b"], self.b_name

    def keep(self, lut: Lut | None, name: str) -> None:
        """Set B, a LUT of the picture's encoded RGB, or none."""
        self._set("b", lut, b_name=name, beside_b=lut is not None)

    def cover(self, coverage: Lut | None) -> None:
        """Set what `unsure` marks, a LUT of the picture's encoded RGB, or none."""
        self._set("coverage", coverage)

    def _set(self, side: str, lut: Lut | None, **more: Any) -> None:
        """Set a LUT, with other parameters; the page gets the tables that it has not."""
        luts = {**self._luts, side: lut}
        sides = {name: ([], {}) if of_side is None else packed(of_side) for name, of_side in luts.items()}
        self._luts = luts
        sent = self._tables
        self._tables = {key: table for _, tables in sides.values() for key, table in tables.items()}
        self._handle_msg([key for key in self._tables if key not in sent])
        self.param.update(**more)
        self.param.update(**{side: sides[side][0]})  # at which the page draws

    def _handle_msg(self, data: Any) -> None:
        """Send the tables of these keys, which the page misses; or help, where its button was pressed."""
        if data == "help":
            self.on_help()
            return
        tables = [self._tables[key] for key in data if key in self._tables]
        if tables:
            self._send_msg(tables)
