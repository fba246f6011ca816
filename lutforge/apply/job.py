"""One image of a batch, on this machine or on another: graded, or the reason why not; nothing is raised."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lutforge.apply.grade import Recipe
from lutforge.apply.image import REGION_SAMPLES, GradedImage, apply_image
from lutforge.apply.journal import Record, identify_output, identify_source
from lutforge.apply.jpeg import Canvases
from lutforge.errors import ImageError, LutForgeError


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
class Outcome:
    """What became of a job: `applied` and `record`, or `reason`, one line, why it failed."""

    job: Job
    applied: GradedImage | None = None
    record: Record | None = None
    reason: str = ""


def run_job(
    recipe: Recipe,
    job: Job,
    threads: int = 1,
    region_samples: int = REGION_SAMPLES,
    progress: Callable[[int, float], None] | None = None,
    canvases: Canvases | None = None,
) -> Outcome:
    """Grade an image. threads, region_samples, progress, canvases: as for `apply_image`."""
    source = job.source
    try:
        before = identify_source(source)
        grade = recipe.grade(source)
        applied = apply_image(grade, source, job.target, threads, region_samples, progress, job.quality, canvases)
        if identify_source(source) != before:
            raise ImageError(f"{source}: it was changed while it was graded; grade it again")
        record = Record(job.key(recipe), before, identify_output(job.target))
    except LutForgeError as error:
        return Outcome(job, reason=str(error))
    except MemoryError:
        return Outcome(job, reason=f"{source}: not enough memory for this image")
    except Exception as error:  # whatever a codec does with one file, the others are graded
        return Outcome(job, reason=f"{source}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
    return Outcome(job, applied, record)
