"""The thesis's lattices: the uniform baseline without smoothness."""

import numpy as np
import pytest

from lutforge.calibration.lattice.node_levels import BINS
from lutforge.thesis.lattice import error_histogram


def test_errors_at_the_ends_are_not_lost() -> None:
    """Errors that are even over the range stay so, up to 0 and 1."""
    axis = (np.arange(BINS) + 0.5) / BINS
    for histogram in error_histogram(np.repeat(axis[:, None], 3, axis=1), np.ones(BINS)):
        assert histogram == pytest.approx(1.0 / BINS)
