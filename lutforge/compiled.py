r"""The decorator of every loop that numba compiles.

numba keeps the machine code between runs: in the user's cache folder of the operating system (`~/.cache/lutforge` on
Linux, `~/Library/Caches/lutforge` on macOS, `%LOCALAPPDATA%\lutforge\Cache` on Windows), or in the folder that the
environment variable `NUMBA_CACHE_DIR` names. The folder may be deleted at any time. numba compiles a kernel anew where
its own file has changed, and does not see that a kernel which it calls, of another file, has.
"""

from collections.abc import Callable
from functools import partial, update_wrapper
from threading import RLock
from typing import Any, TypeVar, cast

import lutforge

REASSOCIATED = {"contract", "reassoc"}
"""`fastmath` for sums: their terms in any order, but the same one every time; else each waits for the one before it."""

Function = TypeVar("Function", bound=Callable[..., Any])

_making = RLock()


class _Kernel:
    """A function that numba compiles when it is first called, and not before: numba itself takes long to load."""

    def __init__(self, function: Callable[..., Any], fastmath: bool | set[str]) -> None:
        self._function, self._fastmath = function, fastmath
        self._made: Any = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return (self._made or self.made())(*arguments)

    def made(self) -> Any:
        """numba's function; the kernels that it calls are put in place of their names, which numba looks up."""
        with _making:
            if self._made is not None:
                return self._made
            names = self._function.__globals__
            for name in self._function.__code__.co_names:
                if isinstance(names.get(name), _Kernel):
                    names[name] = names[name].made()
            import numba
            import platformdirs

            # numba reads this setting once, when it is given the function; other packages' kernels keep their folder.
            settings: Any = numba.config
            named = settings.CACHE_DIR
            folder = platformdirs.user_cache_dir("lutforge", appauthor=False, version=lutforge.__version__)
            settings.CACHE_DIR = named or folder
            # error_model: a division by 0 gives an infinity, as in numpy; the checks that numba else adds take time to
            # compile.
            options: dict[str, Any] = {"nogil": True, "fastmath": self._fastmath, "error_model": "numpy"}
            try:
                self._made = numba.njit(self._function, cache=True, **options)
            except RuntimeError:  # no folder can be written, nor that of the source
                self._made = numba.njit(self._function, **options)
            finally:
                settings.CACHE_DIR = named
        return self._made


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Return a decorator that compiles a function with numba when it is first called; it runs without the GIL.

    `fastmath` names the liberties that LLVM may take with floating-point arithmetic, as `numba.njit` takes them.
    """
    return cast(Callable[[Function], Function], partial(_Kernel, fastmath=fastmath))
