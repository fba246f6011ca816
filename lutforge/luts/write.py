"""Write a LUT to a file: the suffix picks the format, the program that will read it the dialect and the size.

A format that cannot hold a LUT's own form (no shaper, no curve behind the cube) gets one fitted to the same function in
the form that it can hold, where the LUT knows its function; otherwise the LUT is sampled. `Written` says what was lost.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from lutforge.atomic_write import atomic_path
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake
from lutforge.luts.dialects import DIALECTS, Dialect
from lutforge.luts.formats import clf, csp, cube_3d, cube_resolve, hald, houdini, spi, threedl, truelight
from lutforge.luts.lut import Lut
from lutforge.luts.sample_points import sample_points
from lutforge.model.transform import Transform

Form = Literal["whole", "shaper", "shared", "plain"]
"""What of a LUT a format holds: all of it; shaper and cube; one shaper for all axes and a cube; a uniform cube."""


@dataclass(frozen=True)
class Written:
    """What became a file. what_was_lost: "" where the file is the LUT to the precision of its numbers. lut: what the
    file holds, itself a LUT."""

    path: Path
    format: str
    what_was_lost: str = ""
    lut: Lut | None = field(default=None, repr=False)
    integers: bool = False


@dataclass(frozen=True)
class Format:
    """A kind of file. sizes: nodes per axis that it can have, where not all; size: of a cube made for it."""

    name: str
    form: Form
    writer: Callable[[Lut, Path], None]
    sizes: tuple[int, ...] = ()
    size: int = 65
    bits: int | None = None


FORMATS: dict[str, Format] = {
    ".clf": Format("CLF", "whole", clf.write),
    ".ctf": Format("CTF", "whole", clf.write),
    ".cube": Format(".cube, 3D only", "plain", cube_3d.write),
    ".csp": Format(".csp", "shaper", csp.write),
    ".cub": Format("Truelight .cub", "shaper", truelight.write),
    ".lut": Format("Houdini .lut", "shared", houdini.write),
    ".3dl": Format(".3dl", "plain", threedl.write, threedl.SIZES, 33, 12),
    ".png": Format("Hald image", "plain", hald.write, hald.SIZES, 64, 16),
    ".tif": Format("Hald image", "plain", hald.write, hald.SIZES, 64, 16),
    ".tiff": Format("Hald image", "plain", hald.write, hald.SIZES, 64, 16),
    ".spi1d": Format(".spi1d (shaper) and .spi3d (cube), to be used one after the other", "shaper", spi.write_spi3d),
    ".spi3d": Format(".spi1d (shaper) and .spi3d (cube), to be used one after the other", "shaper", spi.write_spi3d),
}
HOLD_RANGES = (cube_resolve.write, csp.write, spi.write_spi3d)
"""Writers of formats whose shaper may begin or end anywhere."""
RESOLVE = Format(".cube with a shaper (Resolve, OpenColorIO)", "shaper", cube_resolve.write)

SUFFIXES = tuple(FORMATS)


SHAPER_ENDINGS = (".resolve.cube", ".shaper.cube")
"""Names that ask for a .cube with a shaper by themselves."""


_NO_SCENES = "{} holds no scene-linear input beyond 1; write .clf, .ctf, .resolve.cube, .csp or .spi1d"


def write_lut(lut: Lut, path: str | Path, dialect: str | None = None, size: int | None = None) -> Written:
    """Write a LUT, atomically and with the same bytes for the same LUT.

    .clf, .ctf: everything, exactly. .cube: the plain 3D form that every program reads, a uniform cube of `size` nodes;
    with a dialect that reads a shaper, or a name that ends in .resolve.cube or .shaper.cube: shaper + cube, gain and
    matrix folded in. .png, .tif: a Hald image. .spi1d and .spi3d: both files at once. The others as `FORMATS` has them.
    Raises LutError on an unknown suffix or dialect, and where the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    form, program = _chosen_form(path, dialect)
    held, lost = _in_form(lut, form, program, size)
    if suffix in (".spi1d", ".spi3d"):
        _write(held, path.with_suffix(".spi1d"), spi.write_spi1d)
    writer, name = form.writer, form.name
    if form is RESOLVE and held.is_uniform:
        writer, name = cube_3d.write, FORMATS[".cube"].name
    if FORMATS[suffix].form == "plain" and writer is not cube_resolve.write:
        name += f", {held.size} nodes per axis"
    _write(held, path.with_suffix(".spi3d") if suffix == ".spi1d" else path, writer)
    if form.bits is not None:
        lost = "; ".join(part for part in (lost, f"{form.bits} bits per channel, clamped to [0, 1]") if part)
    return Written(path, name, lost, held, form.bits is not None)


def require_form(path: Path, dialect: str | None, size: int | None, scenes: bool) -> None:
    """Raise LutError where a LUT cannot become this file, before it is baked. scenes: its input reaches beyond 1."""
    form, program = _chosen_form(path, dialect)
    if scenes and form.form != "whole" and form.writer not in HOLD_RANGES:
        raise LutError(f"{path}: {_NO_SCENES.format(form.name)}")
    if size is not None and form.form == "plain" and not scenes:
        _require_size(form, program, size, f"{path}: ")


