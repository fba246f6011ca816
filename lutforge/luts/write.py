"""Write a LUT to a file: the suffix picks the format, the dialect what the reader takes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.atomic_write import atomic_path
from lutforge.errors import LutError
from lutforge.luts.formats import clf, cube_3d, cube_resolve, spi
from lutforge.luts.lut import Lut
from lutforge.luts.sample_points import sample_points


@dataclass(frozen=True)
class Written:
    """What became a file. what_was_lost: "" where the file is the LUT to the precision of its numbers."""

    path: Path
    format: str
    what_was_lost: str = ""


@dataclass(frozen=True)
class Dialect:
    """What a program takes. shaper: reads a .cube with a shaper; max_size: most nodes per axis."""

    shaper: bool
    max_size: int = 129
    size: int = 65


DIALECTS: dict[str, Dialect] = {
    "resolve": Dialect(shaper=True),
    "nuke": Dialect(shaper=True),
    "ocio": Dialect(shaper=True),
    "oiio": Dialect(shaper=True),
    "photoshop": Dialect(shaper=False),
    "lightroom": Dialect(shaper=False),
    "premiere": Dialect(shaper=False),
    "aftereffects": Dialect(shaper=False, max_size=64, size=64),
    "finalcut": Dialect(shaper=False),
    "affinity": Dialect(shaper=False),
    "ffmpeg": Dialect(shaper=False),
    "mlt": Dialect(shaper=False),
    "obs": Dialect(shaper=False),
    "darktable": Dialect(shaper=False),
    "rawtherapee": Dialect(shaper=False),
    "gmic": Dialect(shaper=False),
}
"""Programs that `--for` names, and what their readers of .cube do."""

SHAPER_ENDINGS = (".resolve.cube", ".shaper.cube")
"""Names that ask for a .cube with a shaper by themselves."""

SUFFIXES = (".cube", ".clf", ".ctf", ".spi1d", ".spi3d")


def write_lut(lut: Lut, path: str | Path, dialect: str | None = None, size: int | None = None) -> Written:
    """Write a LUT, atomically and with the same bytes for the same LUT.

    .clf, .ctf: everything, exactly. .cube: the plain 3D form that every program reads, sampled on a uniform
    cube of `size` nodes where the LUT is not one; with dialect "resolve", "nuke" or "ocio", or a name that
    ends in .resolve.cube or .shaper.cube: shaper + cube, gain and matrix folded in. .spi1d and .spi3d: both
    files at once. Raises LutError on an unknown suffix or dialect, and where the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {", ".join(SUFFIXES)}')
    if dialect is not None and dialect not in DIALECTS:
        raise LutError(f'unknown dialect "{dialect}"; known: {", ".join(DIALECTS)}')
    if suffix in clf.FORMATS:
        return _write(lut, path, suffix[1:].upper(), clf.write)
    folded, lost = _folded(lut)
    if suffix in (".spi1d", ".spi3d"):
        return _write_spi(folded, path, lost)
    target = DIALECTS[dialect] if dialect else Dialect(shaper=path.name.lower().endswith(SHAPER_ENDINGS))
    if target.shaper and not folded.is_uniform:
        written = _write(folded, path, ".cube with a shaper (Resolve, OpenColorIO)", cube_resolve.write)
        return replace(written, what_was_lost=lost)
    plain, lost = _uniform(lut, size or (folded.size if folded.is_uniform else target.size), target.max_size)
    written = _write(plain, path, f".cube, 3D only, {plain.size} nodes per axis", cube_3d.write)
    return replace(written, what_was_lost=lost)


def largest_difference(a: Lut, b: Lut) -> float:
    """The largest difference of any channel over points that are dense where either LUT bends."""
    x = np.concatenate([sample_points(lut.levels, lut.gain) for lut in (a, b)])
    return float(np.abs(a(x) - b(x)).max())


def _folded(lut: Lut) -> tuple[Lut, str]:
    folded = lut.folded()
    if not lut.has_gain:
        return folded, ""
    difference = largest_difference(lut, folded)
    return folded, f"white balance folded into the shaper, largest difference {difference:.2g}"


def _uniform(lut: Lut, size: int, limit: int) -> tuple[Lut, str]:
    if not 2 <= size <= limit:
        raise LutError(f"{size} nodes per axis; this reader takes 2 to {limit}")
    plain = lut.without_shaper(size)
    if lut.is_uniform and not lut.has_gain and size == lut.size:
        return plain, ""
    difference = largest_difference(lut, plain)
    return plain, f"no shaper: sampled on a uniform {size}³ cube, largest difference {difference:.2g}"


def _write(lut: Lut, path: Path, form: str, writer: Callable[[Lut, Path], None]) -> Written:
    with atomic_path(path) as temporary:
        writer(lut, temporary)
    return Written(path, form)


def _write_spi(lut: Lut, path: Path, lost: str) -> Written:
    _write(lut, path.with_suffix(".spi1d"), "spi1d", spi.write_spi1d)
    _write(lut, path.with_suffix(".spi3d"), "spi3d", spi.write_spi3d)
    return Written(path, ".spi1d (shaper) and .spi3d (cube), to be used one after the other", lost)
