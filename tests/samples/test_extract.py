"""Extraction: samples of known shots tell the truth, and of real ones a consistent story."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_encode
from lutforge.samples.extract import extract
from lutforge.shots.read import read_shot
from tests.cases.shots import MULTIPLIERS, render, synthetic_shot


def squares(side: int, count: int, seed: int) -> Array:
    """(320, 480, 3) plain squares of colours that neither clip nor vanish."""
    rng = np.random.default_rng(seed)
    colours = rng.uniform(0.02, 0.9, (320 // side, 480 // side, 3)) / MULTIPLIERS
    return np.kron(colours, np.ones((side, side, 1)))[:320, :480]


def test_samples_are_the_truth() -> None:
    rng = np.random.default_rng(4)
    clean = squares(40, 96, 1)
    noisy = clean + 0.004 * np.sqrt(clean) * rng.standard_normal(clean.shape)
    result = extract(synthetic_shot(noisy))
    samples = result.samples
    assert result.tiles == len(samples) > 80
    np.testing.assert_allclose(samples.srgb * 255, render(samples.raw), atol=0.6)
    # every square is plain: each has given a tile, the cells across two squares have not
    positions = np.array([[int(part) for part in name.split("_")[1:]] for name in samples.patch])
    assert len({tuple(p) for p in (positions // 40).tolist()}) == 96
    border = (positions == 0) | (positions == [472, 312])
    assert (border | ((positions % 40 >= 8) & (positions % 40 <= 24))).all()
    for name, value in (("camera", "Test Camera"), ("style", "standard"), ("white_balance", "daylight")):
        assert set(getattr(samples, name)) == {value}
    np.testing.assert_array_equal(samples.wb, np.tile(MULTIPLIERS, (len(samples), 1)))
    places = 2 * (positions + 4) + 0.5 - np.array([480, 320])  # cells of 8 JPEG pixels, each of two RAW pixels
    np.testing.assert_allclose(samples.position, places / np.hypot(480, 320))
    assert np.isnan(samples.focal_mm).all()


def test_sky_does_not_dominate() -> None:
    scene = squares(40, 96, 3)
    scene[:200] = 0.3
    result = extract(synthetic_shot(scene))
    # the sky fills 500 cells of one colour
    sky = np.abs(result.samples.raw - 0.3).max(axis=1) < 1e-6
    assert 1 <= np.count_nonzero(sky) <= 12 <= len(result.samples) <= 3000
    assert result.rejected["colour already covered"] > 400


@pytest.mark.parametrize(
    ("value", "reason", "advice"),
    [(0.999, "JPEG white", "expose less"), (0.0, "JPEG black", "expose more"), (None, "not flat", "plain surfaces")],
)
def test_a_shot_that_gives_nothing_says_why(value: float | None, reason: str, advice: str) -> None:
    rng = np.random.default_rng(5)
    texture = rng.uniform(0.05, 0.4, (80, 120, 3)).repeat(4, axis=0).repeat(4, axis=1)
    scene = texture if value is None else np.full((320, 480, 3), value)
    result = extract(synthetic_shot(scene))
    assert result.kept == len(result.samples) == 0
    assert {**result.clipped, **result.rejected}[reason] > 2000
    assert f"gives no samples, {advice}"[:16] in result.summary
    assert advice in result.summary
    assert "\n" not in result.summary


def test_small_pictures_show_the_raw_as_finely_as_the_jpeg() -> None:
    shot = synthetic_shot(squares(8, 2400, 7))
    cells = extract(shot).cells
    assert cells is not None
    sides = [max(picture.shape) for picture in (cells.raw, cells.picture)]
    assert min(sides) >= 400
    # Each of the squares is there, with the colour that its white-balanced RAW has.
    step = shot.raw.pixels.shape[1] / cells.raw.shape[1]
    rows, columns = (np.arange(4, size, 8) for size in shot.raw.pixels.shape[:2])
    seen = cells.raw[np.ix_((rows / step).astype(int), (columns / step).astype(int))]
    wanted = 255 * srgb_encode(np.clip(shot.raw.pixels[np.ix_(rows, columns)] * MULTIPLIERS, 0.0, 1.0))
    assert np.abs(seen - wanted).max() <= 1.0


def test_every_cell_is_accounted_for() -> None:
    scene = squares(40, 96, 6)
    scene[:40, :200] = 0.99
    scene[280:, :200] = 0
    shot = synthetic_shot(scene)
    # framed so that some cells lie outside the RAW
    shot = replace(shot, registration=replace(shot.registration, offset_x=-60.0))
    result = extract(shot)
    assert result.rejected["outside the RAW"] > 0
    total = result.tiles + sum(result.clipped.values()) + sum(result.rejected.values())
    assert total == 40 * 60


def test_few_flat_tiles_relax_the_limits() -> None:
    # ramps too steep for the first two limits, and two plain corners that show that there is no noise
    ramp = 0.01 * np.exp(0.07 * np.abs(np.arange(480) % 80 - 40.0))
    scene = np.broadcast_to(ramp[None, :, None], (320, 480, 3)).copy() / MULTIPLIERS
    scene[:56, :56] = 0.01 / MULTIPLIERS
    scene[-56:, :56] = 0.12 / MULTIPLIERS
    result = extract(synthetic_shot(scene))
    assert "limits relaxed" in result.summary
    assert result.tiles > 10
    np.testing.assert_allclose(result.samples.srgb * 255, render(result.samples.raw), atol=2)


def test_unknown_multipliers() -> None:
    shot = synthetic_shot(squares(40, 96, 7))
    shot = replace(shot, metadata=replace(shot.metadata, multipliers=None))
    samples = extract(shot).samples
    assert len(samples) > 50
    assert np.isnan(samples.wb).all()


def test_misregistered_squares_are_not_mixed() -> None:
    scene = squares(40, 96, 8)
    shot = synthetic_shot(scene)
    for shift in (3.0, 8.0):
        moved = replace(shot, registration=replace(shot.registration, offset_x=0.5 + shift))
        samples = extract(moved).samples
        assert len(samples) > 50
        np.testing.assert_allclose(samples.srgb * 255, render(samples.raw), atol=0.6)


def test_retouched_jpeg_is_noticed() -> None:
    x = np.broadcast_to(np.linspace(0.04, 0.4, 480)[None, :, None], (320, 480, 3))
    jpeg = np.rint(render(x)).astype(np.uint8)
    result = extract(synthetic_shot(x, np.ascontiguousarray(jpeg[:, ::-1])))
    assert result.rejected["RAW and JPEG disagree"] > 100


@pytest.mark.parametrize("name", ["CRW_0101", "CRW_0104", "CRW_0112", "CRW_0117", "CRW_0118"])
def test_real_shots(name: str, shared_data: Path) -> None:
    result = extract(read_shot(shared_data / "canon_powershot_s40" / f"{name}.CRW"))
    samples = result.samples
    assert result.kept > 100
    assert result.summary.startswith(f"{name}: kept {result.kept} tiles; clipped")
    assert ((samples.raw > 0) & (samples.raw < 0.98)).all()
    whole = (samples.srgb > 1 / 255) & (samples.srgb < 254 / 255)
    assert (whole | (samples.srgb == 0) | (samples.srgb == 1)).all()  # a channel that clips does so in all of its tile
    samples = samples.select(np.asarray(whole.all(axis=1)))
    assert len(samples) > 0.8 * result.kept
    # Rendering is smooth: a quadratic of balanced RAW (a square root, so near to encoded) explains the JPEG.
    x = np.sqrt(samples.raw * samples.wb)
    design = np.column_stack([np.ones(len(x)), x, x**2, x**3, x[:, [0]] * x[:, [1]], x[:, [1]] * x[:, [2]]])
    residual = samples.srgb - design @ np.linalg.lstsq(design, samples.srgb, rcond=None)[0]
    assert 255 * np.median(np.abs(residual)) < 3


def test_a_high_iso_hides_no_flat_squares() -> None:
    rng = np.random.default_rng(11)
    clean = squares(80, 24, 9)
    noisy = clean + np.sqrt(clean / 400 + 1e-4) * rng.standard_normal(clean.shape)  # 400 electrons at saturation
    samples = extract(synthetic_shot(noisy, np.rint(render(np.clip(noisy, 0, 1))).astype(np.uint8))).samples
    assert len(samples) > 100
    # Noise bends the mean through the tone curve; what is left is far below its own size, 20 codes and more.
    assert np.abs(samples.srgb * 255 - render(samples.raw)).mean() < 4
