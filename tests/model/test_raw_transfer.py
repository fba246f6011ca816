"""RAW to RAW between cameras: evaluation, other lights, files."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.errors import ImageError, ProfileError
from lutforge.model.raw_transfer import RawTransfer, load_transfer

SENSORS = np.array([[1.1, -0.1, 0.05], [0.1, 0.9, 0.0], [0.0, 0.2, 0.7]])
NEUTRAL = np.array([0.5, 1.0, 0.7])
ROOTS = np.array([[0.1, -0.05, 0.02], [-0.02, 0.06, 0.0], [0.03, 0.04, -0.05]])


@pytest.mark.parametrize("roots", [np.zeros((3, 3)), ROOTS], ids=["matrix", "root polynomial"])
def test_under_another_light_white_stays_white(roots: Array) -> None:
    transfer = RawTransfer("A", "B", SENSORS, NEUTRAL, roots=roots)
    multipliers_a, multipliers_b = np.array([1.3, 1.0, 2.5]), np.array([1.5, 1.0, 2.2])
    under = transfer.under(multipliers_a, multipliers_b)
    white = under(1 / multipliers_a) * multipliers_b
    np.testing.assert_allclose(white, white[1], rtol=1e-12)
    # Under the light of the fit it is the fit.
    same = transfer.under(1 / NEUTRAL, transfer(NEUTRAL)[1] / transfer(NEUTRAL))
    x = np.random.default_rng(2).uniform(0, 1, (50, 3))
    np.testing.assert_allclose(same(x), transfer(x), rtol=1e-12)


def test_a_root_polynomial_keeps_the_scale() -> None:
    transfer = RawTransfer("A", "B", SENSORS, NEUTRAL, roots=ROOTS)
    x = np.random.default_rng(4).uniform(-0.01, 1, (50, 3))
    np.testing.assert_allclose(transfer(0.1 * x), 0.1 * transfer(x), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(transfer.at_white @ NEUTRAL, transfer(NEUTRAL), rtol=1e-12)
    step = 1e-6 * np.eye(3)
    slope = (transfer(NEUTRAL + step) - transfer(NEUTRAL - step)).T / 2e-6
    np.testing.assert_allclose(transfer.at_white, slope, rtol=1e-6, atol=1e-9)


def test_pixels_that_are_no_colours_are_refused() -> None:
    with pytest.raises(ImageError, match="scale them"):
        RawTransfer("A", "B", SENSORS, NEUTRAL)(np.zeros((4, 3), np.uint8))
    with pytest.raises(ImageError, match="alpha"):
        RawTransfer("A", "B", SENSORS, NEUTRAL)(np.zeros((4, 4)))


def test_a_file_reads_back(tmp_path: Path) -> None:
    transfer = RawTransfer("Camera ü", "B", SENSORS, NEUTRAL, 0.012, ROOTS)
    transfer.save(tmp_path / "t.json")
    read = load_transfer(tmp_path / "t.json")
    x = np.random.default_rng(3).uniform(0, 1, (50, 3))
    np.testing.assert_array_equal(read(x), transfer(x))
    assert (read.source, read.target, read.error) == ("Camera ü", "B", 0.012)


@pytest.mark.parametrize(
    "text",
    [
        "", "{}", "[]", "nonsense", '{"format": "lutforge-raw-transfer", "version": 99}',
        '{"format": "lutforge-raw-transfer", "version": 4, "source": "a", "target": "b", "matrix": [[1, 0], [0, 1]], '
        '"neutral": [1, 1, 1], "roots": [[0, 0, 0], [0, 0, 0], [0, 0, 0]], "error": null}',
        '{"format": "lutforge-raw-transfer", "version": 4, "source": "a", "target": "b", "neutral": [1, 1, 1], '
        '"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "roots": [[1, 0], [0, 1]], "error": null}',
        '{"format": "lutforge-raw-transfer", "version": 2, "source": "a", "target": "b", "neutral": [1, 1, 1], '
        '"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "roots": null, "error": null}',
    ],
)  # fmt: skip
def test_anything_else_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(text)
    with pytest.raises(ProfileError) as caught:
        load_transfer(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
