"""Grade the images of a batch on a Dask cluster whose machines have the same files under the same paths."""

import logging
import platform
import re
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import LutForgeError, one_line
from lutforge.grading.grade import Recipe
from lutforge.grading.inputs import Failure
from lutforge.grading.jobs import Job, Outcome, run_job

Sent = TypeVar("Sent", Recipe, Job)

_RECIPES: dict[str, Recipe] = {}
"""The recipe that this worker has prepared, by its key; one at most."""

_PREPARING = Lock()


def run_on_cluster(address: str, recipe: Recipe, jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome]]:
    """The jobs and their outcomes as they finish.

    An image whose worker dies is graded again by another, up to the scheduler's `allowed-failures`. Each result is
    checked: the worker had this recipe, and the file that it wrote has arrived here. Raises LutForgeError where Dask is
    not installed, or no scheduler or worker answers.
    """
    with _connected(address) as (distributed, client):
        shared = _with_absolute_paths(recipe)
        key = recipe.key
        threads = max(1, sum(client.nthreads().values()))
        waiting = deque(jobs)
        running: dict[str, Job] = {}

        def submit() -> Any:
            job = waiting.popleft()
            future = client.submit(_run_there, shared, key, _with_absolute_paths(job), pure=False)
            running[future.key] = job
            return future

        # A few jobs per thread wait at the workers, so that none is idle; not all, to save memory of the scheduler.
        futures = [submit() for _ in range(min(4 * threads, len(waiting)))]
        finished = distributed.as_completed(futures, loop=client.loop)
        for future in finished:
            job = running.pop(future.key)
            yield job, _outcome(job, future)
            if waiting:
                finished.add(submit())


@contextmanager
def _connected(address: str) -> Iterator[tuple[Any, Any]]:
    """Dask's module, which has no types, and a client of the scheduler."""
    if not re.fullmatch(r"([a-z]+://)?[^/\s]+:\d{1,5}", address):
        raise LutForgeError(f'"{address}" is not the address of a Dask scheduler; write it as tcp://HOST:8786')
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise LutForgeError('--scheduler needs Dask: pip install "lutforge[cluster]"') from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors that matter are reported here
    try:
        client = distributed.Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = one_line(str(error), 200)
        raise LutForgeError(f"{address}: no Dask scheduler answers ({reason}); start one: dask scheduler") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=60)
        except TimeoutError as error:
            raise LutForgeError(f"{address}: the scheduler has no workers; start some with: dask worker") from error
        yield distributed, client


def _outcome(job: Job, future: Any) -> Outcome:
    """A worker's answer, checked against the file on this machine."""
    try:
        answer: Outcome = future.result()
    except Exception as error:  # any failure of the worker concerns this image only
        line = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        return Failure(job.source, f"{job.source}: the cluster did not grade it ({line})")
    if isinstance(answer, Failure):
        return replace(answer, source=job.source)
    graded, record = answer
    # On network file systems a file that another machine wrote may appear here with a delay.
    until = time.monotonic() + 10
    output = record.output
    while not output.is_unchanged() and time.monotonic() < until:
        time.sleep(0.2)
    if output.is_unchanged():
        return replace(graded, source=job.source, target=job.target), record
    return Failure(job.source, f"{output.path}: a worker wrote it, but it is not here, or is another file")


def _with_absolute_paths(record: Sent) -> Sent:
    """A copy of a record for machines with another working folder, without values that are computed from its fields."""

    def absolute(value: object) -> object:
        if isinstance(value, tuple):
            return tuple(map(absolute, value))
        return value.absolute() if isinstance(value, Path) else value

    changes: dict[str, Any] = {field.name: absolute(getattr(record, field.name)) for field in fields(record)}
    return replace(record, **changes)


def _run_there(recipe: Recipe, key: str, job: Job) -> Outcome:
    """Grade an image on a worker, whose threads share one prepared recipe."""
    try:
        with _PREPARING:
            if key not in _RECIPES:
                recipe.check()
                if recipe.key != key:
                    differs = (
                        "has other versions of the recipe's files, LutForge or OpenColorIO than the machine that asks"
                    )
                    raise LutForgeError(f"{platform.node()} {differs}")
                # A worker is one thread: codecs on all cores would slow down the other workers.
                oiio.attribute("threads", 1)
                oiio.attribute("exr_threads", -1)
                _RECIPES.clear()
                _RECIPES[key] = recipe
            prepared = _RECIPES[key]
    except LutForgeError as error:
        return Failure(job.source, f"{job.source}: {error}")
    return run_job(prepared, job)
