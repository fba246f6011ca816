"""Registration: known geometry is found again through an unknown tone curve and colour matrix."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.arrays import Array
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.geometry import Placement, Registration
from lutforge.shots.read import read_shot
from lutforge.shots.registration import register as registration_as_a_whole
from lutforge.shots.registration.register import register_rotated


def register(raw: RawImage, jpeg: NDArray[np.uint8]) -> Registration:
    """The place of a JPEG that is oriented like the sensor."""
    return register_rotated(raw, jpeg, (0,))[1]


def raw_image(pixels: Array, pixel_size: float = 1.0) -> RawImage:
    small = pixels.astype(np.float32)
    return RawImage(small, pixel_size, 0, None, None, "", math.nan, math.nan, np.ones(3))


def rectangles(height: int = 600, width: int = 800, seed: int = 0) -> Array:
    """A linear scene (h, w, 3) of turned, softened rectangles of random colour."""
    rng = np.random.default_rng(seed)
    scene = np.full((height, width, 3), 0.3)
    for _ in range(90):
        cy, cx, angle = rng.uniform(0, height), rng.uniform(0, width), rng.uniform(0, math.pi)
        half_sides = rng.uniform(5, 80), rng.uniform(5, 80)
        reach = math.hypot(*half_sides)
        top, left = (max(0, math.floor(centre - reach)) for centre in (cy, cx))
        around = scene[top : math.ceil(cy + reach) + 1, left : math.ceil(cx + reach) + 1]
        y, x = np.mgrid[: around.shape[0], : around.shape[1]]
        y, x = y + top, x + left
        u = (x - cx) * math.cos(angle) + (y - cy) * math.sin(angle)
        v = (y - cy) * math.cos(angle) - (x - cx) * math.sin(angle)
        around[np.maximum(abs(u) / half_sides[0], abs(v) / half_sides[1]) < 1] = rng.uniform(0.02, 0.9, 3)
    return np.asarray(ndimage.gaussian_filter(scene, (1, 1, 0)))


def area_means(plane: Array, scale: float, offset: float, count: int) -> Array:
    """Means over [offset + scale * i, offset + scale * (i + 1)] along the first axis, by the integral."""
    integral = np.concatenate([np.zeros((1, *plane.shape[1:])), np.cumsum(plane, axis=0)])
    edges = offset + scale * np.arange(count + 1)
    whole = np.clip(np.floor(edges).astype(int), 0, len(plane) - 1)
    rest = (edges - whole).reshape(-1, *[1] * (plane.ndim - 1))
    return np.asarray(np.diff(integral[whole] + rest * plane[whole], axis=0) / scale)


def developed(scene: Array, scale: float, offset: tuple[float, float], size: tuple[int, int]) -> NDArray[np.uint8]:
    """The scene resized, through a strong colour matrix and a tone curve, rounded to 8 bits."""
    rows = np.swapaxes(area_means(scene, scale, offset[1], size[0]), 0, 1)
    resized = np.swapaxes(area_means(rows, scale, offset[0], size[1]), 0, 1)
    matrix = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]])
    encoded = np.clip(resized @ matrix.T * 1.1, 0, 1) ** (1 / 2.4)
    toned = np.clip(encoded + 0.06 * np.sin(2 * np.pi * (encoded - 0.5)), 0, 1)
    return np.asarray(np.rint(255 * toned), dtype=np.uint8)


def sensor(scene: Array, noise: float = 0.005) -> RawImage:
    rng = np.random.default_rng(1)
    mixed = scene * np.array([0.5, 1.0, 0.6]) + rng.normal(0, noise, scene.shape)
    return raw_image(np.clip(mixed, 0, 1))


def error(found: Registration, scale: float, offset: tuple[float, float], jpeg: NDArray[np.uint8]) -> float:
    """Largest error anywhere in the picture, in JPEG pixels."""
    errors = [
        (found.scale - scale) * place + got - true
        for got, true, side in ((found.offset_x, offset[0], jpeg.shape[1]), (found.offset_y, offset[1], jpeg.shape[0]))
        for place in (0, side)
    ]
    return float(np.abs(errors).max() / scale)


@pytest.mark.parametrize(
    ("scale", "offset", "size"),
    [
        (2.37, (11.3, 7.7), (245, 330)),  # trimmed borders
        (2.4, (4.0, 2.6), (247, 330)),
        (2.45, (3.0, 82.5), (180, 324)),  # 16:9 of a 4:3 sensor
        (2.45, (101.0, 3.0), (242, 242)),  # square
        (1.2, (5.2, 4.1), (490, 655)),
        (1.0, (4.0, 4.0), (590, 790)),
    ],
)
def test_finds_scale_and_offset(scale: float, offset: tuple[float, float], size: tuple[int, int]) -> None:
    scene = rectangles(seed=round(10 * scale))
    jpeg = developed(scene, scale, offset, size)
    assert error(register(sensor(scene), jpeg), scale, offset, jpeg) < 0.1


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_finds_the_rotation(turns: int) -> None:
    scene = rectangles(seed=2)
    jpeg = developed(scene, 2.37, (11.3, 7.7), (245, 330))
    turned, found = register_rotated(sensor(scene), np.rot90(jpeg, -turns))
    np.testing.assert_array_equal(turned, jpeg)
    assert error(found, 2.37, (11.3, 7.7), jpeg) < 0.1


def symmetric(share: float) -> Array:
    """A scene that looks alike upside down; in colour too, but for a share of it."""
    scene = rectangles(seed=6)
    turned = np.clip(scene[::-1, ::-1] + share * (scene - scene[::-1, ::-1]), 0.02, 0.9)
    scene[:300] = turned[:300]
    return scene


@pytest.mark.parametrize("turns", [0, 2])
def test_the_colours_tell_which_side_is_up(turns: int) -> None:
    scene = symmetric(0.3)
    jpeg = developed(scene, 2.37, (11.3, 7.7), (245, 330))
    turned, found = register_rotated(sensor(scene), np.rot90(jpeg, -turns), (0, 2))
    np.testing.assert_array_equal(turned, jpeg)
    assert error(found, 2.37, (11.3, 7.7), jpeg) < 0.1


def placed(scale: float, offset: tuple[float, float], jpeg: NDArray[np.uint8]) -> Placement:
    """Where a JPEG of a scene lies, as another shot of the camera tells it."""
    return Placement((600, 800, 1.0), (jpeg.shape[0], jpeg.shape[1]), Registration(scale, *offset, 0.9))


@pytest.mark.parametrize("told", [True, False])
def test_refuses_what_fits_nearly_as_well_upside_down(told: bool) -> None:
    """Whether or not another shot tells the place."""
    scene = symmetric(0.01)
    jpeg = developed(scene, 2.4, (4.0, 2.6), (247, 330))
    with pytest.raises(ShotError, match="nearly as well at a second place, or turned"):
        register_rotated(sensor(scene), jpeg, (0, 2), placed(2.4, (4.0, 2.6), jpeg) if told else None)


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_searches_nothing_where_another_shot_tells_the_place(turns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = rectangles(seed=3)
    jpeg = developed(scene, 2.37, (11.3, 7.7), (245, 330))
    monkeypatch.setattr(registration_as_a_whole, "search", None)
    near = placed(2.371, (11.0, 8.2), jpeg)
    turned, found = register_rotated(sensor(scene), np.rot90(jpeg, -turns), expected=near)
    np.testing.assert_array_equal(turned, jpeg)
    assert error(found, 2.37, (11.3, 7.7), jpeg) < 0.1


@pytest.mark.parametrize(("offset", "size"), [((71.3, 60.7), (245, 330)), ((11.3, 7.7), (245, 331))])
def test_searches_where_another_shot_tells_a_wrong_place(offset: tuple[float, float], size: tuple[int, int]) -> None:
    scene = rectangles(seed=3)
    jpeg = developed(scene, 2.37, (11.3, 7.7), (245, 330))
    wrong = placed(2.37, offset, np.empty((*size, 3), dtype=np.uint8))
    found = register_rotated(sensor(scene), jpeg, expected=wrong)[1]
    assert found == register(sensor(scene), jpeg)


def test_a_refusal_names_what_was_too_little(shared_data: Path) -> None:
    """Four fifths of a photograph: its structure correlates somewhere, its colours belong nowhere."""
    shot = read_shot(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    height, width = shot.jpeg.shape[:2]
    cropped = np.ascontiguousarray(shot.jpeg[height // 10 : height * 9 // 10, width // 10 : width * 9 // 10])
    with pytest.raises(ShotError, match="of its colours explained, needed 50%"):
        register_rotated(shot.raw, cropped)


def test_ignores_black_bars() -> None:
    scene = rectangles(seed=3)
    jpeg = developed(scene, 2.45, (3.0, 82.5), (180, 324))
    barred = np.zeros((240, 324, 3), dtype=np.uint8)
    barred[30:210] = jpeg
    assert error(register(sensor(scene), barred), 2.45, (3.0, 82.5 - 30 * 2.45), barred) < 0.1


@pytest.mark.parametrize("other", ["another scene", "flat"])
def test_refuses_what_does_not_match(other: str) -> None:
    jpeg = developed(rectangles(seed=8), 2.37, (11.3, 7.7), (245, 330))
    if other == "flat":
        jpeg = np.full_like(jpeg, 120)
    with pytest.raises(ShotError, match=r"does not match the RAW \(correlation"):
        register(sensor(rectangles(seed=5)), jpeg)


def test_refuses_thumbnails() -> None:
    with pytest.raises(ShotError, match="160×120 pixels: a thumbnail"):
        register(sensor(rectangles()), np.zeros((120, 160, 3), dtype=np.uint8))


@pytest.mark.parametrize(
    ("file", "scale", "offset"),
    [
        ("canon_powershot_s40/CRW_0101.CRW", 3.55, (19.3, 7.5)),
        ("canon_powershot_s40/CRW_0104.CRW", 3.55, (19.3, 7.5)),
        ("canon_powershot_s40/CRW_0112.CRW", 3.55, (19.3, 7.5)),
        ("canon_powershot_s40/CRW_0117.CRW", 3.55, (19.3, 7.5)),
        ("canon_powershot_s40/CRW_0118.CRW", 3.55, (19.3, 7.5)),
        ("canon_eos_d30/Canon_D30_imagemeta_CRW.CRW", 1.4994, (8.3, 5.0)),
    ],
)
def test_real_cameras(shared_data: Path, file: str, scale: float, offset: tuple[float, float]) -> None:
    """Against values found by hand: the scale, and where the picture's centre falls, within a quarter RAW pixel."""
    shot = read_shot(shared_data / file)
    place, (height, width) = shot.registration, shot.jpeg.shape[:2]
    assert place.scale == pytest.approx(scale, abs=0.001)
    assert place.scale * width / 2 + place.offset_x == pytest.approx(scale * width / 2 + offset[0], abs=0.25)
    assert place.scale * height / 2 + place.offset_y == pytest.approx(scale * height / 2 + offset[1], abs=0.25)
    assert place.correlation > 0.9
