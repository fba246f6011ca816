"""Zip files of strangers (profiles, tables, workspaces, archived configs) that unpack to more than they state."""

import tracemalloc
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import load_profile
from lutforge.ocio.config import write_config
from lutforge.ocio.merging import open_base
from lutforge.pipeline.inspection import check
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from lutforge.studio.workspace import Workspace
from lutforge.studio.workspace_file import DOCUMENT, open_workspace, save_workspace
from tests.cases.profiles import small_profile
from tests.cases.samples import chart_140, photograph_patches


def _merged(path: Path) -> None:
    with open_base(path):
        pass


READERS: Mapping[str, tuple[Callable[[Path], object], str, str]] = {
    "profile": (load_profile, "a.npz", "profile.json"),
    "table": (read_samples, "samples.npz", "raw_r.npy"),
    "workspace": (open_workspace, "a.workspace", DOCUMENT),
    "config": (check, "a.ocioz", "config.ocio"),
    "base": (_merged, "a.ocioz", "config.ocio"),
}
"""What reads a kind of file; its name, and that of the entry which it reads first."""
STATED, UNPACKED = 20_011, 200_000_000  # bytes


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, samples = tmp_path_factory.mktemp("sound"), photograph_patches(nikon_d5100(), chart_140()[:40])
    profile = small_profile()
    profile.save(folder / "a.npz")
    samples.save(folder / "samples.npz")
    save_workspace(Workspace(samples), folder / "a.workspace")
    write_config([profile], folder / "a.ocioz", inverse_size=5)
    return folder


def _rewritten(source: Path, target: Path, packing: int, entry: str, content: bytes | None = None) -> None:
    """The archive with all its entries packed so, and one with another content."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w", packing) as new:
        for name in archive.namelist():
            new.writestr(name, content if name == entry and content is not None else archive.read(name))


@pytest.mark.parametrize("kind", READERS)
def test_an_entry_that_unpacks_to_more_than_it_states_takes_no_memory(sound: Path, kind: str, tmp_path: Path) -> None:
    read, name, entry = READERS[kind]
    path = tmp_path / name
    _rewritten(sound / name, path, zipfile.ZIP_DEFLATED, entry, bytes(UNPACKED))
    path.write_bytes(path.read_bytes().replace(UNPACKED.to_bytes(4, "little"), STATED.to_bytes(4, "little")))
    assert path.stat().st_size < 1_000_000
    tracemalloc.start()
    try:
        with pytest.raises(LutForgeError):
            read(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 20_000_000


@pytest.mark.parametrize("packing", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
@pytest.mark.parametrize("kind", READERS)
def test_a_packing_that_asks_for_memory_is_refused(sound: Path, kind: str, packing: int, tmp_path: Path) -> None:
    read, name, entry = READERS[kind]
    _rewritten(sound / name, tmp_path / name, packing, entry)
    with pytest.raises(LutForgeError, match=rf"{name}: refused, its parts are packed otherwise than by deflate"):
        read(tmp_path / name)
