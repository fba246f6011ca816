"""The folders that a visitor may read and write; no other path is touched."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import LutForgeError
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES


class FolderError(LutForgeError):
    """A path outside the folders that the studio was started with."""


@dataclass(frozen=True)
class Folders:
    """The folders, resolved: symbolic links are followed before a path is judged."""

    roots: tuple[Path, ...]

    @classmethod
    def of(cls, paths: Iterable[str | Path]) -> "Folders":
        """Folders by name. Raises FolderError where one is none."""
        roots = []
        for path in dict.fromkeys(Path(path).resolve() for path in paths):
            if not path.is_dir():
                raise FolderError(f"{path}: not a folder; name a folder that exists")
            roots.append(path)
        return cls(tuple(roots))

    def inside(self, text: str) -> Path:
        """The resolved path that a visitor names, relative to the first folder.

        Raises FolderError where it lies outside of all.
        """
        shown = " ".join(text.split())[:200]
        if not shown:
            raise FolderError("no file named: write its path, or choose one from the list")
        if "\0" in text:
            raise FolderError(f"{shown}: not a path")
        try:
            path = (self.roots[0] / text.strip()).resolve()
        except (OSError, RuntimeError) as error:
            raise FolderError(f"{shown}: cannot be followed ({type(error).__name__}); name another path") from error
        if not any(path.is_relative_to(root) for root in self.roots):
            folders = ", ".join(map(str, self.roots))
            raise FolderError(f"{shown}: outside the folders of this studio ({folders}); start it with --folder")
        return path

    def files(self, suffixes: Iterable[str]) -> list[str]:
        """Files with these suffixes in the folders and the folders in them, as a visitor may name them."""
        wanted = {suffix.lower() for suffix in suffixes}
        found = []
        for root in self.roots:
            for pattern in ("*", "*/*"):
                for path in sorted(root.glob(pattern)):
                    if path.suffix.lower() in wanted and not path.name.startswith(".") and path.is_file():
                        if any(path.resolve().is_relative_to(folder) for folder in self.roots):
                            found.append(self.name(path))
                        if len(found) >= 500:  # more would make a list that nobody reads
                            return found
        return list(dict.fromkeys(found))

    def with_shots(self) -> list[str]:
        """The folders that hold RAW files, or at least two JPEGs of which none has any, as a visitor may name them."""
        raw, jpeg = (
            [(self.roots[0] / name).parent for name in self.files(kind)] for kind in (RAW_SUFFIXES, JPEG_SUFFIXES)
        )
        brackets = {folder for folder in jpeg if jpeg.count(folder) > 1}
        return sorted(self.name(folder) for folder in {*raw, *brackets})

    def name(self, path: Path) -> str:
        """A path as a visitor would name it: relative to the first folder where it lies there."""
        return str(path.relative_to(self.roots[0])) if path.is_relative_to(self.roots[0]) else str(path)
