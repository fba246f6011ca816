"""Grading images through OpenColorIO: the pixels are the LUT's, everything else stays."""

import os
from pathlib import Path

import numpy as np
import pytest

from lutforge.errors import ImageError
from lutforge.grading.batch import apply_batch, plan_jobs
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.grading.inputs import BATCH_JOURNAL
from lutforge.grading.pixels import BLOCK_PIXELS
from lutforge.images.read import read_image
from lutforge.luts.reading import trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import MAX_SHAPER_SIZE
from lutforge.model.lattice import grid, snap_levels
from tests.cases.pictures import Pixels, apply_to_pixels, lut_of_nodes, write_picture
from tests.cases.same_bytes import same_bytes


@pytest.fixture(scope="module")
def lut() -> Lut:
    axis = snap_levels(np.linspace(0, 1, 17) ** 2, MAX_SHAPER_SIZE)
    levels = (axis, axis, axis)
    return lut_of_nodes(levels, np.sqrt(grid(levels))[..., ::-1], (1.4, 1.0, 0.9))


@pytest.fixture(scope="module")
def lut_file(lut: Lut, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lut.write(tmp_path_factory.mktemp("lut") / "look.clf")


def picture(height: int = 30, width: int = 50, channels: int = 3) -> Pixels:
    return np.random.default_rng(9).random((height, width, channels), dtype=np.float32)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_block_and_thread_gives_the_lut_and_leaves_other_channels(lut: Lut, lut_file: Path, workers: int) -> None:
    pixels = picture(2 * BLOCK_PIXELS // 500 + 3, 500, channels=5)  # two whole blocks and a part
    before = pixels.copy()
    graded = apply_to_pixels(trusted_processor(lut_file), pixels, workers=workers)
    np.testing.assert_allclose(graded[..., :3], lut(pixels[..., :3]), atol=1e-5)
    np.testing.assert_array_equal(graded[..., 3:], pixels[..., 3:])
    np.testing.assert_array_equal(pixels, before)


def test_premultiplied_colours_are_graded_as_colours(lut: Lut, lut_file: Path) -> None:
    straight = picture(channels=4)
    straight[0, 0, 3] = 0.0
    pixels = straight.copy()
    pixels[..., :3] *= pixels[..., 3:]
    pixels[0, 0, :3] = (0.25, 0.5, 0.75)  # light without coverage, such as a flame
    graded = apply_to_pixels(trusted_processor(lut_file), pixels, premultiplied=True)
    expected = lut(straight[..., :3]) * straight[..., 3:]
    np.testing.assert_allclose(graded[1:, :, :3], expected[1:], atol=2e-5)
    np.testing.assert_array_equal(graded[0, 0], pixels[0, 0])


def test_a_batch_goes_on_past_failures(tmp_path: Path, lut: Lut, lut_file: Path) -> None:
    good, missing = tmp_path / "a.png", tmp_path / "missing.png"
    write_picture(good, kind="uint16")
    shares: list[float] = []
    recipe, out = LutRecipe(lut_file), tmp_path / "out"
    result = apply_batch(recipe, [missing, good], out, suffix="tif", progress=lambda _, share: shares.append(share))
    assert [failure.reason for failure in result.failed] == [f"{missing}: no such file"]
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert sorted(path.name for path in out.iterdir()) == [BATCH_JOURNAL, "a.tif"]
    np.testing.assert_allclose(read_image(out / "a.tif").pixels, lut(read_image(good).pixels), atol=2e-5)


def test_a_batch_refuses_to_replace_inputs_or_to_merge_names(tmp_path: Path, lut_file: Path) -> None:
    source, link = tmp_path / "a.png", tmp_path / "link.png"
    write_picture(source)
    before = source.read_bytes()
    os.link(source, link)
    with pytest.raises(ImageError, match="replace the input"):
        apply_image(LutRecipe(lut_file).grade(source), source, link)
    with pytest.raises(ImageError, match="replace an input"):
        apply_batch(LutRecipe(lut_file), [source], tmp_path)
    with pytest.raises(ImageError, match="would both become"):
        plan_jobs([Path("x/a.png"), Path("y/A.PNG")], tmp_path / "out")
    with pytest.raises(ImageError, match="would both become"):
        apply_batch(LutRecipe(lut_file), [source, source.with_suffix(".tif")], tmp_path / "out", ".exr")
    assert same_bytes(source, before)
    assert not (tmp_path / "out").exists()
