"""Look: a photograph with other settings while the sliders move, graded by what the exports hold.

The browser grades the picture: Python sends LUTs, and no pixels while sliders move.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import param
from panel.custom import JSComponent

from lutforge.errors import LutError, SettingsError
from lutforge.grading.baked_grades import BakedGrades, SettingChange, baked_steps
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.transform import Transform
from lutforge.model.white_balance import temperature_range
from lutforge.settings import Selector, Shift
from lutforge.studio import ui
from lutforge.studio.opening import IMAGE_SUFFIXES, Photograph, open_photograph
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
        self.unknown = {UNKNOWN: ""} if asks else {}
        self.style = ui.select(f"{title}: style", self.unknown or ui.NOTHING)
        self.balance = ui.select(f"{title}: white balance", self.unknown or ui.NOTHING)
        self.kelvin = ui.slider(f"{title}: temperature, K", 5200, 2000, 10000, 50)
        self.tint = ui.slider(f"{title}: tint", 0, -50, 50, 1)
        self.multipliers = ui.entry(f"{title}: multipliers r,g,b", placeholder="2.10,1,1.43")
        self.widgets = (self.style, self.balance, self.kelvin, self.tint, self.multipliers)
        self.layout = pn.Column(*self.widgets, **ui.TOGETHER)

    def offer(self, profile: CameraProfile) -> None:
        """Offer the settings of a profile; what is chosen stays where it has that, else it is the usual setting."""
        self.profile, kelvins = profile, None
        with suppress(SettingsError):
            kelvins = None if profile.raw_camera else temperature_range(profile.white_balances)
        self.tint.disabled = kelvins is None
        others = [AS_SHOT, *([BY_TEMPERATURE] if kelvins else []), *([] if profile.raw_camera else [BY_MULTIPLIERS])]
        styles, usual = sorted(profile.styles, key=lambda name: name.lower() != "standard"), usual_setting(profile)
        offered = {self.style: styles, self.balance: [*profile.white_balances, *others]}
        for (widget, values), one in zip(offered.items(), usual.split("/"), strict=True):
            chosen = widget.value if widget.value in values else "" if self.unknown else one
            widget.options, widget.value = {**self.unknown, **{value: value for value in values}}, chosen
        if kelvins is not None:
            low, high = round(kelvins[0] + 50, -2), round(kelvins[1] - 50, -2)
            self.kelvin.param.update(start=low, end=high, value=min(max(self.kelvin.value, low), high))
        self.enable()

    def enable(self) -> None:
        """Enable the controls that set the white balance, and disable the others; the layout stays as it is."""
        self.kelvin.disabled = self.balance.value != BY_TEMPERATURE
        self.multipliers.disabled = self.balance.value != BY_MULTIPLIERS
        if self.balance.value == BY_MULTIPLIERS and not ui.written(self.multipliers):
            gains = self.profile.multipliers(usual_setting(self.profile))
            begin = ",".join(f"{gain:.4g}" for gain in gains / gains[1])
            self.multipliers.param.update(value=begin, value_input=begin)

    def set(self, selector: Selector) -> None:
        """Set the settings of a photograph: by its preset, where it has one of those offered, else as it was shot."""
        preset = selector.white_balance in self.balance.options.values()
        self.style.value, self.tint.value = selector.style, 0
        self.balance.value = selector.white_balance if preset else AS_SHOT

    def text(self, taken: Selector | None) -> str:
        """The selector, STYLE/WB. Raises WorkspaceError where it is not complete, SettingsError."""
        style, tint = self.style.value, 0.0 if self.tint.disabled else self.tint.value
        if self.balance.value == AS_SHOT and taken is None:
            raise WorkspaceError("the photograph does not tell its white balance: choose one")
        plain = {
            AS_SHOT: "" if taken is None else f"{taken.white_balance}",
            BY_TEMPERATURE: f"{self.kelvin.value:g}K",
            BY_MULTIPLIERS: ui.written(self.multipliers),
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
        self._known: tuple[CameraProfile, Selector] | None = None  # what the coverage is of
        self.listed, self.path = ui.select("Photograph in the folders", ui.NOTHING), ui.entry("or its path")
        opening = session.button(
            "Show", lambda: self._open(session.folders.inside(ui.written(self.path) or self.listed.value)),
            variant="contained", **ui.WIDE,
        )  # fmt: skip
        self.wanted, self.source = SettingControl("Wanted"), SettingControl("Taken as", asks=True)
        self.ev = ui.slider("Exposure, EV", 0.0, -3.0, 3.0, 0.05)
        wanted = (self.ev, *self.wanted.widgets)
        session.watch(self._change, *wanted, take=lambda value: setattr(session, "look_chosen", True))
        session.watch(self._change, *self.source.widgets)
        self.words = ui.text()
        self.main = self.view = LookView()
        self.controls = [
            self.listed, self.path, opening, self.words, self.wanted.layout, self.ev, self.source.layout,
        ]  # fmt: skip

    def refresh(self) -> None:
        """The settings of the session's profile, and the look with it."""
        names = self.session.folders.files(IMAGE_SUFFIXES)
        self.listed.options = {**ui.NOTHING, **{name: name for name in names}}
        if self.session.profile is None:
            self.words.object = ui.paragraphs("Compute a model, or open a profile.")
            return
        for control in (self.wanted, self.source):
            control.offer(self.session.profile)
        self._grade()

    def _open(self, path: Path) -> None:
        profile = self.session.require_profile()
        self.session.start(f"opening {path.name}", self._show, open_photograph, path, profile, short=True)

    def _show(self, photograph: Photograph) -> None:
        path, given = photograph.path, photograph.selector
        self.shown = replace(photograph, picture=b"")
        self.view.show(photograph.picture, path.name)
        news = f"{path.name} does not tell how it was taken: choose that under “Taken as” below"
        with self.session.setting():
            if given is not None:
                self.source.style.value, self.source.balance.value = given.style, AS_SHOT
                news = f"{path.name}: taken as {given}, as its metadata say"
                if not self.session.look_chosen:
                    self.wanted.set(given)
            else:
                self.source.style.value, self.source.balance.value, self.source.tint.value = photograph.style, "", 0
        self.session.say("; ".join([news, *photograph.notes]))
        self._change()

    def _change(self) -> None:
        for control in (self.wanted, self.source):
            control.enable()
        self._grade()

    def _tell(self) -> None:
        """The words of the look."""
        look = self.session.look
        unknown = "" if self.shown is None else "From what it was taken as, which is to be chosen below, to "
        taken = f"From {look.source} to " if look.source else unknown or "Wanted: "
        self.words.object = ui.paragraphs(f"{taken}{look.target}, {look.ev:+g} EV.")
        self.session.on_look()

    def _grade(self) -> None:
        """The photograph as the controls say."""
        profile, taken = self.session.profile, None if self.shown is None else self.shown.selector
        if profile is None:
            return
        known = bool(self.source.style.value and self.source.balance.value)
        try:
            look = ChosenLook(self.source.text(taken) if known else "", self.wanted.text(taken), float(self.ev.value))
            slow = slow_steps(profile, look) if known else ()
            if slow and not self.session.is_busy:
                self.session.start(BAKING, partial(self._baked, profile, slow), baked_steps, slow, short=True)
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
        self.session.chosen = look
        self._tell()

    def _baked(self, profile: CameraProfile, steps: Sequence[Transform], luts: Sequence[Lut]) -> None:
        for step, lut in zip(steps, luts, strict=True):
            grades_of(profile).add(step, lut)
        self._grade()


