"""Folds of cross-validation hold out whole shots, each once."""

import numpy as np

from lutforge.solvers.cross_validation import leave_groups_out, leave_samples_out, predict_held_out


def test_folds_leave_whole_shots_out_once() -> None:
    groups = np.array(["a"] * 5 + ["b"] * 3 + ["c"] * 9 + ["d"] + ["e"] * 2 + ["f"] * 2)
    masks = leave_groups_out(groups, 4)
    assert len(masks) == 4
    np.testing.assert_array_equal(np.sum(masks, axis=0), 1)
    for mask in masks:
        assert not set(groups[mask]) & set(groups[~mask])
    assert len(leave_groups_out(np.array(["a", "a"]))) == 1


def test_samples_without_groups_are_left_out_once() -> None:
    np.testing.assert_array_equal(np.sum(leave_samples_out(13, 5), axis=0), 1)


def test_a_held_out_prediction_is_of_the_other_samples() -> None:
    values = np.arange(12.0)
    means = predict_held_out(leave_samples_out(12, 3), lambda train, test: np.full(test.sum(), values[train].mean()))
    for fold in range(3):
        np.testing.assert_allclose(means[fold::3], np.delete(values.reshape(4, 3), fold, axis=1).mean())
