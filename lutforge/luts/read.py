"""Read a LUT file of any kind, ours or a stranger's: a LUT or one clear line, whatever the bytes are."""

from pathlib import Path

from lutforge.boundary import reading, require_file
from lutforge.errors import LutError
from lutforge.luts.sequence import Lut, format_of


def read_lut(path: str | Path) -> Lut:
    """Read a LUT file; the suffix says which kind. Raises LutError: file, line, text and cause in one line."""
    path = Path(path)
    file_format = format_of(path)
    require_file(path, "a LUT", LutError, 128 << 20)  # a 129³ cube as text takes about 70 MB
    with reading(path, f"a {path.suffix.lower()} LUT", LutError):
        try:
            return file_format.read(path, path.read_bytes())
        except LutError as error:
            raise error if str(path) in str(error) else LutError(f"{path}: {error}") from error
