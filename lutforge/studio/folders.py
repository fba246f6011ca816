"""The folders that the studio may read and write, and the paths in them."""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path

from lutforge.errors import LutForgeError
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES


class FolderError(LutForgeError):
    """A path outside the folders that the studio was started with."""


class Folders:
    """Folders by name, resolved: symbolic links are followed before a path is judged."""

    def __init__(self, paths: Iterable[str | Path]) -> None:
        self.roots = tuple(dict.fromkeys(Path(path).resolve() for path in paths))
        for path in self.roots:
            if not path.is_dir():
                raise FolderError(f"{path}: not a folder; name a folder that exists")

    def inside(self, text: str) -> Path:
        """The resolved path that a visitor names, relative to the first folder. Raises FolderError outside of all."""
        shown = " ".join(text.split())[:200]
        if not shown:
            raise FolderError("no file named: write its path, or choose one from the list")
        if "\0" in text:
            raise FolderError(f"{shown}: not a path")
        try:
            path = (self.roots[0] / text.strip()).resolve()
        except (OSError, RuntimeError) as error:
            raise FolderError(f"{shown}: cannot be followed ({type(error).__name__}); name another path") from error
        if not self.holds(path):
            folders = ", ".join(map(str, self.roots))
            raise FolderError(f"{shown}: outside the folders of this studio ({folders}); start it with --folder")
        return path

    def holds(self, path: Path) -> bool:
        """Whether a resolved path lies in one of the folders."""
        return any(path.is_relative_to(root) for root in self.roots)

    def files(self, suffixes: Iterable[str]) -> list[str]:
        """Files with these suffixes in the folders and the folders in them, as a visitor may name them."""
        lower_suffixes = {suffix.lower() for suffix in suffixes}
        paths = (path for root in self.roots for pattern in ("*", "*/*") for path in sorted(root.glob(pattern)))
        shown = (path for path in paths if path.suffix.lower() in lower_suffixes and not path.name.startswith("."))
        names = (self.name(path) for path in shown if path.is_file() and self.holds(path.resolve()))
        return list(dict.fromkeys(islice(names, 500)))  # a longer list is too long to choose from

    def with_shots(self) -> list[str]:
        """The folders that hold RAW files, or at least two JPEGs of which none has any, as a visitor may name them."""
        kinds = (RAW_SUFFIXES, JPEG_SUFFIXES)
        raw, jpeg = ([(self.roots[0] / name).parent for name in self.files(kind)] for kind in kinds)
        return sorted(self.name(folder) for folder in {*raw, *(parent for parent in jpeg if jpeg.count(parent) > 1)})

    def name(self, path: Path) -> str:
        """A path as a visitor would name it: relative to the first folder where it lies there."""
        return str(path.relative_to(self.roots[0])) if path.is_relative_to(self.roots[0]) else str(path)
