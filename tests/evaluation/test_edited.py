"""Errors after an edit: of the truth none, of known errors what they are."""

from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.evaluation.linearization import EDITS, INVERTED, edited_errors
from lutforge.evaluation.methods import LATTICE, Predictions

MIX = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])


def render(method: str, balanced: Array, rows: NDArray[np.intp]) -> Array:
    return srgb_encode(np.clip(balanced @ MIX.T, 0.0, 1.0))


def test_errors_after_edits() -> None:
    balanced = np.random.default_rng(0).uniform(0.1, 0.2, (300, 3))
    rows, error = np.arange(300), 1.1
    encoded = render(LATTICE, balanced, rows)
    predictions = SimpleNamespace(
        methods=(LATTICE, "too bright"),
        data=SimpleNamespace(balanced=balanced, encoded=encoded),
        held_out=np.ones(300, np.bool_),
        predicted=SimpleNamespace(
            render={LATTICE: encoded}, linearize={LATTICE: balanced, "too bright": balanced * error}
        ),
        render=render,
    )
    found = {row.method: row for row in edited_errors("standard", cast(Predictions, predictions))}
    assert set(found) == {LATTICE, "too bright", INVERTED}
    assert max(found[LATTICE].values.values()) < 1e-9
    assert max(found[INVERTED].values.values()) < 1e-3  # the inverse of a render that loses nothing is the truth
    for name, de00 in found["too bright"].values.items():
        edited = [render(LATTICE, np.clip(light * EDITS[name], 0, 1), rows) for light in (balanced, balanced * error)]
        assert abs(de00 - delta_e_2000(*edited).mean()) < 1e-9
