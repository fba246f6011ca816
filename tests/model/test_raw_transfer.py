"""RAW to RAW between cameras: evaluation, other lights, steps, files."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.errors import ImageError, ProfileError
from lutforge.model.raw_transfer import RawTransfer, chained, load_transfer

MATRIX = np.array([[1.1, -0.1, 0.05], [0.1, 0.9, 0.0], [0.0, 0.2, 0.7]])
NEUTRAL = np.array([0.5, 1.0, 0.7])


def test_under_another_light_white_stays_white() -> None:
    transfer = RawTransfer("A", "B", MATRIX, NEUTRAL)
    multipliers_a, multipliers_b = np.array([1.3, 1.0, 2.5]), np.array([1.5, 1.0, 2.2])
    under = transfer.under(multipliers_a, multipliers_b)
    white = under(1 / multipliers_a) * multipliers_b
    np.testing.assert_allclose(white, white[1], rtol=1e-12)
    # Under the light of the fit it is the fit.
    same = transfer.under(1 / NEUTRAL, transfer(NEUTRAL)[1] / transfer(NEUTRAL))
    x = np.random.default_rng(2).uniform(0, 1, (50, 3))
    np.testing.assert_allclose(same(x), transfer(x), rtol=1e-12)


def test_steps_go_through_a_reference_camera_in_order() -> None:
    other = np.array([[0.9, 0.2, 0.0], [0.0, 1.0, 0.1], [0.1, 0.0, 1.2]])
    through = chained([RawTransfer("A", "R", MATRIX, NEUTRAL), RawTransfer("R", "B", other, NEUTRAL)])
    assert (through.source, through.target) == ("A", "B")
    np.testing.assert_allclose(through.matrix, other @ MATRIX)
    with pytest.raises(ProfileError, match="cannot be followed"):
        chained([RawTransfer("R", "B", other, NEUTRAL), RawTransfer("A", "R", MATRIX, NEUTRAL)])


ROOTS = np.vstack([MATRIX.T, [[0.1, 0.0, -0.1], [0.0, 0.2, 0.0], [0.05, 0.0, 0.0]]])


def test_a_root_polynomial_without_roots_is_the_matrix_and_keeps_the_scale() -> None:
    x = np.random.default_rng(4).uniform(0, 1, (50, 3))
    plain = np.vstack([NEUTRAL[:, None] * MATRIX.T, np.zeros((3, 3))])
    np.testing.assert_allclose(RawTransfer("A", "B", MATRIX, NEUTRAL, roots=plain)(x), x @ MATRIX.T, atol=1e-12)
    bent = RawTransfer("A", "B", MATRIX, NEUTRAL, roots=ROOTS)
    np.testing.assert_allclose(bent(7 * x), 7 * bent(x), rtol=1e-12)
    assert np.all(np.isfinite(bent(x - 0.5)))  # noise around black
    with pytest.raises(ProfileError, match="6 × 3"):
        RawTransfer("A", "B", MATRIX, NEUTRAL, roots=ROOTS[:5])


def test_pixels_that_are_no_colours_are_refused() -> None:
    with pytest.raises(ImageError, match="scale them"):
        RawTransfer("A", "B", MATRIX, NEUTRAL)(np.zeros((4, 3), np.uint8))
    with pytest.raises(ImageError, match="alpha"):
        RawTransfer("A", "B", MATRIX, NEUTRAL)(np.zeros((4, 4)))


@pytest.mark.parametrize("roots", [None, ROOTS], ids=["matrix", "root polynomial"])
def test_a_file_reads_back(tmp_path: Path, roots: Array | None) -> None:
    transfer = RawTransfer("Camera ü", "B", MATRIX, NEUTRAL, roots, 0.012)
    transfer.save(tmp_path / "t.json")
    read = load_transfer(tmp_path / "t.json")
    x = np.random.default_rng(3).uniform(0, 1, (50, 3))
    np.testing.assert_array_equal(read(x), transfer(x))
    assert (read.source, read.target, read.error) == ("Camera ü", "B", 0.012)


@pytest.mark.parametrize(
    "text",
    [
        "", "{}", "[]", "nonsense", '{"format": "lutforge-raw-transfer", "version": 99}',
        '{"format": "lutforge-raw-transfer", "version": 2, "source": "a", "target": "b", "matrix": [[1, 0], [0, 1]], '
        '"neutral": [1, 1, 1], "roots": null, "error": null}',
        '{"format": "lutforge-raw-transfer", "version": 2, "source": "a", "target": "b", "neutral": [1, 1, 1], '
        '"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "wedges": {"hues": [0, 0, 0], "images": []}, "roots": null, '
        '"error": null}',
    ],
)  # fmt: skip
def test_anything_else_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(text)
    with pytest.raises(ProfileError) as caught:
        load_transfer(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
