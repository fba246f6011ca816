"""Files, folders and frame sequences become a list of images."""

import sys
from pathlib import Path

import pytest

from lutforge.apply.batch import plan_jobs
from lutforge.apply.inputs import Input, find_inputs, parse_frames
from lutforge.errors import ImageError, SettingsError


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    for name in ("f.0001.exr", "f.0002.exr", "f.0005.exr", "f.0009.exr", "f.00012.exr", "f.10000.exr", "f.x.exr"):
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize("pattern", ["f.####.exr", "f.#.exr", "f.@@@@.exr", "f.%04d.exr"])
def test_a_sequence_is_what_is_on_the_disk(frames: Path, pattern: str) -> None:
    found = find_inputs([frames / pattern])
    assert [image.path.name for image in found.images] == [
        f"f.{n}.exr" for n in ("0001", "0002", "0005", "0009", "10000")
    ]
    assert found.notes == (f"{frames / pattern}: not there: frame 3-4, 6-8, 10-9999",)
    assert found.missing == ()


@pytest.mark.parametrize(("pattern", "option"), [("f.1-9x4,2####.exr", None), ("f.%04d.exr", "1-9x4,2")])
def test_frames_that_are_asked_for_are_there_or_named(frames: Path, pattern: str, option: str | None) -> None:
    found = find_inputs([frames / pattern], frames=option)
    assert [image.path.name for image in found.images] == ["f.0001.exr", "f.0005.exr", "f.0009.exr", "f.0002.exr"]
    more = find_inputs([frames / "f.1-3#.exr"])
    assert [failure.source.name for failure in more.missing] == ["f.0003.exr"]


def test_a_file_of_that_name_comes_first(tmp_path: Path) -> None:
    (tmp_path / "take #2.png").touch()
    assert [image.path.name for image in find_inputs([tmp_path / "take #2.png"]).images] == ["take #2.png"]
    assert find_inputs([tmp_path / "none.png"]).images[0].path.name == "none.png"  # reading it will say so


def test_folders_keep_their_tree_without_the_output(tmp_path: Path) -> None:
    for name in ("a.JPG", "b.txt", ".hidden.jpg", "sub/c.tif", "sub/.d/e.tif", "out/a.JPG"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert [str(image.place) for image in find_inputs([tmp_path]).images] == ["a.JPG"]
    found = find_inputs([tmp_path], recursive=True, leave_out=[tmp_path / "out"])
    assert [str(image.place) for image in found.images] == ["a.JPG", "sub/c.tif"]
    with pytest.raises(ImageError, match="choose another output folder"):
        find_inputs([tmp_path / "sub" / ".d" / ".."], leave_out=[tmp_path / "sub"])


@pytest.mark.parametrize("text", ["", "5-1", "a-b", "1-9x0", "1-999999999", "1,,2", "-3"])
def test_frames_that_make_no_sense(text: str) -> None:
    with pytest.raises(SettingsError, match="frames are written as"):
        parse_frames(text)


def test_a_sequence_without_frames(tmp_path: Path) -> None:
    for word in ("f.####.exr", "none/f.####.exr"):
        with pytest.raises(ImageError, match="no "):
            find_inputs([tmp_path / word])


@pytest.mark.skipif(sys.platform == "win32", reason="links want rights there")
def test_links_of_files_and_folders_are_followed_where_an_output_would_replace_an_input(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.png").touch()
    (tmp_path / "folder").symlink_to("in")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.png").symlink_to(tmp_path / "in" / "a.png")
    image = Input(tmp_path / "in" / "a.png", Path("a.png"))
    for folder in ("in", "folder", "out"):
        with pytest.raises(ImageError, match="the output would replace an input"):
            plan_jobs([image], tmp_path / folder)
