"""Run work on all cores.

A numba kernel is cut into slabs, whose number does not change the result. Several fits run in parallel, and each then
runs its kernels in its own thread, so that no core waits for another within a fit; the last one that runs spreads its
kernels over all cores.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from itertools import pairwise
from threading import local
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]  # it has no type information

Item = TypeVar("Item")
Result = TypeVar("Result")
P = ParamSpec("P")

_task = local()  # in a thread that runs one of several tasks, its attribute `unfinished` lists those that remain


@cache
def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), thread_name_prefix="kernel")


def slabs(start: int, stop: int, step: int, most: int) -> list[tuple[int, int]]:
    """Cut range(start, stop, step) into at most `most` contiguous parts (start, stop); each begins at a value of it."""
    if most <= 1:
        return [(start, stop)]
    count = max(0, -(-(stop - start) // step))
    parts = max(1, min(most, count))
    edges = [start + step * (count * part // parts) for part in range(parts)] + [stop]
    return list(pairwise(edges))


def shares(count: int, least: int) -> list[tuple[int, int]]:
    """Cut range(count) into one part per core, or fewer parts, so that each has at least `least` entries."""
    return slabs(0, count, 1, min(cores(), count // least))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked child has no threads


def _is_one_of_several() -> bool:
    """True in a thread that runs one of several tasks that are not finished."""
    return len(getattr(_task, "unfinished", ())) > 1


def run(task: Callable[[int, int], object], parts: Sequence[tuple[int, int]]) -> None:
    """Call task(start, stop) for each part: several parts in parallel on a thread pool, a single one in this thread."""
    if len(parts) == 1 or _is_one_of_several():
        for part in parts:
            task(*part)
        return
    for future in [_pool().submit(task, *part) for part in parts]:
        future.result()


def each(task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Yield the result of a task for each item, in order. As many run in parallel as there are cores.

    A single item runs in this thread, and so do items within one of several tasks, one after the other. The caller must
    have limited BLAS to one thread, since that limit applies to the process, not to a thread.
    """
    unfinished = list(items)
    if len(unfinished) == 1 or _is_one_of_several():
        yield from map(task, unfinished)
        return

    def begin() -> None:
        _task.unfinished = unfinished

    def run_one(item: Item) -> Result:
        try:
            return task(item)
        finally:
            unfinished.pop()  # any of them: only their number matters

    with ThreadPoolExecutor(cores(), thread_name_prefix="task", initializer=begin) as pool:
        try:
            yield from pool.map(run_one, tuple(unfinished))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def one_blas_thread(function: Callable[P, Result]) -> Callable[P, Result]:
    """The function with BLAS limited to one thread while it runs.

    The threads of BLAS occupy a core while they wait, which makes many small products ten times as slow.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> Result:
        with _blas().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@cache
def _blas() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - loads the second BLAS, so that both are found

    return ThreadpoolController()
