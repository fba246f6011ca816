"""Grade many images by one recipe; an image that fails is reported, and the others go on."""

import json
import os
import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import atomic_path, remove_temporaries
from lutforge.errors import ImageError, LutForgeError
from lutforge.grading.grade import Grade, Recipe
from lutforge.grading.image import REGION_SAMPLES, GradedImage
from lutforge.grading.image_colours import check_colours
from lutforge.grading.inputs import JOURNAL, Failure, resolver
from lutforge.grading.jobs import FileIdentity, Job, Outcome, Record, run_job
from lutforge.images.heif import is_heif
from lutforge.images.read import ImageReader, is_premultiplied
from lutforge.images.write import SOFTWARE, describe_output, keeps_orientation
from lutforge.luts.sequence import Lut
from lutforge.progress import Progress, silent
from lutforge.shots.discover import RAW_SUFFIXES


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


@dataclass(frozen=True)
class BatchResult:
    """Every input is in one of the three. skipped: the outputs that an earlier run made, and that are still right."""

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
    thread, with the rate of work, a few times a second. resume: what an earlier run did by this recipe is skipped where
    neither source nor output has changed since. scheduler: the address of a Dask cluster that does the work. Raises
    LutForgeError, and writes nothing, where two inputs would become one output, an output would replace an input, or
    the recipe is wrong for all images.
    """
    folder = Path(folder)
    jobs = plan_jobs(list(map(Path, images)), folder, suffix)
    recipe.check()
    remove_temporaries(job.target for job in jobs)
    records = read_journal(folder) if resume else {}
    already: set[Job] = set()
    for job in jobs:
        known = records.get(str(job.target.absolute()))
        if known is not None and known.still_true(recipe.key, job.source):
            already.add(job)
    waiting = [job for job in jobs if job not in already]
    outcomes: dict[Job, Outcome] = {}
    notes: list[str] = []
    pixels, began = 0, time.monotonic()
    if scheduler is None:
        running = _run_here(recipe, waiting, workers or os.cpu_count() or 1)
    else:
        from lutforge.grading.cluster import run_on_cluster  # loads Dask

        running = run_on_cluster(scheduler, recipe, waiting)
    for finished in running:
        if finished is not None:
            job, outcome = finished
            outcomes[job] = outcome
            if not isinstance(outcome, Failure):
                applied, record = outcome
                try:
                    add_to_journal(folder, record)
                except OSError as error:
                    notes.append(f"{job.target}: graded, but --resume will not know of it ({error.strerror})")
                pixels += applied.width * applied.height
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
    """How fast images are graded, in words."""
    seconds = max(seconds, 1e-3)
    return f"{images / seconds:.2g} images/s, {pixels / 1e6 / seconds:.3g} Mpixel/s"


def plan_jobs(images: Sequence[Path], folder: Path, suffix: str | None = None) -> list[Job]:
    """Choose where each image is written. Raises ImageError where two share a place or one would replace an input."""
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
        # Some file systems do not tell upper from lower case.
        other = seen.setdefault(str(place).lower(), job.source)
        if other is not job.source:
            raise ImageError(f"{job.source} and {other} would both become {job.target}; grade them into two folders")
    return jobs


def _run_here(recipe: Recipe, jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Outcome] | None]:
    """The jobs and their outcomes as they come, and None a few times a second meanwhile.

    As many images are in work as there are threads, and one more waits in the pool for the first that is free. Where
    there are fewer images than threads, each gets several.
    """
    at_once = max(1, min(workers, len(jobs)))
    threads = max(1, workers // at_once)
    # With less than a million values (4 MB), the work between two calls of a codec gets too small.
    samples = max(1_000_000, REGION_SAMPLES // at_once)
    begun = 0
    running: dict[Future[Outcome], Job] = {}
    codecs = {name: oiio.get_int_attribute(name) for name in ("threads", "exr_threads")}
    oiio.attribute("threads", threads)  # OpenImageIO's own, per image
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


# --- The oiiotool commands that grade as a batch would: for render farms that run programs, not Python ----------------


PLAIN_CONFIG = "plain.ocio"
"""A config of one space, beside profiles' LUTs: oiiotool 2.4 applies no LUT without a config."""


