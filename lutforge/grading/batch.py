"""Grade many images by one recipe; an image that fails is reported, and the others are graded."""

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.atomic_write import remove_temporaries
from lutforge.errors import ImageError
from lutforge.grading.grade import Recipe
from lutforge.grading.image import REGION_SAMPLES, GradedImage
from lutforge.grading.inputs import BATCH_JOURNAL, Failure, resolver
from lutforge.grading.jobs import FileIdentity, Job, Outcome, Record, run_job
from lutforge.images.heif import is_heif
from lutforge.progress import Progress, silent
from lutforge.shots.discover import RAW_SUFFIXES


def read_journal(folder: Path) -> Mapping[str, Record]:
    """The last record of each output, by its absolute path; lines that a killed run cut are left out."""
    records = {}
    try:
        lines = (folder / BATCH_JOURNAL).read_bytes().splitlines()
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
    # The first line break ends an incomplete line that a killed run may have left.
    line = b"\n" + json.dumps(asdict(record)).encode() + b"\n"
    handle = os.open(folder / BATCH_JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        if os.write(handle, line) != len(line):
            raise OSError(None, "the disk is full")
    finally:
        os.close(handle)


@dataclass(frozen=True)
class BatchResult:
    """The result of a batch: every input is in one of the first three fields.

    done: graded; failed: with the reason; skipped: outputs of an earlier run that are still valid. notes: for the user.
    """

    done: tuple[GradedImage, ...]
    failed: tuple[Failure, ...]
    skipped: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


def apply_batch(
    recipe: Recipe,
    images: Sequence[str | Path],
    folder: str | Path,
    suffix: str | None = None,
    workers: int | None = None,
    progress: Progress = silent,
    resume: bool = False,
    scheduler: str | None = None,
) -> BatchResult:
    """Grade images into a folder under their own names; each output is written whole or not at all.

    suffix: such as ".exr", for another format. workers: threads, by default one per core. progress: called, in this
    thread, with the rate of work, a few times a second. resume: skip images that an earlier run graded by this recipe,
    if neither source nor output has changed since. scheduler: the address of a Dask cluster that does the work. Raises
    LutForgeError, and writes nothing, where two inputs would become one output, an output would replace an input, or
    the recipe cannot grade any image.
    """
    folder = Path(folder)
    jobs = plan_jobs(list(map(Path, images)), folder, suffix)
    recipe.check()
    remove_temporaries(job.target for job in jobs)

    already = _done_before(jobs, folder, recipe) if resume else set()
    waiting = [job for job in jobs if job not in already]
    if scheduler is None:
        running = _run_here(recipe, waiting, workers or os.cpu_count() or 1)
    else:
        from lutforge.grading.cluster import run_on_cluster  # loads Dask

        running = run_on_cluster(scheduler, recipe, waiting)

    outcomes: dict[Job, Outcome] = {}
    notes: list[str] = []
    pixels = 0
    began = time.monotonic()
    for finished in running:
        if finished is not None:
            job, outcome = finished
            outcomes[job] = outcome
            if not isinstance(outcome, Failure):
                graded, entry = outcome
                try:
                    add_to_journal(folder, entry)
                except OSError as error:
                    notes.append(f"{job.target}: graded, but --resume will not know of it ({error.strerror})")
                pixels += graded.width * graded.height
        images_done = len(already) + len(outcomes)
        progress(rate(images_done, pixels, time.monotonic() - began), images_done / len(jobs))

    ordered = [outcomes[job] for job in waiting]
    return BatchResult(
        tuple(outcome[0] for outcome in ordered if not isinstance(outcome, Failure)),
        tuple(outcome for outcome in ordered if isinstance(outcome, Failure)),
        tuple(job.target for job in jobs if job in already),
        tuple(notes),
    )


def rate(images: int, pixels: int, seconds: float) -> str:
    """The speed of a batch, in words."""
    seconds = max(seconds, 1e-3)
    return f"{images / seconds:.2g} images/s, {pixels / 1e6 / seconds:.3g} Mpixel/s"


def plan_jobs(images: Sequence[Path], folder: Path, suffix: str | None = None) -> list[Job]:
    """Choose the output of each image. Raises ImageError where two have the same, or one would replace an input."""
    if suffix is not None and not suffix.startswith("."):
        suffix = f".{suffix}"
    if suffix is not None and Path(f"x{suffix}").suffix != suffix:
        raise ImageError(f'"{suffix}" is no suffix of an image; write for example .png')
    jobs = []
    for image in images:
        raw = image.suffix.lower() in RAW_SUFFIXES
        chosen = suffix or (".jpg" if raw or is_heif(image) else image.suffix)
        jobs.append(Job(image, folder / Path(image.name).with_suffix(chosen)))
    resolved = resolver()
    sources = {resolved(job.source) for job in jobs}
    seen: dict[str, Path] = {}
    for job in jobs:
        place = resolved(job.target)
        if place in sources:
            raise ImageError(f"{job.target}: the output would replace an input; choose another folder")
        # Some file systems do not distinguish upper and lower case.
        earlier = seen.setdefault(str(place).lower(), job.source)
        if earlier is not job.source:
            raise ImageError(f"{job.source} and {earlier} would both become {job.target}; grade them into two folders")
    return jobs


def _done_before(jobs: Iterable[Job], folder: Path, recipe: Recipe) -> set[Job]:
    """The jobs that an earlier run did by this recipe, whose sources and outputs have not changed since."""
    records = read_journal(folder)
    done = set()
    for job in jobs:
        record = records.get(str(job.target.absolute()))
        if record is not None and record.is_valid(recipe.key, job.source):
            done.add(job)
    return done


def _run_here(recipe: Recipe, jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Outcome] | None]:
    """The jobs and their outcomes as they finish, and None a few times a second in between.

    As many images are graded at once as there are threads, and one more waits in the pool for a free thread. Where
    there are fewer images than threads, each gets several.
    """
    at_once = max(1, min(workers, len(jobs)))
    threads = max(1, workers // at_once)
    # With fewer than a million values (4 MB) per region, the calls of codecs take too large a share of the time.
    samples = max(1_000_000, REGION_SAMPLES // at_once)
    begun = 0
    running: dict[Future[Outcome], Job] = {}
    codecs = {name: oiio.get_int_attribute(name) for name in ("threads", "exr_threads")}
    oiio.attribute("threads", threads)  # of OpenImageIO, per image
    oiio.attribute("exr_threads", threads if threads > 1 else -1)
    pool = ThreadPoolExecutor(at_once)
    try:
        while begun < len(jobs) or running:
            while begun < len(jobs) and len(running) <= at_once:
                running[pool.submit(run_job, recipe, jobs[begun], threads, samples)] = jobs[begun]
                begun += 1
            finished = wait(running, timeout=0.2, return_when=FIRST_COMPLETED).done
            yield from ((running.pop(future), future.result()) for future in finished)
            if not finished:
                yield None
    finally:
        pool.shutdown(cancel_futures=True)
        for name, value in codecs.items():
            oiio.attribute(name, value)
