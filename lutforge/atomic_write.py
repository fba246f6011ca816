"""Write a file under a temporary name and rename it: a killed run leaves the old file or the new, never a part."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import RLock

from lutforge.errors import LutForgeError

SCRATCH = ".lutforge-"
"""The beginning of the names of scratch folders."""

_unfinished: set[Path] = set()
"""Temporary files that this process has not renamed yet, and its scratch folders."""

_made_folders: set[Path] = set()
"""Folders that this process made for its outputs; one that stays empty is removed."""

_beginning = RLock()  # reentrant: a signal handler may acquire it in the thread that holds it


def require_writable(path: str | Path) -> None:
    """Raise LutForgeError where no file can be written to `path`; call it before long work."""
    path = Path(path)
    if path.is_dir():
        raise LutForgeError(f"{path}: is a folder; name a file")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise LutForgeError(f"{path}: {folder.name} is a file, not a folder; choose another output folder")
    try:
        with tempfile.TemporaryFile(dir=folder):  # permissions are not enough: root has them in /sys
            pass
    except OSError:
        raise LutForgeError(f"{path}: the folder cannot be written to; choose another output folder") from None


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, renamed to it when the block ends without an error.

    It has the same suffix.

    Raises LutForgeError, in one line, where the folder is missing or cannot be written to.
    """
    path = Path(path)
    try:
        with _beginning:
            _make_folder(path.parent)
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=_prefix(path), suffix=path.suffix)
            os.close(handle)
            _unfinished.add(Path(name))
    except OSError as error:
        _remove_if_empty(path.parent)
        raise LutForgeError(f"{path}: cannot write here ({error.strerror}); choose another output folder") from error
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        raise LutForgeError(f"{path}: cannot write ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)
        _remove_if_empty(path.parent)


def discard_unfinished() -> None:
    """Delete what this process has begun to write. Afterwards nothing can be begun: the process is about to end."""
    _beginning.acquire()
    for path in tuple(_unfinished):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _make_folder(folder: Path) -> None:
    folder = folder.absolute()
    _made_folders.update(place for place in (folder, *folder.parents) if not place.exists())
    folder.mkdir(parents=True, exist_ok=True)


def _remove_if_empty(folder: Path) -> None:
    """Remove a folder, and those above it, while they are empty and this process made them."""
    folder = folder.absolute()
    with _beginning, suppress(OSError):  # the error of the first that is not empty ends the loop
        for place in (folder, *folder.parents):
            if place not in _made_folders:
                return
            place.rmdir()
            _made_folders.discard(place)


def remove_temporaries(paths: Iterable[Path]) -> None:
    """Delete the temporary files for these paths that killed runs left.

    No other process may be writing to these paths at the same time.
    """
    names: dict[Path, set[tuple[str, str]]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add((_prefix(path), path.suffix))
    for folder, prefixes_and_suffixes in names.items():
        for file in folder.iterdir() if folder.is_dir() else ():
            match = re.fullmatch(r"(\..+\.lutforge-)[a-z0-9_]{8}", file.stem)
            if match is not None and (match[1], file.suffix) in prefixes_and_suffixes:
                file.unlink(missing_ok=True)


@contextmanager
def scratch_folder(next_to: str | Path | None = None) -> Iterator[Path]:
    """Yield an empty folder that is removed when the block ends, also by Ctrl-C or SIGTERM.

    next_to: the output that the block makes; the new folder is made in the same folder, or without it in the system's
    temporary folder. Raises LutForgeError, which names `next_to`, where something cannot be written.
    """
    parent = Path(tempfile.gettempdir()) if next_to is None else Path(next_to).absolute().parent
    _make_folder(parent)
    try:
        with ExitStack() as stack:
            if next_to is None:
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=SCRATCH)))
            else:
                with _locked(parent, wait=True):  # until the new folder is locked as well
                    _remove_abandoned(parent)
                    name = stack.enter_context(tempfile.TemporaryDirectory(dir=parent, prefix=SCRATCH))
                    folder = Path(name)
                    stack.enter_context(_locked(folder))
            with _beginning:
                _unfinished.add(folder)
            try:
                yield folder
            finally:
                _unfinished.discard(folder)
    except (LutForgeError, OSError) as failure:
        cause = failure.__cause__ if isinstance(failure, LutForgeError) and SCRATCH in str(failure) else failure
        if next_to is None or not isinstance(cause, OSError):
            raise
        raise LutForgeError(f"{next_to}: cannot write ({cause.strerror or cause})") from cause
    finally:
        _remove_if_empty(parent)


@contextmanager
def _locked(folder: Path, wait: bool = False) -> Iterator[bool]:
    """Hold the lock of a folder, which the system frees when this process ends, however it ends.

    wait: until another process frees it. Yields False where another process holds it, and where the system locks no
    folders, as on Windows and some network disks.
    """
    try:
        import fcntl

        handle = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        yield False
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        is_acquired = True
    except OSError:
        is_acquired = False
    try:
        yield is_acquired
    finally:
        os.close(handle)


def _remove_abandoned(parent: Path) -> None:
    """Delete the scratch folders that killed processes left in a folder; those of running processes are locked."""
    for folder in parent.glob(f"{SCRATCH}????????"):
        with suppress(OSError), _locked(folder) as is_abandoned:
            if is_abandoned and not folder.is_symlink():
                shutil.rmtree(folder, ignore_errors=True)


def _prefix(path: Path) -> str:
    """The beginning of the temporary names of a path; its hash, where the name is too long to be extended."""
    import hashlib  # here: every command loads this file, and few need it

    name = os.fsencode(path.name)
    return f".{path.stem if len(name) < 200 else hashlib.sha256(name).hexdigest()[:32]}.lutforge-"