def _chosen_form(path: Path, dialect: str | None) -> tuple[Format, Dialect | None]:
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {", ".join(SUFFIXES)}')
    if dialect is not None and dialect not in DIALECTS:
        raise LutError(f'unknown dialect "{dialect}"; known: {", ".join(DIALECTS)}')
    program = DIALECTS[dialect] if dialect else None
    if program is not None and suffix not in program.reads:
        raise LutError(f"{path}: {dialect} does not read {suffix} files; write {' or '.join(program.reads)}")
    takes_shaper = program.shaper if program else path.name.lower().endswith(SHAPER_ENDINGS)
    return (RESOLVE if suffix == ".cube" and takes_shaper else FORMATS[suffix]), program


def _require_size(form: Format, program: Dialect | None, size: int, where: str = "") -> None:
    limit = program.max_size if program else 129
    if not 2 <= size <= limit:
        raise LutError(f"{where}{size} nodes per axis; this reader takes 2 to {limit}")
    if form.sizes and size not in form.sizes:
        sizes = ", ".join(map(str, form.sizes))
        raise LutError(f"{where}{size} nodes per axis; {form.name} has {sizes}: choose --size among them, or none")


def bake_for(
    transform: Transform,
    path: str | Path,
    dialect: str | None = None,
    size: int | None = None,
    *,
    tolerance: float | None = None,
    display_referred: bool = True,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Written:
    """Bake a transform for one program and file: its interpolation, form and size; the arguments as `bake` has them.

    Raises LutError as `bake` and `write_lut` do.
    """
    if dialect is not None and dialect not in DIALECTS:
        raise LutError(f'unknown dialect "{dialect}"; known: {", ".join(DIALECTS)}')
    lut = bake(
        transform,
        size,
        tolerance=tolerance,
        interpolation=DIALECTS[dialect].interpolation if dialect else None,
        display_referred=display_referred,
        title=title,
        comments=comments,
    )
    return write_lut(lut, path, dialect, size)


def largest_difference(a: Lut, b: Lut) -> float:
    """The largest difference of any channel over points that are dense where either LUT bends."""
    x = np.concatenate([sample_points(lut.levels, lut.gain) for lut in (a, b)])
    return float(np.abs(a(x) - b(x)).max())


def _in_form(lut: Lut, form: Format, program: Dialect | None, size: int | None) -> tuple[Lut, str]:
    """The LUT as this format can hold it, and what that costs."""
    if form.form == "whole":
        return lut, ""
    if lut.is_for_scenes:
        return _for_scenes(lut, form)
    if form.form == "shaper":
        return _with_shaper(lut)
    if form.form == "shared":
        return _with_one_shaper(lut)
    wanted = size or (lut.size if lut.is_uniform and lut.response is None else (program.size if program else form.size))
    if form.sizes and size is None:
        wanted = min(form.sizes, key=lambda known: (abs(known - wanted), known))
    _require_size(form, program, wanted)
    return _uniform(lut, wanted, program.interpolation if program else lut.interpolation)


def _for_scenes(lut: Lut, form: Format) -> tuple[Lut, str]:
    """A LUT of scene-linear light as a shaper on 0 to the highest value, and a cube."""
    if form.writer not in HOLD_RANGES or lut.lowest:
        raise LutError(_NO_SCENES.format(form.name))
    if lut.before is None:
        return lut.folded(), ""
    fitted = _fitted(lut, lut.size, lut.interpolation, response=False)
    return fitted, f"no matrix in front: inputs from 0 to {fitted.highest:.4g}, negative ones become 0; fitted so"


def _with_shaper(lut: Lut) -> tuple[Lut, str]:
    lost = ""
    if lut.response is not None:
        if lut.source is None:
            return _uniform(lut, 65, lut.interpolation)
        lut, lost = (
            _fitted(lut, lut.size, lut.interpolation, response=False),
            "no response behind the cube: fitted without",
        )
    folded = lut.folded()
    if not lut.has_gain:
        return folded, lost
    difference = largest_difference(lut, folded)
    note = f"white balance folded into the shaper, largest difference {difference:.2g}"
    return folded, "; ".join(part for part in (lost, note) if part)


def _with_one_shaper(lut: Lut) -> tuple[Lut, str]:
    same = lut.curve is None and lut.response is None and np.all(lut.gain == lut.gain[0])
    if same and all(np.array_equal(axis, lut.levels[0]) for axis in lut.levels):
        return _with_shaper(lut)
    if lut.source is None:
        return _uniform(lut, 65, lut.interpolation)
    fitted = _fitted(lut, lut.size, lut.interpolation, response=False, shared=True)
    return fitted.folded(), "one shaper for all channels: fitted so"


def _uniform(lut: Lut, size: int, interpolation: Interpolation) -> tuple[Lut, str]:
    if lut.is_uniform and not lut.has_gain and lut.response is None and size == lut.size:
        return lut.without_shaper(size), ""
    if lut.source is not None:
        plain = _fitted(lut, size, interpolation, shaper=False)
        how = "fitted by"
    else:
        plain, how = lut.without_shaper(size), "sampled on"
    difference = largest_difference(lut, plain)
    return plain, f"no shaper: {how} a uniform {size}³ cube, largest difference {difference:.2g}"


def _fitted(
    lut: Lut, size: int, interpolation: Interpolation, shaper: bool = True, response: bool = True, shared: bool = False
) -> Lut:
    """The LUT's own function, fitted for another form."""
    if lut.source is None:
        raise LutError("a LUT without its source function cannot be fitted again")
    fitted = bake(
        lut.source, size, interpolation=interpolation, shaper=shaper, response=response, shared=shared, title=lut.title
    )
    return replace(fitted, comments=lut.comments)


def _write(lut: Lut, path: Path, writer: Callable[[Lut, Path], None]) -> None:
    with atomic_path(path) as temporary:
        writer(lut, temporary)
