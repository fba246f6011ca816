r"""The decorator of every loop that numba compiles.

numba keeps the machine code between runs: in the user's cache folder of the operating system (`~/.cache/lutforge` on
Linux, `~/Library/Caches/lutforge` on macOS, `%LOCALAPPDATA%\lutforge\Cache` on Windows), or in the folder that the
environment variable `NUMBA_CACHE_DIR` names. The folder may be deleted at any time. numba compiles a kernel anew when
its file changes, but not when a kernel of another file, which it calls, changes.
"""

from collections.abc import Callable
from functools import partial, update_wrapper
from threading import RLock
from typing import Any, TypeVar, cast

import lutforge

REASSOCIATED = {"contract", "reassoc"}
"""`fastmath` for sums: the terms may be added in another order, the same in every run, several at a time."""

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])

_compiling = RLock()


class _Kernel:
    """A function that numba compiles when it is first called, and not before: numba itself takes long to load."""

    def __init__(self, function: Callable[..., Any], fastmath: bool | set[str]) -> None:
        self._function = function
        self._fastmath = fastmath
        self._dispatcher: Any = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return (self._dispatcher or self.dispatcher())(*arguments)

    def dispatcher(self) -> Any:
        """The function as numba compiles it (a `Dispatcher`), made when it is first needed."""
        with _compiling:
            if self._dispatcher is not None:
                return self._dispatcher

            # numba looks up the kernels that this one calls by their global names: it must find dispatchers there.
            names = self._function.__globals__
            for name in self._function.__code__.co_names:
                if isinstance(names.get(name), _Kernel):
                    names[name] = names[name].dispatcher()
            import numba
            import platformdirs

            # numba reads the cache folder once, in `njit`; then the setting is restored for other packages' kernels.
            settings: Any = numba.config
            user_setting = settings.CACHE_DIR
            folder = platformdirs.user_cache_dir("lutforge", appauthor=False, version=lutforge.__version__)
            settings.CACHE_DIR = user_setting or folder
            # error_model: a division by 0 gives an infinity, as in numpy. numba's default would compile a check for
            # each division, which takes time.
            options: dict[str, Any] = {"nogil": True, "fastmath": self._fastmath, "error_model": "numpy"}
            try:
                self._dispatcher = numba.njit(self._function, cache=True, **options)
            except RuntimeError:  # neither the cache folder nor that of the source can be written to
                self._dispatcher = numba.njit(self._function, **options)
            finally:
                settings.CACHE_DIR = user_setting
        return self._dispatcher


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[KernelFunction], KernelFunction]:
    """Return a decorator that compiles a function with numba when it is first called; it runs without the GIL.

    `fastmath`: the changes of floating-point arithmetic that LLVM may make, as for `numba.njit`.
    """
    return cast(Callable[[KernelFunction], KernelFunction], partial(_Kernel, fastmath=fastmath))
