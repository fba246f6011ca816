"""The jobs of a batch: an image to grade, its outcome, and the record of its files by which a batch resumes."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import ImageError, LutForgeError
from lutforge.grading.grade import Recipe
from lutforge.grading.image import REGION_SAMPLES, GradedImage, apply_image
from lutforge.grading.inputs import Failure


@dataclass(frozen=True)
class Job:
    """An image to grade, and its output."""

    source: Path
    target: Path


@dataclass(frozen=True)
class FileIdentity:
    """The identity of a file's content. path: absolute; time_ns: of its last change; sha256: "" where not computed."""

    path: str
    size: int
    time_ns: int
    sha256: str = ""

    def is_unchanged(self) -> bool:
        """True where the file still has this content: same size and time, or same size and hash."""
        try:
            now = Path(self.path).stat()
            if now.st_size != self.size:
                return False
            return now.st_mtime_ns == self.time_ns or (self.sha256 != "" and _sha256(Path(self.path)) == self.sha256)
        except OSError:
            return False


@dataclass(frozen=True)
class Record:
    """The record of a graded image. recipe: the key of its recipe."""

    recipe: str
    source: FileIdentity
    output: FileIdentity

    def is_valid(self, recipe: str, source: Path) -> bool:
        """True where it is of this recipe and source, and neither the source nor the output has changed since."""
        is_of_job = self.recipe == recipe and self.source.path == str(source.absolute())
        return is_of_job and self.source.is_unchanged() and self.output.is_unchanged()


Outcome = tuple[GradedImage, Record] | Failure
"""The outcome of a job."""


def run_job(recipe: Recipe, job: Job, threads: int = 1, region_samples: int = REGION_SAMPLES) -> Outcome:
    """Grade an image. threads, region_samples: as for `apply_image`."""
    source = job.source
    try:
        before = _identify(source)
        grade = recipe.grade(source)
        graded = apply_image(grade, source, job.target, threads, region_samples)
        if _identify(source) != before:
            raise ImageError(f"{source}: it was changed while it was graded; grade it again")
        return graded, Record(recipe.key, before, _identify(job.target, written=True))
    except LutForgeError as error:
        return Failure(source, str(error))
    except MemoryError:
        return Failure(source, f"{source}: not enough memory for this image")
    except Exception as error:  # any error of a codec concerns this file only
        return Failure(source, f"{source}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")


def _identify(path: Path, written: bool = False) -> FileIdentity:
    """The present identity of a file, with its hash where it was just written. Raises ImageError."""
    try:
        now = path.stat()
        return FileIdentity(str(path.absolute()), now.st_size, now.st_mtime_ns, _sha256(path) if written else "")
    except OSError as error:
        reason = "no such file" if not path.exists() else error.strerror
        raise ImageError(f"{path}: {f'cannot be read back ({error.strerror})' if written else reason}") from error


def _sha256(path: Path) -> str:
    """The SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