@lru_cache(4)
def grades_of(profile: CameraProfile) -> BakedGrades:
    """The baked steps of a profile, kept between changes of the look."""
    return BakedGrades()


def change_of(profile: CameraProfile, look: ChosenLook) -> SettingChange:
    """What a look changes. Raises SettingsError."""
    return SettingChange(profile, profile.selector(look.source), profile, profile.selector(look.target), look.ev)


def slow_steps(profile: CameraProfile, look: ChosenLook) -> tuple[Transform, ...]:
    """The steps of a look that take seconds to bake, and are not baked yet. Raises SettingsError."""
    return grades_of(profile).slow_steps(change_of(profile, look).transform)


def look_lut(profile: CameraProfile, look: ChosenLook) -> Lut | None:
    """The LUT that `apply` grades with; None where the look changes nothing. Raises SettingsError."""
    change = change_of(profile, look)
    same = not look.ev and str(change.source) == str(change.target)
    return None if same else grades_of(profile).refinish(change)


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
            values, kind = op.outputs, {"kind": "curve", "low": op.low, "high": op.high}
        case Cube():
            values, kind = op.values, {"kind": op.interpolation}
        case _:
            raise LutError("LUT: the page has no curves at free knots; bake the transform anew")
    table, size = np.ascontiguousarray(values, dtype=np.float32).tobytes(), list(values.shape[:-1])
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
    scopes = param.Boolean(True, doc="The waveform beside the picture.")
    kept = param.Integer(0)

    _debounce = 8  # ms; what the page changes is told so late
    _esm = "\n".join((ui.HERE / name).read_text(encoding="utf-8") for name in ("grading.js", "look.js"))
    _stylesheets = [(ui.HERE / "look.css").read_text(encoding="utf-8")]  # noqa: RUF012 - Panel's own way to declare it

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"sizing_mode": "stretch_both", "min_height": 320, "margin": 0, **options})
        self._luts: dict[str, Lut | None] = {"a": None, "b": None, "coverage": None}
        self._tables: dict[str, dict[str, Any]] = {}  # of those LUTs, by their keys
        self.param.watch(
            lambda event: self._set("b", self._luts["a"], b_name=self.a_name or "kept", beside_b=bool(self.a)), "kept"
        )

    def show(self, picture: bytes, title: str = "") -> None:
        """Show another picture, a JPEG or PNG file, with the look that is set."""
        self.param.update(picture=picture, title=title)

    def grade(self, lut: Lut | None, name: str = "") -> None:
        """Set the look, a LUT of the picture's encoded RGB, or none. Raises LutError on curves at free knots."""
        self._set("a", lut, number=self.number + 1, a_name=name)

    def cover(self, coverage: Lut | None) -> None:
        """Set what `unsure` marks, a LUT of the picture's encoded RGB, or none."""
        self._set("coverage", coverage)

    def _set(self, side: str, lut: Lut | None, **more: Any) -> None:
        """Set a LUT, with other parameters; the page gets the tables that it has not."""
        sides = {name: ([], {}) if one is None else packed(one) for name, one in {**self._luts, side: lut}.items()}
        self._luts[side] = lut
        sent, self._tables = self._tables, {key: table for _, tables in sides.values() for key, table in tables.items()}
        self._handle_msg([key for key in self._tables if key not in sent])
        self.param.update(**more)
        self.param.update(**{side: sides[side][0]})  # at which the page draws

    def _handle_msg(self, data: Any) -> None:
        """Send the tables of these keys, which the page misses."""
        tables = [self._tables[key] for key in data if key in self._tables]
        if tables:
            self._send_msg(tables)
