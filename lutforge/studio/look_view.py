"""The view of a photograph with a look on it: the browser grades it, and gets LUTs but no pixels while sliders move."""

from collections.abc import Callable
from functools import lru_cache
from hashlib import blake2b
from typing import Any

import numpy as np
import param
from panel.custom import JSComponent

from lutforge.errors import LutError
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.studio import ui


def pack_lut(lut: Lut) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """The operations of a LUT as the page takes them, and their tables, float32, by a key of their content."""
    ops, tables = zip(*map(_pack_op, lut.ops), strict=True)
    return list(ops), {table["key"]: table for table in tables if table}


@lru_cache(32)
def _pack_op(op: Op) -> tuple[dict[str, Any], dict[str, Any]]:
    """An operation as the page takes it, and its table; an empty one where it has none."""
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
    a = param.List(doc="The look, as in `pack_lut`; empty: the picture as it is.")
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

    _debounce = 8  # ms by which the server learns of a change in the page later
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
        sides = {name: ([], {}) if of_side is None else pack_lut(of_side) for name, of_side in luts.items()}
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
