r"""The decorator of every loop that numba compiles, and the folder that keeps the machine code between runs.

Compiling all kernels takes most of a minute, so numba keeps what it compiled in a folder. By default that is the
user's cache folder of the operating system: `~/.cache/lutforge` on Linux, `~/Library/Caches/lutforge` on macOS,
`%LOCALAPPDATA%\lutforge\Cache` on Windows. The environment variable `NUMBA_CACHE_DIR` names another. Where the folder
cannot be written (a container, a render farm's user without a home), each process compiles what it needs and keeps
nothing. The folder may be deleted at any time.

Each kernel has a folder there, named by a digest of numba's version, of the files that define it and the kernels that
it calls, and of its constants. So all environments of a user share what any of them compiled, a new environment or
installation compiles nothing again, and a kernel is compiled anew where one that it calls has changed, which numba
itself does not see. Processes that need a kernel at the same time compile it once: one does, the others wait for it.
"""

import hashlib
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar, cast

import lutforge

REASSOCIATED = {"contract", "reassoc"}
"""`fastmath` for sums: their terms in any order, but the same one every time; else each waits for the one before it."""

Function = TypeVar("Function", bound=Callable[..., Any])

_making = RLock()


@cache
def cache_folder() -> Path | None:
    """Return the folder that keeps compiled kernels, made where it was missing; None where it cannot be written.

    Files in it are Python pickles, so it is never a folder that other users can write, such as /tmp.
    """
    import numba
    import platformdirs

    settings: Any = numba.config
    named = settings.CACHE_DIR
    folder = Path(named or platformdirs.user_cache_dir("lutforge", appauthor=False)) / f"kernels-{lutforge.__version__}"
    if not (named or folder.is_absolute()):  # a user without a home directory
        return None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    return folder


class _Kernel:
    """A function that numba compiles when it is first called, and not before: numba itself takes long to load."""

    def __init__(self, function: Callable[..., Any], fastmath: bool | set[str]) -> None:
        self._function, self._fastmath, self._made = function, fastmath, None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return (self._made or self.made())(*arguments)

    def made(self) -> Any:
        """numba's function; the kernels that it calls are put in place of their names, which numba looks up."""
        with _making:
            if self._made is None:
                names = self._function.__globals__
                for name in self._function.__code__.co_names:
                    if isinstance(names.get(name), _Kernel):
                        names[name] = names[name].made()
                self._made = _jitted(self._function, self._fastmath, _digest(self._function))
        return self._made


def _digest(function: Callable[..., Any]) -> str:
    """Return a digest of what a kernel is compiled from: numba, its file, the kernels that it calls, its constants."""
    import numba

    parts = [numba.__version__, Path(function.__code__.co_filename).read_text(encoding="utf-8")]
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        parts.append(repr(value) if isinstance(value, int | float) else getattr(value, "digest", ""))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


def _jitted(function: Callable[..., Any], fastmath: bool | set[str], digest: str) -> Any:
    import numba

    settings: Any = numba.config
    folder = cache_folder()
    before = settings.CACHE_DIR, getattr(settings, "CACHE_LOCATOR_CLASSES", "")  # older ones of numba know none
    # error_model: a division by 0 gives an infinity, as in numpy; the checks that numba else adds take time to compile.
    # numba reads its settings once, when it is given the function; other packages' kernels keep their own folder.
    if folder is not None:
        settings.CACHE_DIR = str(folder / digest)
        settings.CACHE_LOCATOR_CLASSES = "lutforge.kernel_locator.KernelLocator"
    try:
        made: Any = numba.njit(function, cache=folder is not None, nogil=True, fastmath=fastmath, error_model="numpy")
    finally:
        settings.CACHE_DIR, settings.CACHE_LOCATOR_CLASSES = before
    made.digest = digest
    if folder is not None:
        made.compile = _once(made.compile, folder / digest)
    return made


def _once(compile_one: Callable[[Any], Any], folder: Path) -> Callable[[Any], Any]:
    """Return numba's function that loads or compiles a kernel, done by one process at a time."""
    from numba.core.compiler_lock import global_compiler_lock

    def loaded_or_compiled(signature: Any) -> Any:
        # numba's own lock first: a thread that held the other one would wait for this one, and the other way round.
        with global_compiler_lock, _alone(folder):
            return compile_one(signature)

    return loaded_or_compiled


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a kernel's folder, which ends with the process that holds it.

    Where a file system has no locks or nothing can be written, each process compiles what it needs.
    """
    from numba.core import event

    try:
        folder.mkdir(exist_ok=True)
        file = (folder / "lock").open("wb")
    except OSError:
        yield
        return
    with file:
        if not _locked(file.fileno(), wait=False):
            with event.trigger_event("numba:compile"):  # those who tell of compilation tell of this, too
                _locked(file.fileno(), wait=True)
        yield


def _locked(file: int, wait: bool) -> bool:
    """Lock an open file; False where another process holds it, or it cannot be locked."""
    with suppress(OSError):
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Return a decorator that compiles a function with numba when it is first called; it runs without the GIL.

    `fastmath` names the liberties that LLVM may take with floating-point arithmetic, as `numba.njit` takes them.
    """

    def decorate(function: Function) -> Function:
        return cast(Function, _Kernel(function, fastmath))

    return decorate
