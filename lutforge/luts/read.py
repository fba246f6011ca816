"""Read a LUT file of any kind, ours or a stranger's: contents or one clear error, whatever the bytes are.

Sizes are checked before anything is made of them.
"""

from collections.abc import Callable
from pathlib import Path

from lutforge.errors import LutError
from lutforge.luts.contents import LutContents
from lutforge.luts.formats import csp, cube, hald, houdini, process_list, spi, threedl, truelight

MAX_BYTES = 128 * 1024 * 1024
"""Largest file that is read: a 129³ cube as text takes about 70 MB."""


def read_lut(path: str | Path) -> LutContents:
    """Read a LUT file; the suffix says which kind. Raises LutError: file, line, text and cause in one line."""
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; known: {", ".join(READERS)}')
    try:
        if path.is_dir():
            raise LutError(f"{path}: a folder, not a LUT file")
        size = path.stat().st_size
        if size == 0:
            raise LutError(f"{path}: the file is empty")
        if size > MAX_BYTES:
            raise LutError(f"{path}: {size / 2**20:.0f} MB, too large for a LUT (up to {MAX_BYTES >> 20} MB)")
        data = path.read_bytes()
    except OSError as error:
        raise LutError(f"{path}: {error.strerror or 'cannot be opened'}") from error
    return reader(path, data)


READERS: dict[str, Callable[[Path, bytes], LutContents]] = {
    ".cube": cube.read,
    ".clf": process_list.read,
    ".ctf": process_list.read,
    ".csp": csp.read,
    ".3dl": threedl.read,
    ".cub": truelight.read,
    ".lut": houdini.read,
    ".spi1d": spi.read_spi1d,
    ".spi3d": spi.read_spi3d,
    ".png": hald.read,
    ".tif": hald.read,
    ".tiff": hald.read,
}
