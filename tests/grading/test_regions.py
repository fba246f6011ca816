"""An image that is graded region by region is the image that is graded at once."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

from lutforge.errors import ImageError
from lutforge.grading.grade import Grade, LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.read import is_premultiplied, read_image
from tests.cases.pictures import apply_to_pixels, write_cube, write_picture


@pytest.fixture
def grade(tmp_path: Path) -> Grade:
    return LutRecipe(write_cube(tmp_path / "look.cube")).grade(tmp_path)


@pytest.mark.parametrize(
    ("name", "target", "kind", "tile", "channels"),
    [
        ("a.tif", "b.tif", "uint16", 0, 3),
        ("a.tif", "b.tif", "uint8", 16, 4),
        ("a.tif", "b.png", "uint16", 32, 3),
        ("a.tif", "b.exr", "uint16", 32, 5),
        ("a.exr", "b.exr", "half", 0, 4),
        ("a.exr", "b.exr", "float", 16, 3),
        ("a.png", "b.tif", "uint8", 0, 4),
        ("a.dpx", "b.dpx", "uint16", 0, 3),
    ],
)
@pytest.mark.parametrize("workers", [1, 3])
def test_regions_give_the_whole(
    tmp_path: Path, grade: Grade, name: str, target: str, kind: str, tile: int, channels: int, workers: int
) -> None:
    orientation = 1 if name == "a.dpx" else 6  # which has no place for it
    write_picture(tmp_path / name, (150, 90), kind, tile, channels, Orientation=orientation)
    done = apply_image(grade, tmp_path / name, tmp_path / target, workers, region_samples=90 * 20 * channels)
    before, after = read_image(tmp_path / name), read_image(tmp_path / target)
    whole = apply_to_pixels(grade.processor, before.pixels, is_premultiplied(before.spec))
    step = {"uint8": 255, "uint16": 65535}.get(str(after.spec.format))
    expected = np.clip(whole, 0, 1) if step else whole
    tolerance = 0.51 / step if step else 1e-3 if after.spec.format == "half" else 0
    np.testing.assert_allclose(after.pixels, expected, atol=tolerance)
    assert (done.width, done.height) == (90, 150)
    assert after.spec.get_int_attribute("Orientation", 1) == orientation


@pytest.mark.parametrize("tile", [0, 16])
def test_data_windows_off_the_origin_stay_where_they_are(tmp_path: Path, grade: Grade, tile: int) -> None:
    pixels = np.random.default_rng(1).random((70, 50, 3), dtype=np.float32)
    spec = oiio.ImageSpec(50, 70, 3, "float")
    spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = -7, 11, 0, 0, 64, 64
    spec.tile_width = spec.tile_height = tile
    output = oiio.ImageOutput.create("a.exr")
    assert output is not None
    assert output.open(str(tmp_path / "a.exr"), spec)
    assert output.write_image(pixels)
    assert output.close()
    apply_image(grade, tmp_path / "a.exr", tmp_path / "b.exr", 2, region_samples=50 * 3 * 16)
    graded = read_image(tmp_path / "b.exr")
    assert (graded.spec.x, graded.spec.y, graded.spec.full_width) == (-7, 11, 64)
    np.testing.assert_array_equal(graded.pixels, apply_to_pixels(grade.processor, pixels))


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".exr", ".dpx", ".webp"])
def test_a_truncated_file_is_noticed_and_leaves_nothing(tmp_path: Path, grade: Grade, suffix: str) -> None:
    source = tmp_path / f"a{suffix}"
    write_picture(source, (200, 100), "half" if suffix == ".exr" else "uint8", DateTime="2020:01:01 00:00:00")
    source.write_bytes(source.read_bytes()[: source.stat().st_size * 2 // 3])
    refused = partial(pytest.raises, ImageError, match="damaged or cut short|copy it again")
    with refused():
        read_image(source)
    with refused():
        apply_image(grade, source, tmp_path / "out" / source.name, 2, region_samples=10_000)
    assert list(tmp_path.glob("out/*")) == []


@pytest.mark.slow
def test_memory_does_not_grow_with_the_image(tmp_path: Path) -> None:
    """60 Mpixel as floats would take 720 MB; a whole run, with Python and its libraries, stays below 450."""
    cube = write_cube(tmp_path / "look.cube")
    spec = oiio.ImageSpec(10_000, 6_000, 3, "uint8")
    spec.attribute("compression", "none")
    output = oiio.ImageOutput.create("a.tif")
    assert output is not None
    assert output.open(str(tmp_path / "a.tif"), spec)
    strip = np.full((500, 10_000, 3), 0.5, np.float32)
    for top in range(0, 6_000, 500):
        assert output.write_scanlines(top, top + 500, 0, strip)
    assert output.close()
    code = (
        "import sys\nfrom pathlib import Path\nfrom lutforge.grading.grade import LutRecipe\n"
        "from lutforge.grading.image import apply_image\n"
        "apply_image(LutRecipe(Path(sys.argv[1])).grade(Path()), sys.argv[2], sys.argv[3])\n"
        "print(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])"
    )
    words = [sys.executable, "-c", code, str(cube), str(tmp_path / "a.tif"), str(tmp_path / "b.tif")]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    assert int(run.stdout) < 450 * 1024  # kB