def oiiotool_commands(recipe: Recipe, jobs: Sequence[Job], folder: Path) -> Iterator[str | Failure]:
    """Per image a shell line that gives the pixels of `apply`, or why there is none. folder: for what lines need.

    The lines run in any folder, and whatever config the variable OCIO names: they name one of their own, and their
    paths are absolute, since OpenColorIO looks for relative ones beside the config. The shell makes the folder of the
    output, which older versions of oiiotool do not.
    """
    folder = folder.absolute()
    plain_config = folder / PLAIN_CONFIG
    files: dict[int, tuple[Lut, Path]] = {}
    for job in jobs:
        try:
            grade = recipe.grade(job.source)
            if grade.unchanged:
                raise ImageError(f"{job.source}: {grade.notes[0]}; copy it")
            words, lut = grade.oiiotool, grade.lut
            if lut is not None:
                path = folder / f"{recipe.key[:12]}-{len(files) + 1}.clf"
                words = ("--ociofiletransform", str(files.get(id(lut), (lut, path))[1]))
            of_lut = "--ociofiletransform" in words
            if of_lut:
                words = ("--colorconfig", str(plain_config), *words)
            command = _command(grade, words, job)
            if of_lut and not plain_config.exists():
                with atomic_path(plain_config) as temporary:
                    temporary.write_text(_plain_config(), encoding="utf-8")
            if lut is not None and id(lut) not in files:
                files[id(lut)] = lut, lut.write(path)
            yield f"{shlex.join(['mkdir', '-p', str(job.target.absolute().parent)])} && {shlex.join(command)}"
        except LutForgeError as error:
            yield Failure(job.source, str(error))


def _plain_config() -> str:
    config = OCIO.Config.CreateRaw()
    config.setVersion(2, 0)
    config.addColorSpace(OCIO.ColorSpace(name="linear"))
    config.setRole(OCIO.ROLE_SCENE_LINEAR, "linear")  # without which oiiotool makes no transform
    return str(config.serialize())


def _command(grade: Grade, words: Sequence[str], job: Job) -> list[str]:
    if grade.raw:
        raise ImageError(f"{job.source}: oiiotool does not develop RAW files; let `lutforge apply` render it")
    if any(sign in word for word in words for sign in "$%"):
        path = next(word for word in words if set(word) & set("$%"))
        raise ImageError(f'{path}: OpenColorIO takes "$" and "%" in the path of a LUT for variables; rename it')
    with ImageReader(job.source) as reader:
        check_colours(job.source, reader.spec)
        described = describe_output(job.target, reader.spec, reader.format)
        premultiplied = is_premultiplied(reader.spec)
        turned = reader.spec.get_int_attribute("Orientation", 1) != 1 and not keeps_orientation(job.target)
    # Names are taken as they are: no frame numbers, no expressions.
    command = ["oiiotool", "--wildcardoff", "--evaloff"]
    if not premultiplied and described.alpha_channel >= 0:
        command += ["--iconfig", "oiio:UnassociatedAlpha", "1"]
    command += ["-i", str(job.source.absolute())]
    conversions = ("--ociofiletransform", "--colorconvert", "--ociodisplay") if premultiplied else ()
    command += [f"{word}:unpremult=1" if word in conversions else word for word in words]
    if turned:
        command += ["--reorient"]
    command += ["--nosoftwareattrib", "--sattrib", "Software", SOFTWARE]
    command += ["--sattrib", "Exif:ImageHistory", " ".join(grade.history.split())]
    command += _attributes(grade.attributes)
    command += ["-d", str(described.format)]
    if compression := described.get_string_attribute("compression"):
        command += ["--compression", compression]
    if subsampling := described.get_string_attribute("jpeg:subsampling"):
        command += ["--sattrib", "jpeg:subsampling", subsampling]
    return [*command, "-o", str(job.target.absolute())]


def _attributes(attributes: Mapping[str, object]) -> Iterator[str]:
    for name, value in attributes.items():
        if value is None:
            yield from ("--eraseattrib", name)
        elif isinstance(value, bytes):
            raise ImageError("oiiotool embeds no ICC profile: let `lutforge apply` grade pictures in Adobe RGB")
        elif isinstance(value, str):
            yield from ("--sattrib", name, value)
        elif isinstance(value, Sequence):
            kind = "int" if all(isinstance(entry, int) for entry in value) else "float"
            yield from (f"--attrib:type={kind}[{len(value)}]", name, ",".join(map(str, value)))
        else:
            yield from ("--attrib", name, str(value))
