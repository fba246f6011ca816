"""Write a file under a temporary name and rename it: a killed run leaves the old file or the new, never half."""

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
"""How the names of scratch folders begin."""

_unfinished: set[Path] = set()
"""What this process is writing and has not renamed yet: files, and folders that go when their work is done."""

_made: set[Path] = set()
"""Folders that this process made for its outputs; one that stays empty is removed."""

_beginning = RLock()  # a signal may come while this thread holds it


def require_writable(path: str | Path) -> None:
    """Raise LutForgeError where no file can be written to `path`; call it before long work."""
    path = Path(path)
    if path.is_dir():
        raise LutForgeError(f"{path}: is a folder; name a file")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise LutForgeError(f"{path}: {folder.name} is a file, not a folder; choose another output folder")
    try:
        with tempfile.TemporaryFile(dir=folder):  # rights alone do not tell: of /sys, root has them
            pass
    except OSError:
        raise LutForgeError(f"{path}: the folder cannot be written to; choose another output folder") from None


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` (same suffix), renamed to it when the block ends without an error.

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
    """Delete what this process has begun to write. Nothing can be begun afterwards: the process is about to end."""
    _beginning.acquire()
    for path in tuple(_unfinished):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _make_folder(folder: Path) -> None:
    folder = folder.absolute()
    _made.update(place for place in (folder, *folder.parents) if not place.exists())
    folder.mkdir(parents=True, exist_ok=True)


def _remove_if_empty(folder: Path) -> None:
    """Remove a folder, and those above it, as far as this process made them and they hold nothing."""
    folder = folder.absolute()
    with _beginning, suppress(OSError):  # of the first that holds something
        for place in (folder, *folder.parents):
            if place not in _made:
                return
            place.rmdir()
            _made.discard(place)


def remove_temporaries(paths: Iterable[Path]) -> None:
    """Delete the temporary files that killed runs left beside these paths.

    No other process may be writing these paths at the same time.
    """
    names: dict[Path, set[tuple[str, str]]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add((_prefix(path), path.suffix))
    for folder, wanted in names.items():
        for file in folder.iterdir() if folder.is_dir() else ():
            match = re.fullmatch(r"(\..+\.lutforge-)[a-z0-9_]{8}", file.stem)
            if match is not None and (match[1], file.suffix) in wanted:
                file.unlink(missing_ok=True)


@contextmanager
def scratch_folder(beside: str | Path | None = None) -> Iterator[Path]:
    """Yield an empty folder that is removed when the block ends, also by Ctrl-C or SIGTERM.

    beside: what the block makes; the new folder lies beside it, or without it in the system's temporary folder. Raises
    LutForgeError, which names `beside`, where something cannot be written.
    """
    parent = Path(tempfile.gettempdir()) if beside is None else Path(beside).absolute().parent
    _make_folder(parent)
    try:
        with ExitStack() as stack:
            if beside is None:
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=SCRATCH)))
            else:
                with _locked(parent, wait=True):  # until the new folder is locked, too
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
        if beside is None or not isinstance(cause, OSError):
            raise
        raise LutForgeError(f"{beside}: cannot write ({cause.strerror or cause})") from cause
    finally:
        _remove_if_empty(parent)


@contextmanager
def _locked(folder: Path, wait: bool = False) -> Iterator[bool]:
    """Hold the lock of a folder, which the system frees when this process ends, however it ends.

    wait: until another process frees it. Yields False where it is held by another, or where the system locks no
    folders: Windows, some network disks.
    """
    try:
        import fcntl

        handle = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        yield False
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        is_ours = True
    except OSError:
        is_ours = False
    try:
        yield is_ours
    finally:
        os.close(handle)


def _remove_abandoned(parent: Path) -> None:
    """Delete the scratch folders that killed processes left in a folder; those of others at work are locked."""
    for folder in parent.glob(f"{SCRATCH}????????"):
        with suppress(OSError), _locked(folder) as is_abandoned:
            if is_abandoned and not folder.is_symlink():
                shutil.rmtree(folder, ignore_errors=True)


def _prefix(path: Path) -> str:
    """How the temporary names of a path begin; a name that is too long to be made longer is replaced by its hash."""
    import hashlib  # here: every command loads this file, and few need it

    name = os.fsencode(path.name)
    return f".{path.stem if len(name) < 200 else hashlib.sha256(name).hexdigest()[:32]}.lutforge-"
