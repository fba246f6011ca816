"""Charts: a ColorChecker is believed, anything else is not, and its patches are where they are."""

import csv
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.colour.srgb import srgb_decode, srgb_encode
from lutforge.errors import CalibrationError
from lutforge.images.read import read_image
from lutforge.samples.chart import chart_kind, parse_corners
from lutforge.samples.chart_search import (
    RESEMBLANCE,
    LocatedChart,
    detector_note,
    find_chart,
    likeness,
    patch_codes,
    sample_chart,
)
from lutforge.samples.clipping import clipping
from lutforge.samples.extract import extract
from lutforge.shots.read import read_shot
from tests.cases.charts import chart_picture
from tests.cases.shots import MULTIPLIERS, render, synthetic_shot

REFERENCE = 255 * srgb_encode(np.clip(chart_kind("classic2014").linear_srgb(), 0, 1))
PLAIN = np.ones((24, 3))
needs_detector = pytest.mark.skipif(
    importlib.util.find_spec("cv2") is None, reason="needs the optional package opencv-contrib-python-headless"
)


def chart_scene(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(320, 480, 3) RAW of a chart between these corners (top left, top right, bottom left)."""
    y, x = np.mgrid[:320, :480]
    origin, across, down = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    u, v = np.linalg.solve(np.stack([across, down], axis=1), np.stack([x, y]).reshape(2, -1) - origin[:, None])
    column, row = np.floor(6 * u).astype(int), np.floor(4 * v).astype(int)
    inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    gap = (np.abs(6 * u % 1 - 0.5) > 0.44) | (np.abs(4 * v % 1 - 0.5) > 0.44)
    linear = np.clip(REFERENCE / 255, 0.01, 0.97) ** 2.2 / MULTIPLIERS
    index = np.clip(row, 0, 3) * 6 + np.clip(column, 0, 5)
    scene = np.where((inside & ~gap)[:, None], linear[index], 0.04)
    return scene.reshape(320, 480, 3)


CORNERS = np.array([[60.0, 40.0], [420.0, 70.0], [40.0, 280.0]])


def test_false_charts_are_refused() -> None:
    grid = REFERENCE.reshape(4, 6, 3)
    for false in (grid[:, ::-1], grid[::-1], grid[::-1, ::-1], np.roll(grid, 1, axis=1), np.roll(grid, 1, axis=0)):
        assert likeness(false.reshape(24, 3), PLAIN, REFERENCE) < RESEMBLANCE
    rng = np.random.default_rng(6)
    for _ in range(500):
        codes = rng.uniform(0, 255, (24, 3))
        codes[18:] = np.linspace(230, 30, 6)[:, None]
        assert likeness(codes, PLAIN, REFERENCE) < RESEMBLANCE
    grey = np.repeat(np.linspace(250, 20, 24)[:, None], 3, axis=1)
    assert likeness(grey, PLAIN, REFERENCE) < RESEMBLANCE
    assert likeness(REFERENCE, 20 * PLAIN, REFERENCE) < RESEMBLANCE
    assert likeness(np.full((24, 3), np.nan), PLAIN, REFERENCE) < RESEMBLANCE


def test_patches_are_sampled_where_they_are() -> None:
    shot = synthetic_shot(chart_scene(CORNERS))
    fourth = CORNERS[1] + CORNERS[2] - CORNERS[0]
    jpeg, raw = sample_chart(shot, LocatedChart(np.stack([CORNERS[0], CORNERS[1], fourth, CORNERS[2]])))
    linear = np.clip(REFERENCE / 255, 0.01, 0.97) ** 2.2 / MULTIPLIERS
    np.testing.assert_allclose(raw.mean, linear, rtol=1e-5)
    np.testing.assert_allclose(jpeg.mean, np.rint(render(linear)), atol=1e-9)


def test_patches_outside_the_picture_are_left_out() -> None:
    shot = synthetic_shot(chart_scene(CORNERS))
    corners = np.array([[60.0, 40.0], [600.0, 40.0], [600.0, 280.0], [60.0, 280.0]])
    _, raw = sample_chart(shot, LocatedChart(corners))
    assert np.isnan(raw.mean).any()
    assert np.isfinite(raw.mean).any()


@pytest.mark.slow
def test_without_the_detector(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    note = detector_note()
    assert note is not None
    assert "pip install 'lutforge[chart]'" in note
    assert find_chart(np.zeros((100, 100, 3), dtype=np.uint8)) is None
    result = extract(synthetic_shot(np.full((320, 480, 3), 0.1)))
    assert 0 < result.tiles < 100
    assert result.patches == 0
    assert note in result.summary


def test_real_chart_against_its_own_tiles(shared_data: Path) -> None:
    shot = read_shot(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    corners = np.array([[38.8, 37.9], [585.9, 28.6], [592.2, 397.9], [45.1, 406.8]])
    jpeg, raw = sample_chart(shot, LocatedChart(corners))
    assert not np.any(list(clipping(jpeg, raw).values()))
    assert shot.metadata.multipliers is not None
    greys = (raw.mean * shot.metadata.multipliers)[18:]
    # grey after white balance, and as dark as the published densities (0.05 … 1.5 D), within flare
    assert np.abs(greys[1:5] / greys[1:5].mean(axis=1, keepdims=True) - 1).max() < 0.09
    density = -np.log10(greys[:, 1] / greys[0, 1])
    np.testing.assert_allclose(density, [0, 0.18, 0.39, 0.65, 1.0, 1.45], atol=0.13)


@pytest.mark.slow
@needs_detector
@pytest.mark.parametrize("name", [
    "chart_jpegs/Canon_PowerShot_G6_IMG_0003.JPG", "chart_jpegs/Kodak_DC280_DCP_4394.JPG",
    "chart_jpegs/Olympus_C-5050_PB180005.JPG", "chart_jpegs/Pentax_ist_DL_IMGP6667.JPG",
    "canon_powershot_s40/IMG_0102.JPG",
])  # fmt: skip
def test_charts_of_many_cameras_are_found(name: str, shared_data: Path) -> None:
    jpeg = np.rint(read_image(shared_data / name).pixels * 255).astype(np.uint8)
    upright, turned = find_chart(jpeg), find_chart(np.ascontiguousarray(np.rot90(jpeg)))
    assert upright is not None
    assert turned is not None
    # dark skin is top left in all of these; rot90 takes x, y to y, width − 1 − x
    assert (upright.corners[0] < upright.corners[2]).all()
    back = np.stack([jpeg.shape[1] - 1 - turned.corners[:, 1], turned.corners[:, 0]], axis=1)
    np.testing.assert_allclose(back, upright.corners, atol=0.01 * jpeg.shape[1])


@needs_detector
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("turns", [0, 1, 2])
def test_the_140_patches_are_found_in_their_places(turns: int) -> None:
    kind = chart_kind("sg")
    colours = kind.linear_srgb()
    codes = 255 * srgb_encode(np.clip(colours, 0, 1))
    picture = np.rot90(np.rint(chart_picture(codes, kind, background=0.4)).astype(np.uint8), turns)
    chart = find_chart(np.ascontiguousarray(picture), kind, codes)
    assert chart is not None
    mean = patch_codes(np.ascontiguousarray(picture), chart).mean
    np.testing.assert_allclose(mean, codes, atol=1.0)


@needs_detector
@pytest.mark.filterwarnings("ignore")
def test_a_shot_of_a_named_chart_gives_its_patches() -> None:
    kind = chart_kind("sg")
    codes = 255 * srgb_encode(0.02 + 0.6 * np.clip(kind.linear_srgb(), 0, 1))
    light = srgb_decode(chart_picture(codes, kind, background=0.4) / 255) / MULTIPLIERS
    light *= 1.0 + 0.005 * np.random.default_rng(0).standard_normal(light.shape)
    sampled = extract(synthetic_shot(light), kind)
    expected = srgb_decode(codes / 255) / MULTIPLIERS
    number = np.array([int(name[6:]) - 1 for name in sampled.samples.patch[: sampled.patches]])
    assert sampled.patches == 140
    np.testing.assert_allclose(sampled.samples.raw[: sampled.patches], expected[number], rtol=0.02, atol=0.002)
    plain = extract(synthetic_shot(np.full((320, 480, 3), 0.2)), kind)
    assert plain.patches == 0 and f"no {kind.name} was found in it" in plain.notes


@pytest.mark.filterwarnings("ignore")
def test_charts_have_colours_for_all_their_patches() -> None:
    for name, patches in (("classic", 24), ("classic2014", 24), ("sg", 140), ("spyder24", 24), ("spyder48", 48)):
        kind = chart_kind(name)
        colours = kind.linear_srgb("D50")
        assert colours.shape == (len(kind.centres), 3) == (patches, 3)
        assert colours.max() < 1.2 and kind.source and kind.name
        white = colours[np.argmax(colours.sum(axis=1))]
        assert white.min() > 0.8 * white.max() > 0.6  # every chart has a white patch
    old, new = (chart_kind(name).linear_srgb("D50") for name in ("classic", "classic2014"))
    assert 0.001 < np.abs(old - new).mean() < 0.02  # two makes of one chart, reflectances and published colours


@pytest.mark.filterwarnings("ignore")
def test_a_light_changes_what_reflectances_look_like() -> None:
    kind = chart_kind("classic")
    daylight, bulb = kind.linear_srgb("5500K"), kind.linear_srgb("A")
    assert np.abs(daylight - bulb).max() > 0.02
    np.testing.assert_allclose(bulb[21] / bulb[21].mean(), 1.0, atol=0.05)  # grey stays grey: adapted to the light
    np.testing.assert_allclose(kind.linear_srgb("2856K"), bulb, atol=0.002)  # illuminant A is such a black body
    unusable = {"moonlight": "name a temperature", "900000K": "name a temperature", "26000K": "25000 K"}
    for light, message in unusable.items():
        with pytest.raises(CalibrationError, match=message):
            kind.linear_srgb(light)


def test_an_unknown_chart_is_answered_by_those_that_are_known() -> None:
    with pytest.raises(CalibrationError, match="spyder48"):
        chart_kind("spyder96")


def test_corners_are_four_points() -> None:
    np.testing.assert_array_equal(parse_corners("1,2 30,4.5 25,26 2,25"), [[1, 2], [30, 4.5], [25, 26], [2, 25]])
    with pytest.raises(CalibrationError, match="four points"):
        parse_corners("1,2 3,4")
    for wrong in ("1,1 1,1 1,1 1,1", "0,0 0,9 9,9 9,0", "0,0 9,9 9,0 0,9", "0,0 1,1 2,2 3,3"):
        with pytest.raises(CalibrationError, match="clockwise"):
            parse_corners(wrong)


@needs_detector
@pytest.mark.slow
def test_no_chart_is_found_where_there_is_none(shared_data: Path) -> None:
    for name in ("CRW_0104", "CRW_0112", "CRW_0117"):  # 0104 shows part of a chart
        assert find_chart(read_shot(shared_data / "canon_powershot_s40" / f"{name}.CRW").jpeg) is None
    for blank in (np.zeros((50, 60, 3), dtype=np.uint8), np.full((700, 300, 3), 128, dtype=np.uint8)):
        assert find_chart(blank) is None


def test_likeness_of_measured_charts(shared_data: Path) -> None:
    """10 cameras × 2 lights × 4 exposures, clipped and dark ones too: believed, but in no false order."""
    charts: dict[tuple[str, ...], list[tuple[float, ...]]] = {}
    with (shared_data / "middlebury_charts" / "patch_means.csv").open() as file:
        for row in csv.DictReader(file):
            if row["kind"] != "raw":
                chart = charts.setdefault((row["camera"], row["wb"], row["illum"], row["exposure"]), [])
                chart.append(tuple(float(row[name]) for name in ("patch", "R", "G", "B", "sdR", "sdG", "sdB")))
    believed = []
    for patches in charts.values():
        rows = np.array(sorted(patches))
        grid, deviation = rows[:, 1:4].reshape(4, 6, 3), rows[:, 4:]
        believed.append(likeness(grid.reshape(24, 3), deviation, REFERENCE) >= RESEMBLANCE)
        for false in (grid[::-1, ::-1], grid[:, ::-1], grid[::-1], np.roll(grid, 1, axis=1)):
            assert likeness(false.reshape(24, 3), deviation, REFERENCE) < RESEMBLANCE
    assert len(believed) == 80
    assert all(believed)
