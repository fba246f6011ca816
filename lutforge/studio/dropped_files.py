"""Files that a visitor dropped onto a page, kept as long as the session."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lutforge.studio.workspace import WorkspaceError


class DroppedFiles:
    """A temporary folder of files, with a folder in it for each purpose; there is none before the first file."""

    def __init__(self) -> None:
        self._root: TemporaryDirectory[str] | None = None

    def folder(self, purpose: str) -> Path | None:
        """The folder of what was dropped for a purpose; None where nothing was."""
        folder = None if self._root is None else Path(self._root.name) / purpose
        return folder if folder is not None and folder.is_dir() else None

    def keep(self, purpose: str, names: Any, contents: Any) -> tuple[Path, ...]:
        """Write files that were dropped into the folder of a purpose. Returns their paths.

        names, contents: of a file, or lists of several. Raises WorkspaceError where a name is none.
        """
        if self._root is None:
            self._root = TemporaryDirectory(prefix="lutforge_dropped_")
        folder = Path(self._root.name) / purpose
        folder.mkdir(exist_ok=True)
        pairs = zip(names, contents, strict=True) if isinstance(names, list) else [(names, contents)]
        paths = []
        for name, data in pairs:
            bare = Path(str(name).replace("\\", "/")).name
            if not bare or bare.startswith("."):
                raise WorkspaceError(f"{str(name)[:60]!r}: not a file name")
            paths.append(folder / bare)
            paths[-1].write_bytes(data)
        return tuple(paths)

    def remove(self) -> None:
        """Remove the files."""
        if self._root is not None:
            self._root.cleanup()
            self._root = None
