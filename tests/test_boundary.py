"""Any error or output of a reader becomes one printable line of LutForge's own error."""

import os
import pickle
import sys
from pathlib import Path

import pytest

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading, require_file
from lutforge.errors import ImageError, LutForgeError, SampleError


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
