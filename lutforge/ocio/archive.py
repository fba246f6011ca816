"""A config as one archive (.ocioz): the same bytes for the same config, whatever the clock."""

import zipfile
from pathlib import Path

from lutforge.atomic_write import atomic_path

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The earliest time that a zip file can hold."""


def write_archive(folder: Path, target: Path) -> Path:
    """Pack a config's folder (config.ocio and all below) into an .ocioz archive, atomically."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    files.sort(key=lambda path: path.name != "config.ocio")  # readers look for it first
    with (
        atomic_path(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
    ):
        for path in files:
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, path.read_bytes(), compresslevel=9)
    return target
