"""The view of a picture that the browser grades: Python sends LUTs, and no pixels while sliders move."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import param
from panel.custom import JSComponent
from PIL import Image, ImageOps

from lutforge.apply.blocks import apply_to_pixels
from lutforge.arrays import Array, Pixels
from lutforge.errors import LutError
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut

HERE = Path(__file__).parent


def packed(lut: Lut) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """The operations of a LUT as the page takes them, and their tables, float32, by a key of their content.

    Raises LutError on curves at free knots.
    """
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
            values, told = op.outputs, {"kind": "curve", "low": op.low, "high": op.high}
        case Cube():
            values, told = op.values, {"kind": op.interpolation}
        case _:
            raise LutError("LUT: the page has no curves at free knots; bake the transform anew")
    table, size = np.ascontiguousarray(values, dtype=np.float32).tobytes(), list(values.shape[:-1])
    key = f"{size} {blake2b(table, digest_size=16).hexdigest()}"
    return {**told, "size": size, "key": key}, {"key": key, "size": size, "table": table}


class LookView(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """A picture with a look on it: wipe, zoom, pipette, scopes, overlays, a second setting beside the first.

    `show` sets the picture, `grade` its look. The browser grades what is on the screen with WebGL2: each operation of
    the LUT becomes a line of a shader, which interpolates in float32 as OpenColorIO does, so that a page shows what
    `lut.processor()` gives, within rounding. A table is sent once, as bytes in a message, while any LUT holds it; the
    page asks for those that it misses. Where there is no WebGL2, `renderer` is "python": the picture is then
    graded here, averaged down to 2 million pixels, and sent as JPEG.

    Parameters that the page changes, too: mode, wipe, beside_b, clipping, unsure, scopes, chosen. Those that it alone
    sets: renderer; probe, the pixel under the pipette, while `raw_of` is set; kept, which counts "Keep as B" (`b`
    and `b_name` are then those of `a`).
    """

    picture = param.Bytes(doc="The picture as a file that browsers read, JPEG or PNG; it is shown upright.")
    title = param.String(doc="The picture's name.")
    a = param.List(doc="The look, as of `packed`; empty: the picture as it is.")
    b = param.List(doc="Another look, to compare with; empty: none.")
    coverage = param.List(doc="A LUT whose third channel is below 0.5 for colours that no sample tells of; or empty.")
    a_name = param.String(doc="What the look is called on the picture.")
    b_name = param.String(doc="What the other look is called.")
    a_picture = param.Bytes(doc="Without WebGL2: the picture with the look, as JPEG.")
    b_picture = param.Bytes(doc="The same with the other look.")
    number = param.Integer(0, doc="Counts the looks; the page says which one it shows in data-drawn.")
    mode = param.Selector(default="wipe", objects=["graded", "original", "wipe", "side"])
    wipe = param.Number(0.5, bounds=(0.0, 1.0), doc="Where the line is, as a share of the width.")
    beside_b = param.Boolean(False, doc="On the left is B; else the original.")
    clipping = param.Boolean(False, doc="Stripes over what clips in the graded picture.")
    unsure = param.Boolean(False, doc="Stripes over what `coverage` says no sample tells of.")
    scopes = param.Boolean(True, doc="Waveform and vectorscope beside the picture.")
    theme = param.Selector(default="dark", objects=["dark", "light"], doc="The surround is 18 % grey in both.")
    pictures = param.List(doc="The film strip: {name, thumbnail: bytes of a JPEG} each; shown from two on.")
    chosen = param.Integer(0, doc="Which of `pictures` is shown; watch it, and call `show`.")
    kept = param.Integer(0)
    renderer = param.Selector(default="", objects=["", "webgl", "python"])
    tells_raw = param.Boolean(False)
    probe = param.List(doc="(x, y) of the upright picture, and its codes there.")
    raw = param.List(doc="(x, y, R, G, B): RAW there.")
    raw_name = param.String("RAW")

    _debounce = 8  # ms; what the page changes is told so late
    _esm = "\n".join((HERE / name).read_text(encoding="utf-8") for name in ("grading.js", "look.js"))
    _stylesheets = [(HERE / "look.css").read_text(encoding="utf-8")]  # noqa: RUF012 - Panel's own way to declare it

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"sizing_mode": "stretch_both", "min_height": 320, "margin": 0, **options})
        self._luts: dict[str, Lut | None] = {"a": None, "b": None, "coverage": None}
        self._tables: dict[str, dict[str, Any]] = {}  # of those LUTs, by their keys
        self._raw_of: Callable[[Array], Array] | None = None
        self.param.watch(self._keep, "kept")
        self.param.watch(self._probe, "probe")
        self.param.watch(lambda *events: self._grade_here(), ["renderer", "clipping", "unsure"])

    def show(self, picture: bytes, title: str = "") -> None:
        """Show another picture, a JPEG or PNG file, with the look that is set."""
        self.param.update(picture=picture, title=title, raw=[], probe=[])
        self._grade_here()

    def grade(self, lut: Lut | None, name: str = "") -> None:
        """Set the look, a LUT of the picture's encoded RGB, or none.

        Raises LutError on curves at free knots.
        """
        self._set("a", lut, number=self.number + 1, a_name=name)

    def compare(self, lut: Lut | None, name: str = "") -> None:
        """Set the other look, B; none takes it away."""
        self._set("b", lut, b_name=name, beside_b=lut is not None)

    def cover(self, lut: Lut | None) -> None:
        """Set what `unsure` marks: a LUT of the picture's encoded RGB, see `coverage`; none takes it away."""
        self._set("coverage", lut)

    def _set(self, side: str, lut: Lut | None, **more: Any) -> None:
        """Set a LUT, with other parameters; the page gets the tables that it has not."""
        sides = {name: ([], {}) if one is None else packed(one) for name, one in {**self._luts, side: lut}.items()}
        self._luts[side] = lut
        held, self._tables = self._tables, {key: table for _, tables in sides.values() for key, table in tables.items()}
        self._send([key for key in self._tables if key not in held])
        self.param.update(**more)
        self.param.update(**{side: sides[side][0]})  # at which the page draws
        self._grade_here()

    def _send(self, keys: list[str]) -> None:
        tables = [self._tables[key] for key in keys if key in self._tables]
        if tables and self.renderer != "python":
            self._send_msg(tables)

    def _handle_msg(self, data: Any) -> None:
        self._send(data)  # the keys of tables that the page misses

    def film(self, pictures: Sequence[tuple[str, bytes]], chosen: int = 0) -> None:
        """Set the film strip: a name and a small JPEG each."""
        strip = [{"name": name, "thumbnail": thumbnail} for name, thumbnail in pictures]
        self.param.update(pictures=strip, chosen=chosen)

    @property
    def raw_of(self) -> Callable[[Array], Array] | None:
        """Encoded RGB of the picture (3,) → RAW (3,), for the pipette, which calls it `raw_name`; or none."""
        return self._raw_of

    @raw_of.setter
    def raw_of(self, function: Callable[[Array], Array] | None) -> None:
        self._raw_of, self.tells_raw, self.raw = function, function is not None, []

    def _keep(self, event: Any) -> None:
        self.compare(self._luts["a"], self.a_name or "kept")

    def _probe(self, event: Any) -> None:
        if self._raw_of is not None and len(self.probe) == 5:
            x, y, *codes = (int(value) for value in self.probe)
            self.raw = [x, y, *map(float, self._raw_of(np.array(codes) / 255.0))]

    def _grade_here(self) -> None:
        if self.renderer != "python" or not self.picture:
            return
        pixels, cover = _small(self.picture), self._luts["coverage"] if self.unsure else None
        made = {f"{side}_picture": _jpeg(self._luts[side], pixels, self.clipping, cover) for side in ("a", "b")}
        self.param.update(**made)


