"""A file is written whole or not at all."""

import os
import pickle
import sys
from pathlib import Path

import pytest

from lutforge.atomic_write import atomic_path, remove_temporaries, require_writable, scratch_folder
from lutforge.boundary import reading, require_file
from lutforge.errors import ImageError, LutForgeError, SampleError


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
        with pytest.raises(LutForgeError) as told, scratch_folder(next_to=target) as folder:
            if len(words) == 1:
                raise OSError(28, *words)
            with atomic_path(folder / words[1]):
                raise OSError(28, words[0])
        assert str(told.value) == f"{target}: cannot write (No space left on device)"
    with pytest.raises(LutForgeError, match=r"^as it is$"), scratch_folder(next_to=target):
        raise LutForgeError("as it is")
    assert list(tmp_path.iterdir()) == []


# --- Whatever a reader raises or prints, one printable line of LutForge's own error leaves the boundary ---------------


class PanicException(BaseException):
    """As pyo3's, which derives from BaseException."""


@pytest.mark.parametrize(
    "failure",
    [
        PanicException("called `Option::unwrap()` on a `None` value\nnote: run with `RUST_BACKTRACE=1`"),
        MemoryError(),
        RecursionError("maximum recursion depth exceeded"),
        UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
        OverflowError("int too large to convert to float"),
        KeyError("\x1b[31m" + "x" * 100_000),
        AssertionError(),
        StopIteration(),
    ],
    ids=lambda failure: type(failure).__name__,
)
def test_every_failure_becomes_one_line(failure: BaseException) -> None:
    with pytest.raises(SampleError) as caught, reading("a.npz", "a sample table", SampleError):
        raise failure
    text = str(caught.value)
    assert text.startswith("a.npz: cannot be read as a sample table (")
    assert text.isprintable()
    assert len(text) <= 300


@pytest.mark.parametrize("failure", [KeyboardInterrupt, SystemExit])
def test_what_the_user_asks_for_passes(failure: type[BaseException]) -> None:
    with pytest.raises(failure), reading("a.npz", "a sample table"):
        raise failure


def test_own_errors_pass_and_name_the_file_once() -> None:
    for words in ("a.npz: row 7: empty", "row 7: empty"):
        with pytest.raises(SampleError, match=r"^a\.npz: row 7: empty$"), reading("a.npz", "a table", ImageError):
            raise SampleError(words)


def test_messages_are_one_printable_line_with_their_ends() -> None:
    error = LutForgeError("a.cube: \x1b[2J\ncolumn " + "long " * 1000 + "; write it anew")
    text = str(error)
    assert len(text) <= 500
    assert text.isprintable()
    assert text.startswith("a.cube: ?[2J column long")
    assert text.endswith("; write it anew")
    assert str(pickle.loads(pickle.dumps(error))) == text


def test_only_regular_files_of_a_sane_size_are_opened(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    (tmp_path / "large").write_bytes(bytes(11))
    wrong = {"missing": "no such file", ".": "a folder, not a LUT", "empty": "is empty", "large": "11 bytes are more"}
    if sys.platform == "linux":  # other systems have neither
        wrong |= {os.fsdecode(b"a\xff.jpg"): "its name is not text in UTF-8; rename it", "pipe": "not a regular file"}
        (tmp_path / os.fsdecode(b"a\xff.jpg")).write_bytes(b"x")
        os.mkfifo(tmp_path / "pipe")
    for name, says in wrong.items():
        with pytest.raises(LutForgeError, match=says):
            require_file(tmp_path / name, "a LUT", most=10)


@pytest.mark.skipif(os.name != "posix", reason="the system locks no folders")
def test_the_folder_of_a_killed_process_is_removed_by_the_next_and_that_of_one_at_work_stays(tmp_path: Path) -> None:
    import subprocess

    code = (
        "import sys, time\nfrom lutforge.atomic_write import scratch_folder\n"
        f"with scratch_folder(next_to={str(tmp_path / 'kit')!r}) as folder:\n"
        "    (folder / 'half').touch()\n    print(folder, flush=True)\n    time.sleep(600)"
    )
    runs = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    folders = []
    for run in runs:
        assert run.stdout is not None
        folders.append(Path(run.stdout.readline().strip()))
    dead, alive = runs
    dead.kill()
    dead.wait()
    (tmp_path / ".lutforge-apply.jsonl").touch()
    with scratch_folder(next_to=tmp_path / "kit"):
        assert not folders[0].exists()
        assert (folders[1] / "half").is_file()
    alive.kill()
    alive.wait()
    with scratch_folder(next_to=tmp_path / "kit"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == [".lutforge-apply.jsonl"]
    for run in runs:
        assert run.stdout is not None
        run.stdout.close()
