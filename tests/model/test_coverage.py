"""The mask of colours that are clipped, or far from every sample."""

import numpy as np
from profiles_synthetic import gamma_response, identity_map, small_profile

from lutforge.model.camera_profile import PhysicalModel, PictureStyle
from lutforge.model.coverage import clipped, uncovered
from lutforge.model.gamut_map import GamutMap


def test_clipped_is_any_channel_at_an_end() -> None:
    codes = np.array([[0, 10, 20], [1, 254, 128], [3, 255, 3], [128, 128, 128]]) / 255
    np.testing.assert_array_equal(clipped(codes), [True, False, True, False])


def test_distance_to_the_nearest_centre_in_encoded_values() -> None:
    known = np.array([[0.2, 0.3, 0.4], [0.8, 0.7, 0.6]])
    back = GamutMap(known**2.2, np.zeros((2, 3)), identity_map().polynomial)
    model = PhysicalModel(("daylight",), np.eye(3), gamma_response(), identity_map(), back)
    x = np.array([[[0.2, 0.3, 0.45], [0.5, 0.5, 0.5]], [[0.8, 0.7, 0.6], [0.2, 0.3, 0.61]]])
    style = PictureStyle(physical=(model,))
    np.testing.assert_array_equal(uncovered(style, x, 0.1), [[False, True], [False, True]])
    np.testing.assert_array_equal(uncovered(style, x, 0.4), [[False, False], [False, False]])


def test_a_lattice_knows_the_nodes_that_samples_touched() -> None:
    style = small_profile().styles["standard"]
    assert style.linearize is not None
    coverage = np.zeros((5, 5, 5))
    coverage[2, 2, 2] = 1.0
    lattice_only = PictureStyle(style.render, style.linearize, coverage={"linearize": coverage})
    x = np.array([[0.5, 0.5, 0.55], [0.1, 0.1, 0.1]])
    np.testing.assert_array_equal(uncovered(lattice_only, x), [False, True])
    assert uncovered(PictureStyle(), x).all()
