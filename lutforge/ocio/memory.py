"""A config whose LUT files are in memory: OpenColorIO asks a ConfigIOProxy for their contents."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

_files_by_folder: dict[str, "FilesInMemory"] = {}
"""The files of all configs in memory. They are never freed: copies of a config share them, and OpenColorIO does not
report when the last copy is gone."""


class FilesInMemory(OCIO.PyConfigIOProxy):  # type: ignore[misc]  # PyOpenColorIO has no type information
    """The text of a config, and the contents of its files by their paths in a folder that does not exist on disk."""

    def __init__(self, text: str, files: Mapping[str, bytes]) -> None:
        super().__init__()
        digest = hashlib.sha256(text.encode())
        for name, content in sorted(files.items()):
            digest.update(f"\n{name}\n{len(content)}\n".encode() + content)
        # OpenColorIO caches LUTs by their paths, so files with other contents need another folder.
        self.folder = f"/lutforge-in-memory/{digest.hexdigest()[:32]}"
        self.text = text
        self.files = dict(files)

    def getConfigData(self) -> str:  # noqa: N802 - OpenColorIO's name
        """The text of the config."""
        return self.text

    def getLutData(self, path: str) -> bytearray:  # noqa: N802 - OpenColorIO's name
        """The contents of a file, in memory or on disk."""
        content = self._content(path)
        return bytearray(Path(path).read_bytes() if content is None else content)

    def getFastLutFileHash(self, path: str) -> str:  # noqa: N802 - OpenColorIO's name
        """A text that changes with the contents of a file; empty where there is no such file."""
        if self._content(path) is not None:
            return path
        file = Path(path)
        if not file.is_file():
            return ""
        status = file.stat()
        return f"{path} {status.st_size} {status.st_mtime_ns}"

    def _content(self, path: str) -> bytes | None:
        return self.files.get(path.replace("\\", "/").removeprefix(f"{self.folder}/"))


def in_memory(config: OCIO.Config, files: Mapping[str, bytes]) -> OCIO.Config:
    """The config with its files in memory, until the process ends. files: contents by paths relative to the config."""
    proxy = FilesInMemory(config.serialize(), files)
    proxy = _files_by_folder.setdefault(proxy.folder, proxy)
    loaded = OCIO.Config.CreateFromConfigIOProxy(proxy)
    loaded.setWorkingDir(proxy.folder)
    return loaded
