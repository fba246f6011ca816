"""A job of a batch: one image to grade, what became of it, and which content its files had."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import ImageError, LutForgeError
from lutforge.grading.grade import Recipe
from lutforge.grading.image import REGION_SAMPLES, GradedImage, apply_image
from lutforge.grading.inputs import Failure


@dataclass(frozen=True)
class Job:
    """An image to grade, and where it goes."""

    source: Path
    target: Path


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
    """An image that was graded. recipe: its key."""

    recipe: str
    source: FileIdentity
    output: FileIdentity

    def still_true(self, recipe: str, source: Path) -> bool:
        """True where this recipe was applied to this source, which has not changed since, and the output is whole."""
        same = self.recipe == recipe and self.source.path == str(source.absolute())
        return same and self.source.still_true() and self.output.still_true()


Outcome = tuple[GradedImage, Record] | Failure
"""What became of a job."""


def run_job(recipe: Recipe, job: Job, threads: int = 1, region_samples: int = REGION_SAMPLES) -> Outcome:
    """Grade an image. threads, region_samples: as for `apply_image`."""
    source = job.source
    try:
        before = _identify(source)
        grade = recipe.grade(source)
        applied = apply_image(grade, source, job.target, threads, region_samples)
        if _identify(source) != before:
            raise ImageError(f"{source}: it was changed while it was graded; grade it again")
        return applied, Record(recipe.key, before, _identify(job.target, written=True))
    except LutForgeError as error:
        return Failure(source, str(error))
    except MemoryError:
        return Failure(source, f"{source}: not enough memory for this image")
    except Exception as error:  # whatever a codec does with one file, the others are graded
        return Failure(source, f"{source}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")


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
