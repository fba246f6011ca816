"""Matrices from linear sRGB to the scene-linear spaces."""

import numpy as np
import pytest

from lutforge.colour.rgb_spaces import SPACES, from_linear_srgb


def test_linear_srgb_to_acescg_is_the_published_matrix() -> None:
    # Bradford D65 → ACES white; as in OpenColorIO's ACES CG config ("Utility - Linear - Rec.709" to ACEScg).
    expected = [[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452], [0.020616, 0.109570, 0.869815]]
    np.testing.assert_allclose(from_linear_srgb("acescg"), expected, atol=2e-4)


@pytest.mark.parametrize("space", sorted(SPACES))
def test_white_stays_white(space: str) -> None:
    matrix = from_linear_srgb(space)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=3e-4)
    assert np.linalg.det(matrix) > 0
