"""Read files of unknown origin: whatever fails in a reader, the caller gets one LutForgeError of one line.

Parsers raise many types on damaged files: zipfile alone raises eight, NumPy's header reader a TokenError,
Rust extensions a panic that is no Exception and prints forty lines. So every reader runs inside `reading`.
"""

import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lutforge.errors import LutForgeError, one_line

MAX_SAMPLES = 1_200_000_000
"""Largest width × height × channels that is read at once (400 Mpixel of RGB); larger claims are not allocated."""


@contextmanager
def reading(path: str | Path, kind: str, error: type[LutForgeError] = LutForgeError) -> Iterator[None]:
    """Turn every failure of a reader into one line of `error`: "PATH: cannot be read as KIND (reason)".

    kind: what the file should be, with its article: "a LUT", "a camera profile". Errors of LutForge pass, with the path
    before them where they do not name the file; a user's interrupt and SystemExit pass as they are.
    """
    try:
        yield
    except LutForgeError as failure:
        if Path(path).name in str(failure):
            raise
        raise type(failure)(f"{path}: {failure}") from failure
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as failure:  # a panic of pyo3 derives from BaseException
        raise error(f"{path}: cannot be read as {kind} ({reason_of(failure)})") from failure


@contextmanager
def opened_archive(path: Path, error: type[LutForgeError]) -> Iterator[zipfile.ZipFile]:
    """Open an untrusted zip file. Raises `error` where an entry is packed otherwise than plainly or by deflate.

    Python unpacks the other packings in parts of any size, whatever number of bytes is asked for.
    """
    with zipfile.ZipFile(path) as archive:
        if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in archive.infolist()):
            raise error("refused, its parts are packed otherwise than by deflate")
        yield archive


def read_entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """The bytes of an entry, never more than the size that it states: an entry that unpacks to more is cut there.

    `ZipFile.read` would unpack all of it before it compares the sizes.
    """
    with archive.open(name) as stream:
        return stream.read(archive.getinfo(name).file_size)


def reason_of(failure: BaseException) -> str:
    """The reason of a failure, in one line of at most 160 printable characters."""
    match failure:
        case MemoryError():
            return "it asks for more memory than there is"
        case RecursionError():
            return "it is nested too deeply"
        case UnicodeError():
            return "it holds bytes that are not text"
        case OSError(strerror=str(words)):
            return words
    words = one_line(re.sub(r"^b'(.*)'$", r"\1", str(failure)), 160)  # rawpy's messages are the repr of bytes
    name = type(failure).__name__
    return f"{name}: {words}" if words and isinstance(failure, LookupError | AttributeError) else words or name


def path_of(path: object, kind: str = "a file or folder") -> Path:
    """Return a path or text as a path. Raises LutForgeError where it is neither; kind: of the file, for the message."""
    if not isinstance(path, str | Path):
        raise LutForgeError(f"{path!r:.80} is no path of {kind}")
    return Path(path)


def require_file(path: str | Path, kind: str, error: type[LutForgeError] = LutForgeError, most: int = 1 << 40) -> int:
    """Return the size of a regular file in bytes. Raises `error` if it is missing, a folder, unreadable or too large.

    An empty file is an error, too; too large means more than `most` bytes.
    """
    path = Path(path)
    try:
        str(path).encode()  # libraries that read images and LUTs open no other names
        if path.is_dir():
            raise error(f"{path}: is a folder, not {kind}; name a file in it")
        size = path.stat().st_size
        if not path.is_file():  # reading a pipe might never end
            raise error(f"{path}: not a regular file; copy it to a disk first")
        with path.open("rb") as file:
            file.read(1)
    except FileNotFoundError:
        raise error(f"{path}: no such file") from None
    except UnicodeEncodeError:
        raise error(f"{path}: its name is not text in UTF-8; rename it") from None
    except (OSError, ValueError) as failure:
        raise error(f"{path}: cannot be opened ({reason_of(failure)}); check the path") from failure
    if size == 0:
        raise error(f"{path}: the file is empty")
    if size > most:
        raise error(f"{path}: {size:,} bytes are more than {kind} has (up to {most:,}); is it another file?")
    return size
