"""The manifest of a kit: kit.json, which lists its files, their sources and their errors."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

SCRIPT = "develop.sh"
MANIFEST = "kit.json"


def read_manifest(folder: Path) -> dict[str, object]:
    """A kit's manifest; empty for a folder without one."""
    data: object = None
    with suppress(OSError, ValueError):
        data = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return data if isinstance(data, dict) else {}


def names_in(manifest: Mapping[str, object], key: str) -> list[str]:
    """A list of names in a manifest; empty where it has none."""
    values = manifest.get(key)
    return [str(value) for value in values] if isinstance(values, list) else []


def kit_errors(folder: str | Path) -> dict[str, str]:
    """The error of each file of a kit against the model, in words, by the file's name."""
    errors = read_manifest(Path(folder)).get("errors", {})
    return dict(errors) if isinstance(errors, dict) else {}
