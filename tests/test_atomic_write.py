"""A file is written whole or not at all."""

import os
from pathlib import Path

import pytest

from lutforge.atomic_write import atomic_path, remove_temporaries, require_writable, scratch_folder
from lutforge.errors import LutForgeError


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "out" / "look.cube"
    with atomic_path(target) as temporary:
        temporary.write_text("first")
        assert not target.exists()
        assert temporary.suffix == ".cube"
    with pytest.raises(RuntimeError), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert target.read_text() == "first"
    assert [path.name for path in target.parent.iterdir()] == ["look.cube"]


def test_the_file_has_ordinary_permissions(tmp_path: Path) -> None:
    umask = os.umask(0o022)
    try:
        with atomic_path(tmp_path / "a") as temporary:
            temporary.write_text("x")
    finally:
        os.umask(umask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o644


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "file" / "a.cube", tmp_path):
        with pytest.raises(LutForgeError) as caught:
            require_writable(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(LutForgeError, match="cannot write"), atomic_path(tmp_path / "file" / "a.cube"):
        pass
    require_writable(tmp_path / "new" / "folder" / "a.cube")
    assert not (tmp_path / "new").exists()


def test_what_a_killed_run_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    short, long = tmp_path / "a.b.png", tmp_path / ("x" * 240 + ".png")
    left = []
    for path in (short, long, tmp_path / "other.png"):
        with atomic_path(path) as temporary:
            temporary.write_bytes(b"whole")
            left.append(temporary)
    kept = tmp_path / ".a.b.png"
    for path in (*left, kept):
        path.write_bytes(b"half")
    remove_temporaries([short, long, tmp_path / "none" / "c.png"])
    assert sorted(tmp_path.iterdir()) == sorted([short, long, tmp_path / "other.png", left[2], kept])


def test_a_scratch_folder_lies_beside_what_it_is_for_and_goes(tmp_path: Path) -> None:
    with scratch_folder(next_to=tmp_path / "config.ocioz") as folder:
        assert folder.parent == tmp_path
        (folder / "half.clf").touch()
    assert list(tmp_path.iterdir()) == []


def test_folders_that_were_made_for_a_file_go_with_it(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    for folder in (tmp_path / "new" / "luts", tmp_path / "own"):
        with pytest.raises(LutForgeError, match="No space left"), atomic_path(folder / "a.clf"):
            raise OSError(28, "No space left on device")
    assert [path.name for path in tmp_path.rglob("*")] == ["own"]


def test_what_cannot_be_written_in_a_scratch_folder_is_told_of_what_it_is_for(tmp_path: Path) -> None:
    for words in (("No space left on device",), ("No space left on device", "x.clf")):
        target = tmp_path / "new" / "config.ocioz"
        with pytest.raises(LutForgeError) as raised, scratch_folder(next_to=target) as folder:
            if len(words) == 1:
                raise OSError(28, *words)
            with atomic_path(folder / words[1]):
                raise OSError(28, words[0])
        assert str(raised.value) == f"{target}: cannot write (No space left on device)"
    with pytest.raises(LutForgeError, match=r"^as it is$"), scratch_folder(next_to=target):
        raise LutForgeError("as it is")
    assert list(tmp_path.iterdir()) == []
