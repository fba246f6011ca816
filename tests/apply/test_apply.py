"""Grading images through OpenColorIO: the pixels are the LUT's, everything else stays."""

import os
from pathlib import Path

import numpy as np
import pytest

from lutforge.apply.batch import apply_batch, plan_jobs
from lutforge.apply.blocks import BLOCK, apply_to_pixels
from lutforge.apply.grade import LutRecipe
from lutforge.apply.image import apply_image
from lutforge.apply.inputs import JOURNAL, Input
from lutforge.errors import ImageError, LutError
from lutforge.images.read import read_image
from lutforge.luts.reading import file_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.lattice import grid, snap_levels
from tests.cases.luts import lut_of_nodes
from tests.cases.pictures import Pixels, write_picture


@pytest.fixture(scope="module")
def lut() -> Lut:
    axis = snap_levels(np.linspace(0, 1, 17) ** 2, SHAPER_SIZE)
    levels = (axis, axis, axis)
    return lut_of_nodes(levels, np.sqrt(grid(levels))[..., ::-1], (1.4, 1.0, 0.9))


@pytest.fixture(scope="module")
def lut_file(lut: Lut, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lut.write(tmp_path_factory.mktemp("lut") / "look.clf")


def picture(height: int = 30, width: int = 50, channels: int = 3) -> Pixels:
    return np.random.default_rng(9).random((height, width, channels), dtype=np.float32)


def save(path: Path, pixels: Pixels, kind: str = "float") -> Path:
    write_picture(path, kind=kind, pixels=pixels, Model="Nikon D40", Orientation=6)
    return path


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_block_and_thread_gives_the_lut(lut: Lut, lut_file: Path, workers: int) -> None:
    pixels = picture(2 * BLOCK // 500 + 3, 500)  # two whole blocks and a part
    before = pixels.copy()
    graded = apply_to_pixels(file_processor(lut_file), pixels, workers=workers)
    np.testing.assert_allclose(graded, lut(pixels), atol=1e-5)
    np.testing.assert_array_equal(pixels, before)


def test_extra_channels_are_untouched(lut: Lut, lut_file: Path) -> None:
    pixels = picture(channels=6)
    graded = apply_to_pixels(file_processor(lut_file), pixels)
    np.testing.assert_array_equal(graded[..., 3:], pixels[..., 3:])
    np.testing.assert_allclose(graded[..., :3], lut(pixels[..., :3]), atol=1e-5)


def test_premultiplied_colours_are_graded_as_colours(lut: Lut, lut_file: Path) -> None:
    straight = picture(channels=4)
    straight[0, 0, 3] = 0.0
    pixels = straight.copy()
    pixels[..., :3] *= pixels[..., 3:]
    pixels[0, 0, :3] = (0.25, 0.5, 0.75)  # light without coverage, such as a flame
    graded = apply_to_pixels(file_processor(lut_file), pixels, premultiplied=True)
    wanted = lut(straight[..., :3]) * straight[..., 3:]
    np.testing.assert_allclose(graded[1:, :, :3], wanted[1:], atol=2e-5)
    np.testing.assert_array_equal(graded[0, 0], pixels[0, 0])


@pytest.mark.parametrize(
    ("suffix", "kind", "tolerance"),
    [(".exr", "float", 1e-5), (".tif", "uint16", 2e-5), (".png", "uint8", 0.0025)],
)
def test_an_image_file_keeps_its_metadata(
    tmp_path: Path, lut: Lut, lut_file: Path, suffix: str, kind: str, tolerance: float
) -> None:
    source = save(tmp_path / f"in{suffix}", picture(), kind)
    done = apply_image(LutRecipe(lut_file).grade(source), source, tmp_path / "out" / f"in{suffix}")
    stored, graded = read_image(source), read_image(done.target)
    np.testing.assert_allclose(graded.pixels, np.clip(lut(stored.pixels), 0, 1), atol=tolerance)
    assert graded.spec.format == stored.spec.format
    assert graded.spec.get_string_attribute("Model") == "Nikon D40"
    assert graded.spec.get_int_attribute("Orientation") == 6
    assert graded.spec.get_string_attribute("Software") == "LutForge"
    if suffix != ".tif":
        assert graded.spec.get_string_attribute("Exif:ImageHistory") == "graded with look.clf"
    assert (done.width, done.height) == (50, 30)


def test_what_cannot_be_graded(tmp_path: Path, lut_file: Path) -> None:
    grade = LutRecipe(lut_file).grade(tmp_path)
    grey = save(tmp_path / "grey.tif", picture(channels=1))
    with pytest.raises(ImageError, match="red, green and blue; this image has 1 channel"):
        apply_image(grade, grey, tmp_path / "out.tif")
    colour = save(tmp_path / "colour.tif", picture())
    with pytest.raises(ImageError, match="replace the input"):
        apply_image(grade, colour, colour)
    os.link(colour, tmp_path / "link.tif")
    with pytest.raises(ImageError, match="replace the input"):
        apply_image(grade, colour, tmp_path / "link.tif")
    with pytest.raises(LutError, match="no such file"):
        LutRecipe(tmp_path / "none.clf").grade(colour)
    assert not (tmp_path / "out.tif").exists()


def test_a_batch_goes_on_past_failures(tmp_path: Path, lut: Lut, lut_file: Path) -> None:
    good, missing = save(tmp_path / "a.png", picture(), "uint16"), tmp_path / "missing.png"
    shares: list[float] = []
    recipe, out = LutRecipe(lut_file), tmp_path / "out"
    result = apply_batch(recipe, [missing, good], out, suffix="tif", progress=lambda _, share: shares.append(share))
    assert [failure.reason for failure in result.failed] == [f"{missing}: no such file"]
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert sorted(path.name for path in out.iterdir()) == [JOURNAL, "a.tif"]
    np.testing.assert_allclose(read_image(out / "a.tif").pixels, lut(read_image(good).pixels), atol=2e-5)


def test_a_batch_refuses_to_replace_inputs_or_to_merge_names(tmp_path: Path, lut_file: Path) -> None:
    source = save(tmp_path / "a.png", picture(), "uint8")
    before = source.read_bytes()
    with pytest.raises(ImageError, match="replace an input"):
        apply_batch(LutRecipe(lut_file), [source], tmp_path)
    with pytest.raises(ImageError, match="would both become"):
        plan_jobs([Input(Path("x/a.png"), Path("a.png")), Input(Path("y/A.PNG"), Path("A.PNG"))], tmp_path / "out")
    with pytest.raises(ImageError, match="would both become"):
        apply_batch(LutRecipe(lut_file), [source, source.with_suffix(".tif")], tmp_path / "out", ".exr")
    assert source.read_bytes() == before
    assert not (tmp_path / "out").exists()
