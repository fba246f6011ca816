"""LUTs that are pictures are told by their content, read in apply, check and read_lut, and pictures are none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image
import pytest

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.images.read import read_image
from lutforge.luts.check import check_lut
from lutforge.luts.reading import read_lut
from lutforge.model.lattice import grid, uniform_levels
from tests.conftest import CommandLine, Refused


def look(x: Array) -> Array:
    """A look whose red, green and blue cannot be mistaken for each other."""
    r, g, b = np.moveaxis(x, -1, 0)
    return np.asarray(np.clip(np.stack([r**0.8, 0.8 * g + 0.1 * b, 0.9 * b**1.2 + 0.05], axis=-1), 0.0, 1.0))


def black_and_white(x: Array) -> Array:
    return np.repeat((x @ np.array([0.2126, 0.7152, 0.0722]))[..., None], 3, axis=-1)


def hald(values: Array) -> Array:
    """Pixels whose red goes fastest, row after row."""
    n = len(values)
    side = round(n**1.5)
    return values.transpose(2, 1, 0, 3).reshape(side, side, 3)


def tiles(values: Array) -> Array:
    """Square tiles of one blue each, from left to right and downwards; red to the right, green downwards."""
    n = len(values)
    m = round(n**0.5)
    return values.reshape(n, n, m, m, 3).transpose(2, 1, 3, 0, 4).reshape(m * n, m * n, 3)


def strip(values: Array) -> Array:
    """The tiles side by side, as in Unreal and Unity."""
    n = len(values)
    return values.transpose(1, 2, 0, 3).reshape(n, n * n, 3)


def strip_upwards(values: Array) -> Array:
    """The same with green upwards, as OpenGL has pictures."""
    return strip(values)[::-1]


def save(path: Path, pixels: Array, kind: str = "uint8") -> Path:
    oiio.ImageBuf(np.ascontiguousarray(pixels, dtype=np.float32)).write(str(path), kind)
    return path


LAYOUTS: dict[str, tuple[Callable[[Array], Array], tuple[int, ...], str]] = {
    "Hald": (hald, (4, 9, 16, 25, 64), "Hald image"),
    "tiles": (tiles, (4, 9, 16, 25, 64), "lookup of"),
    "strip": (strip, (16, 32, 64), "strip of"),
    "strip, green upwards": (strip_upwards, (16, 32, 64), "green upwards"),
}


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
@pytest.mark.parametrize("kind", ["uint8", "uint16"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_each_layout_is_told_by_its_content(tmp_path: Path, layout: str, kind: str, name: str) -> None:
    lay_out, sizes, called = LAYOUTS[layout]
    x = np.random.default_rng(0).random((200, 3))
    for size in sizes:
        for function in (look, black_and_white, np.negative):
            values = np.clip(function(grid(uniform_levels(size))) + (function is np.negative), 0.0, 1.0)
            path = save(tmp_path / name, lay_out(values), kind)
            lut = read_lut(path)
            assert lut.size == size
            assert called in lut.metadata.format or function is np.negative  # upside down is negative, too
            assert lut.cube is not None
            if function is not np.negative:
                np.testing.assert_allclose(lut.cube.values, values, atol=0.6 / 255)
    says = check_lut(path).readers
    assert ("RawTherapee" in " ".join(says)) == (layout == "Hald"), says
    assert np.isfinite(lut(x)).all()


@pytest.mark.parametrize(
    ("size", "kind", "name"),
    [
        (64, "uint16", "film.png"),
        (64, "uint8", "film.tif"),
        pytest.param(256, "uint8", "level16.png", marks=pytest.mark.slow),
    ],
)
def test_a_hald_grades_as_any_other_lut(lutforge: CommandLine, tmp_path: Path, size: int, kind: str, name: str) -> None:
    """At 4096² of 8 bits each colour has its node, so that what comes out is exact."""
    codes = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    PIL.Image.fromarray(codes).save(tmp_path / "a.png")
    save(tmp_path / name, hald(look(grid(uniform_levels(size)))), kind)
    output = lutforge("apply", name, "a.png", "-o", "graded", cwd=tmp_path)
    expected = 255 * look(codes / 255.0)
    shown = 255 * read_image(tmp_path / "graded" / "a.png").pixels
    assert np.abs(shown - expected).max() < (0.51 if size == 256 else 1.5)
    assert ("8 bits per channel" in output.stderr) == (kind == "uint8")


def test_a_hald_is_printed_for_a_farm_and_inspected(lutforge: CommandLine, tmp_path: Path) -> None:
    PIL.Image.new("RGB", (16, 16), "teal").save(tmp_path / "a.png")
    save(tmp_path / "film.png", hald(look(grid(uniform_levels(64)))), "uint16")
    lutforge("apply", "film.png", "a.png", "-o", "farm", "--print-commands", cwd=tmp_path)
    assert "film.png" in lutforge("inspect", "film.png", cwd=tmp_path).stdout


def test_a_picture_of_a_luts_size_is_a_picture(refused: Refused, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    photograph = np.asarray(PIL.Image.fromarray(rng.integers(0, 256, (24, 24, 3), dtype=np.uint8)).resize((512, 512)))
    gradient = np.repeat(np.linspace(0, 1, 512)[:, None, None], 512, axis=1).repeat(3, axis=2)
    for pixels in (photograph / 255.0, gradient):
        save(tmp_path / "photo.png", pixels)
        assert "a picture; name the LUT" in refused(tmp_path, "apply", "photo.png", "photo.png", "-o", "out")
    save(tmp_path / "photo.png", photograph / 255.0)
    with pytest.raises(LutError, match="neighbouring colours jump"):
        read_lut(tmp_path / "photo.png")
    save(tmp_path / "photo.png", np.zeros((300, 400, 3)))
    with pytest.raises(LutError, match="1024 × 32"):
        read_lut(tmp_path / "photo.png")
