"""What a batch has done, in its output folder: `--resume` skips what is recorded there and still true."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from lutforge.errors import ImageError

NAME = ".lutforge-apply.jsonl"
"""The journal's name in the output folder: one JSON object per line and graded image, the last one counts."""


@dataclass(frozen=True)
class FileIdentity:
    """Which content a file has. path: absolute; time_ns: of its last change; sha256: "" where it was not read."""

    path: str
    size: int
    time_ns: int
    sha256: str = ""

    def still_true(self) -> bool:
        """True where the file has this content still: same size and time, or same size and hash."""
        try:
            now = Path(self.path).stat()
            if now.st_size != self.size:
                return False
            return now.st_mtime_ns == self.time_ns or (self.sha256 != "" and _sha256(Path(self.path)) == self.sha256)
        except OSError:
            return False


@dataclass(frozen=True)
class Record:
    """An image that was graded. recipe: the recipe's key."""

    recipe: str
    source: FileIdentity
    output: FileIdentity

    def still_true(self, recipe: str, source: Path, output: Path) -> bool:
        """True where this recipe was applied to this source, which has not changed since, and the output is whole."""
        return (
            self.recipe == recipe
            and self.source.path == str(source.absolute())
            and self.output.path == str(output.absolute())
            and self.source.still_true()
            and self.output.still_true()
        )


def identify_source(path: Path) -> FileIdentity:
    """A source as it is now. Raises ImageError."""
    try:
        now = path.stat()
    except OSError as error:
        raise ImageError(f"{path}: {'no such file' if not path.exists() else error.strerror}") from error
    return FileIdentity(str(path.absolute()), now.st_size, now.st_mtime_ns)


def identify_output(path: Path) -> FileIdentity:
    """An output that was just written, read back. Raises ImageError."""
    try:
        now = path.stat()
        return FileIdentity(str(path.absolute()), now.st_size, now.st_mtime_ns, _sha256(path))
    except OSError as error:
        raise ImageError(f"{path}: cannot be read back ({error.strerror})") from error


def read_journal(folder: Path) -> Mapping[str, Record]:
    """The last record of each output, by its absolute path; lines that a killed run cut are left out."""
    records = {}
    try:
        lines = (folder / NAME).read_bytes().splitlines()
    except OSError:
        return {}
    for line in lines:
        try:
            entry = json.loads(line)
            record = Record(entry["recipe"], FileIdentity(**entry["source"]), FileIdentity(**entry["output"]))
            records[record.output.path] = record
        except (ValueError, TypeError, KeyError, RecursionError):
            continue
    return records


def add_to_journal(folder: Path, record: Record) -> None:
    """Append a record in one write, so that runs that share a folder do not mix their lines. Raises OSError."""
    # The line break in front ends what a killed run may have left.
    line = b"\n" + json.dumps(asdict(record)).encode() + b"\n"
    handle = os.open(folder / NAME, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        if os.write(handle, line) != len(line):
            raise OSError(None, "the disk is full")
    finally:
        os.close(handle)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
