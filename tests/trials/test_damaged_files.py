"""Damaged files of every kind that is read: each is read, or is one line of LutForge's own error."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from lutforge.errors import LutError
from lutforge.kits.dcp import read_dcp
from lutforge.pipeline.inspection import inspect
from tests.cases.damaged import LUTS, READERS, damaged, fault, whole_files
from tests.cases.same_bytes import same_bytes

COUNT = int(os.environ.get("LUTFORGE_DAMAGED_FILES", "60"))
"""How many damaged files of a kind are read; a long search for faults sets thousands."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return whole_files(tmp_path_factory.mktemp("sound"))


@pytest.mark.parametrize("kind", [kind for kind in READERS if kind != ".ocio"])  # its LUTs are elsewhere
def test_whole_files_are_read(sound: dict[str, bytes], kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{kind}"
    path.write_bytes(sound[kind])
    READERS[kind](path)  # raises nothing
    assert same_bytes(path, sound[kind])


@pytest.mark.parametrize("kind", [end if end in LUTS else pytest.param(end, marks=pytest.mark.slow) for end in READERS])
def test_damaged_files_are_one_line(sound: dict[str, bytes], kind: str, tmp_path: Path) -> None:
    rng, path = np.random.default_rng(7), tmp_path / f"a{kind}"
    path.write_bytes(sound[kind])
    READERS[kind](path)  # what is compiled for the first file takes none of a damaged one's time

    faults = {}
    for number in range(COUNT // 3 if kind == ".dng" else COUNT):
        path.write_bytes(damaged(sound[kind], rng))
        if problem := fault(path, READERS[kind]):
            faults[number] = problem
    assert not faults


@pytest.mark.parametrize("kind", LUTS)
def test_no_bytes_at_all_and_random_bytes(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{kind}"
    for count in (0, 1, 100, 4000):
        path.write_bytes(np.random.default_rng(count).bytes(count))
        with pytest.raises(LutError):
            READERS[kind](path)
        assert not fault(path, READERS[kind])


@pytest.mark.parametrize("tag", [50778, 50940, 50964, 50982])  # a light, the tone curve, a matrix, the look table
def test_a_camera_profile_with_an_empty_tag(sound: dict[str, bytes], tag: int, tmp_path: Path) -> None:
    at, path = sound[".dcp"].index(struct.pack("<H", tag)), tmp_path / "a.dcp"
    path.write_bytes(sound[".dcp"][: at + 4] + bytes(4) + sound[".dcp"][at + 8 :])
    assert not fault(path, inspect)


def test_a_camera_profile_that_names_a_huge_table_takes_no_memory(sound: dict[str, bytes], tmp_path: Path) -> None:
    sizes, path = struct.pack("<III", 6, 4, 2), tmp_path / "a.dcp"
    assert sound[".dcp"].count(sizes) == 1
    path.write_bytes(sound[".dcp"].replace(sizes, struct.pack("<III", 313_125, 9, 278)))
    with pytest.raises(LutError, match="camera profile"):
        read_dcp(path)
    assert not fault(path, inspect)
