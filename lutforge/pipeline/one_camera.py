"""The cameras that files name: several are refused before any file is decoded, and one has one name."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from lutforge.errors import ShotError
from lutforge.settings import UNKNOWN_CAMERA, camera_key

if TYPE_CHECKING:
    from lutforge.samples.sample_set import SampleSet, Text


def require_one_camera(files: Iterable[Path], of_tables: Mapping[str, Path] = MappingProxyType({})) -> None:
    """Raise ShotError where the tags of files, before any is decoded, name several cameras.

    of_tables: the cameras of sample tables that the files belong to. A file that names no camera is passed over.
    """
    from lutforge.shots.metadata import stated_camera

    by_key: dict[str, tuple[str, list[Path]]] = {}
    for camera, file in chain(of_tables.items(), ((stated_camera(file), file) for file in files)):
        if camera and camera != UNKNOWN_CAMERA:
            by_key.setdefault(camera_key(camera), (camera, []))[1].append(file)
    if len(by_key) > 1:
        cameras = [f"{camera}: {_first_of(of_camera)}" for camera, of_camera in by_key.values()]
        listed = "; ".join(cameras[:4]) + "; …" * (len(cameras) > 4)
        advice = "give those of one camera, for instance each camera's in a folder of its own"
        raise ShotError(f"files of {len(by_key)} cameras ({listed}): {advice}")


def _first_of(files: Sequence[Path]) -> str:
    return f"{files[0]} and {len(files) - 1} more" if len(files) > 1 else str(files[0])


def with_one_name(sets: Sequence[SampleSet]) -> list[SampleSet]:
    """Return sample sets in which a camera has one name, its first spelling.

    Samples of files that name no camera get the name of the others' camera, where that is one.
    """
    names: dict[str, str] = {}
    for name in chain.from_iterable(np.unique(samples.camera).tolist() for samples in sets):
        names.setdefault(camera_key(name), name)
    unknown = camera_key(UNKNOWN_CAMERA)
    known = [name for key, name in names.items() if key != unknown]
    if len(known) == 1:
        names[unknown] = known[0]

    def named(column: Text) -> Text:
        return np.array([names.get(camera_key(name), name) for name in column.tolist()], dtype=np.str_)

    return [replace(samples, camera=named(samples.camera), raw_camera=named(samples.raw_camera)) for samples in sets]
