"""Grade many images by one recipe; an image that fails is reported, and the others go on."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.grade import Recipe
from lutforge.apply.image import REGION_SAMPLES, GradedImage
from lutforge.apply.inputs import Input
from lutforge.apply.job import Job, Outcome, run_job
from lutforge.apply.journal import add_to_journal, read_journal
from lutforge.apply.jpeg import Canvases
from lutforge.atomic_write import remove_temporaries
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif
from lutforge.shots.discover import RAW_SUFFIXES


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and why, in one line."""

    source: Path
    reason: str


@dataclass(frozen=True)
class BatchResult:
    """Every input is in one of the three. skipped: the outputs that an earlier run made, and that are still right."""

    done: tuple[GradedImage, ...]
    failed: tuple[Failure, ...]
    skipped: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Progress:
    """How far a batch is. share: of the work, in [0, 1]; pixels: graded so far; source: the image finished last."""

    images: int
    total: int
    pixels: int
    share: float
    seconds: float
    source: Path | None


Report = Callable[[Progress], None]
"""Called, in the calling thread, after each image and a few times a second."""


def apply_batch(
    recipe: Recipe,
    images: Sequence[Input | str | Path],
    folder: str | Path,
    suffix: str | None = None,
    workers: int | None = None,
    progress: Report | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    quality: int | None = None,
) -> BatchResult:
    """Grade images into a folder under their own names; each output is written whole or not at all.

    suffix: such as ".exr", for another format. workers: threads, by default one per core. resume: what an earlier run
    did by this recipe is skipped where neither the source nor the output has changed since. scheduler: the address of a
    Dask cluster that does the work. quality: as of `apply_image`. Raises ImageError where two inputs would become one
    output or an output would replace an input, LutForgeError where the recipe is wrong for all images; then nothing is
    written.
    """
    folder = Path(folder)
    inputs = [image if isinstance(image, Input) else Input(Path(image), Path(Path(image).name)) for image in images]
    inputs, repeated = _without_repetitions(inputs)
    jobs = plan_jobs(inputs, folder, suffix, quality)
    recipe.check()
    remove_temporaries(job.target for job in jobs)
    already = _already_done(recipe, jobs, folder) if resume else set()
    left = [job for job in jobs if job not in already]
    tally = _Tally(len(jobs), len(already), report=progress)
    outcomes: dict[Job, Outcome] = {}
    notes = [f"{source}: given twice; graded once" for source in dict.fromkeys(repeated)]
    if scheduler is None:
        running = _run_here(recipe, left, workers or os.cpu_count() or 1, tally)
    else:
        from lutforge.apply.cluster import run_on_cluster  # loads Dask

        running = run_on_cluster(scheduler, recipe, left)
    for outcome in running:
        if outcome is None:
            tally.tell(None)
            continue
        outcomes[outcome.job] = outcome
        if outcome.record is not None:
            try:
                add_to_journal(folder, outcome.record)
            except OSError as error:
                notes.append(f"{outcome.job.target}: graded, but --resume will not know of it ({error.strerror})")
        if scheduler is not None and outcome.applied is not None:
            tally.add(outcome.applied.width * outcome.applied.height, 1.0)
        tally.finish(outcome.job.source)
    failed = [Failure(job.source, outcomes[job].reason) for job in left if outcomes[job].applied is None]
    return BatchResult(
        tuple(applied for job in left if (applied := outcomes[job].applied) is not None),
        tuple(failed),
        tuple(job.target for job in jobs if job in already),
        tuple(notes),
    )


def plan_jobs(
    inputs: Sequence[Input],
    folder: Path,
    suffix: str | None = None,
    quality: int | None = None,
) -> list[Job]:
    """Choose where each image is written.

    Raises ImageError where two would share a place, where an output is an input, and on what is no suffix.
    """
    if suffix is not None and not suffix.startswith("."):
        suffix = f".{suffix}"
    if suffix is not None and Path(f"x{suffix}").suffix != suffix:
        raise ImageError(f'"{suffix}" is no suffix of an image; write for example .png')
    jobs = []
    for image in inputs:
        raw = image.place.suffix.lower() in RAW_SUFFIXES
        chosen = suffix or (".jpg" if raw or is_heif(image.place) else image.place.suffix)
        jobs.append(Job(image.path, folder / image.place.with_suffix(chosen), quality))
    resolved = _resolver()
    sources = {resolved(job.source) for job in jobs}
    seen: dict[str, Path] = {}
    for job in jobs:
        place = resolved(job.target)
        if place in sources:
            raise ImageError(f"{job.target}: the output would replace an input; choose another folder")
        # Some file systems do not tell upper from lower case.
        other = seen.setdefault(str(place).lower(), job.source)
        if other is not job.source:
            raise ImageError(f"{job.source} and {other} would both become {job.target}; grade them into two folders")
    return jobs


