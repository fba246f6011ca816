"""Run work on all cores.

A numba kernel is cut into slabs, and their number does not change the result. Whole fits run beside each other, and
each then keeps its kernels to its own thread, so that no core waits for another within a fit; only the last one that
runs spreads them over all cores.
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
Made = TypeVar("Made")
P = ParamSpec("P")

_task = local()  # its attribute `unfinished` is there in a thread that runs one of several tasks: these


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


def _beside_others() -> bool:
    return len(getattr(_task, "unfinished", ())) > 1


def run(task: Callable[[int, int], object], parts: Sequence[tuple[int, int]]) -> None:
    """Call task(start, stop) for each part: several parts in parallel on a thread pool, a single one in this thread."""
    if len(parts) == 1 or _beside_others():
        for part in parts:
            task(*part)
        return
    for done in [_pool().submit(task, *part) for part in parts]:
        done.result()


def each(task: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[Made]:
    """Yield what a task makes of each item, in order. As many run beside each other as there are cores.

    Within one of several tasks they run one after the other, and a single one in this thread. BLAS must have been
    limited to one thread by the caller: its limit is of the process, not of a thread.
    """
    unfinished = list(items)
    if len(unfinished) == 1 or _beside_others():
        yield from map(task, unfinished)
        return

    def begin() -> None:
        _task.unfinished = unfinished

    def run_one(item: Item) -> Made:
        try:
            return task(item)
        finally:
            unfinished.pop()  # whichever: their number is what counts

    with ThreadPoolExecutor(cores(), thread_name_prefix="task", initializer=begin) as pool:
        try:
            yield from pool.map(run_one, tuple(unfinished))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def one_blas_thread(function: Callable[P, Made]) -> Callable[P, Made]:
    """The function with BLAS limited to one thread while it runs.

    The threads of BLAS wait actively, and many small products then take ten times as long.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> Made:
        with _blas().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@cache
def _blas() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - loads the second BLAS, so that both are found

    return ThreadpoolController()