@lru_cache(1)
def _small(picture: bytes) -> Pixels:
    with Image.open(BytesIO(picture)) as file:
        file.draft("RGB", (1732, 1732))  # a JPEG is decoded at a fraction of its size
        upright = ImageOps.exif_transpose(file.convert("RGB"))
    upright.thumbnail((1732, 1732))
    return np.asarray(upright, dtype=np.float32) / np.float32(255)


def _jpeg(lut: Lut | None, pixels: Pixels, clipping: bool, coverage: Lut | None) -> bytes:
    """A picture through a LUT, with stripes over what clips, and over what `coverage` is unsure of, as the page's."""
    if lut is None:
        return b""
    graded = apply_to_pixels(lut.processor(), pixels)
    codes = (np.clip(graded, 0.0, 1.0) * np.float32(255) + np.float32(0.5)).astype(np.uint8)
    stripe = np.add.outer(*map(np.arange, codes.shape[:2])) // 4 % 2 == 1
    white, black = (codes == 255).any(axis=2) & ~stripe & clipping, (codes == 0).any(axis=2) & ~stripe & clipping
    if coverage is not None:
        codes[stripe & (apply_to_pixels(coverage.processor(), pixels)[..., 2] < 0.5)] = (0, 158, 115)
    codes[black], codes[white] = (94, 60, 153), (230, 97, 1)
    buffer = BytesIO()
    Image.fromarray(codes).save(buffer, format="JPEG", quality=95, subsampling=0)
    return buffer.getvalue()
