"""The mask of colours that are clipped, or far from every sample."""

import numpy as np

from lutforge.model.coverage import FARTHEST, confidence, uncovered
from lutforge.model.gamut_map import GamutMap
from lutforge.model.profile import CameraModel, PictureStyle
from tests.cases.profiles import gamma_response, identity_map, small_profile


def test_distance_to_the_nearest_centre_in_encoded_values() -> None:
    known = np.array([[0.2, 0.3, 0.4], [0.8, 0.7, 0.6]])
    back = GamutMap(known**2.2, np.zeros((2, 3)), identity_map().polynomial)
    model = CameraModel(("daylight",), np.eye(3), gamma_response(), identity_map(), back)
    x = np.array([[[0.2, 0.3, 0.45], [0.5, 0.5, 0.5]], [[0.8, 0.7, 0.6], [0.2, 0.3, 0.61]]])
    style = PictureStyle(models=(model,))
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


def test_confidence_is_the_mask_as_a_lattice() -> None:
    rng = np.random.default_rng(3)
    known = rng.uniform(0.1, 0.9, (60, 3))
    back = GamutMap(known**2.2, np.zeros((60, 3)), identity_map().polynomial)
    style = PictureStyle(models=(CameraModel(("daylight",), np.eye(3), gamma_response(), identity_map(), back),))
    trust = confidence(style)
    near = np.clip(known + rng.normal(size=(60, 3)) * 0.2 * FARTHEST / np.sqrt(3), 0.02, 0.98)
    assert trust(near)[:, 0].min() > 0.7
    x = rng.uniform(0.02, 0.98, (4000, 3))
    distance = np.linalg.norm(x[:, None] - known, axis=-1).min(axis=1)
    assert np.all(trust(x)[distance > 2.2 * FARTHEST][:, [0, 2]] == 0)
    # The cells of the lattice are a third of the limit wide.
    agree = (trust(x)[:, 0] < 0.5) == uncovered(style, x)
    assert agree[np.abs(distance - FARTHEST) > 0.3 * FARTHEST].all()
    edge = np.repeat(known[:1], 2, axis=0)
    edge[0, 1], edge[1, 2] = 0.0, 1.0
    np.testing.assert_array_equal(trust(edge)[:, :2], 0)
    np.testing.assert_allclose(trust(x)[:, 1], 1)
    assert np.all(confidence(PictureStyle())(x)[:, [0, 2]] == 0)