def _without_repetitions(inputs: Sequence[Input]) -> tuple[list[Input], list[Path]]:
    """The inputs, each once, and the paths of those that were given again: the same file, to become the same output.

    Links with names of their own are images of their own.
    """
    first: dict[tuple[Path, Path], Input] = {}
    resolved = _resolver()
    repeated = [
        image.path for image in inputs if first.setdefault((resolved(image.path), image.place), image) is not image
    ]
    return list(first.values()), repeated


def _resolver() -> Callable[[Path], Path]:
    """A function that resolves paths as `Path.resolve`, but each folder once: it holds most of thousands of files."""
    folder = cache(Path.resolve)

    def resolved(path: Path) -> Path:
        linked = os.path.islink(path)  # noqa: PTH114 - Path.is_symlink raises where nothing may be read
        return path.resolve() if linked else folder(path.parent) / path.name

    return resolved


def _already_done(recipe: Recipe, jobs: Sequence[Job], folder: Path) -> set[Job]:
    records = read_journal(folder)
    done = set()
    for job in jobs:
        record = records.get(str(job.target.absolute()))
        if record is not None and record.still_true(job.key(recipe), job.source, job.target):
            done.add(job)
    return done


class _Tally:
    """What has been done so far; images in work tell it from their threads."""

    def __init__(self, total: int, done: int, report: Report | None) -> None:
        self._total, self._images, self._report = total, done, report
        self._pixels, self._share = 0, float(done)
        self._began, self._lock = time.monotonic(), Lock()

    def add(self, pixels: int, share: float) -> None:
        with self._lock:
            self._pixels += pixels
            self._share += share

    def finish(self, source: Path) -> None:
        self._images += 1
        self.tell(source)

    def tell(self, source: Path | None) -> None:
        if self._report is not None:
            share = max(self._share, self._images) / max(1, self._total)
            seconds = time.monotonic() - self._began
            self._report(Progress(self._images, self._total, self._pixels, min(1.0, share), seconds, source))


def _run_here(recipe: Recipe, jobs: Sequence[Job], workers: int, tally: "_Tally") -> Iterator[Outcome | None]:
    """The outcomes as they come, and None a few times a second meanwhile.

    As many images are in work as there are threads, one more waits in the pool for the first that is free, and the
    system is asked to fetch those behind, so that no core waits for a disk. Where there are fewer images than threads,
    each gets several.
    """
    at_once = max(1, min(workers, len(jobs)))
    threads = max(1, workers // at_once)
    # With less than a million values (4 MB), the work between two calls of a codec gets too small.
    samples = max(1_000_000, REGION_SAMPLES // at_once)
    canvases = Canvases(at_once)
    begun = 0
    with _codec_threads(threads), ThreadPoolExecutor(at_once) as pool:
        running: set[Future[Outcome]] = set()
        try:
            while True:
                while begun < len(jobs) and len(running) <= at_once:
                    job = jobs[begun]
                    running.add(pool.submit(run_job, recipe, job, threads, samples, tally.add, canvases))
                    begun += 1
                    if begun + at_once <= len(jobs):
                        _fetch(jobs[begun + at_once - 1].source)
                if not running:
                    return
                finished, running = wait(running, timeout=0.2, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in finished)
                if not finished:
                    yield None
        finally:
            pool.shutdown(cancel_futures=True)


def _fetch(path: Path) -> None:
    """Ask the system to load a file that will be read soon, without waiting; do nothing where it cannot be asked."""
    if hasattr(os, "posix_fadvise"):
        with suppress(OSError):
            if path.is_file():  # to open a pipe would take what another program writes to it
                with path.open("rb") as file:
                    os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_WILLNEED)


@contextmanager
def _codec_threads(count: int) -> Iterator[None]:
    """Let OpenImageIO's own codecs use this many threads per image."""
    before = {name: oiio.get_int_attribute(name) for name in ("threads", "exr_threads")}
    oiio.attribute("threads", count)
    oiio.attribute("exr_threads", count if count > 1 else -1)
    try:
        yield
    finally:
        for name, value in before.items():
            oiio.attribute(name, value)
