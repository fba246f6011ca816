"""One image of a batch, on this machine or on another: graded, or the reason why not; nothing is raised.

What a batch has done is recorded in its output folder: `--resume` skips what is recorded there and still true.
"""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from lutforge.apply.grade import Recipe
from lutforge.apply.image import REGION_SAMPLES, GradedImage, apply_image
from lutforge.errors import ImageError, LutForgeError

JOURNAL = ".lutforge-apply.jsonl"
"""The journal's name in the output folder: one JSON object per line and graded image, the last one counts."""


@dataclass(frozen=True)
class Job:
    """An image to grade, and where it goes. quality: of a JPEG, by default its source's."""

    source: Path
    target: Path
    quality: int | None = None

    def key(self, recipe: Recipe) -> str:
        """A fingerprint of all that decides the result."""
        return recipe.key if self.quality is None else f"{recipe.key} in quality {self.quality}"


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
    """An image that was graded. recipe: the job's key."""

    recipe: str
    source: FileIdentity
    output: FileIdentity

    def still_true(self, recipe: str, source: Path) -> bool:
        """True where this recipe was applied to this source, which has not changed since, and the output is whole."""
        same = self.recipe == recipe and self.source.path == str(source.absolute())
        return same and self.source.still_true() and self.output.still_true()


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and why, in one line."""

    source: Path
    reason: str


Outcome = tuple[GradedImage, Record] | Failure
"""What became of a job."""


def run_job(
    recipe: Recipe,
    job: Job,
    threads: int = 1,
    region_samples: int = REGION_SAMPLES,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Grade an image. threads, region_samples, progress: as for `apply_image`."""
    source = job.source
    try:
        before = _identify(source)
        grade = recipe.grade(source)
        applied = apply_image(grade, source, job.target, threads, region_samples, progress, job.quality)
        if _identify(source) != before:
            raise ImageError(f"{source}: it was changed while it was graded; grade it again")
        return applied, Record(job.key(recipe), before, _identify(job.target, written=True))
    except LutForgeError as error:
        return Failure(source, str(error))
    except MemoryError:
        return Failure(source, f"{source}: not enough memory for this image")
    except Exception as error:  # whatever a codec does with one file, the others are graded
        return Failure(source, f"{source}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")


def read_journal(folder: Path) -> Mapping[str, Record]:
    """The last record of each output, by its absolute path; lines that a killed run cut are left out."""
    records = {}
    try:
        lines = (folder / JOURNAL).read_bytes().splitlines()
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
    handle = os.open(folder / JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        if os.write(handle, line) != len(line):
            raise OSError(None, "the disk is full")
    finally:
        os.close(handle)


def _identify(path: Path, written: bool = False) -> FileIdentity:
    """A file as it is now; one that was just written is read back. Raises ImageError."""
    try:
        now = path.stat()
        return FileIdentity(str(path.absolute()), now.st_size, now.st_mtime_ns, _sha256(path) if written else "")
    except OSError as error:
        reason = "no such file" if not path.exists() else error.strerror
        raise ImageError(f"{path}: {f'cannot be read back ({error.strerror})' if written else reason}") from error


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
