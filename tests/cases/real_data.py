"""Numbers of real cameras, small enough to keep beside the tests; `tests/data/README.md` names their sources."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.model.response import Response

FOLDER = Path(__file__).parents[1] / "data"
S40 = FOLDER / "canon_powershot_s40.npz"
D40 = FOLDER / "nikon_d40_pairs.npz"
CHARTS = FOLDER / "middlebury_charts.npz"

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PublishedPairs:
    """Colours of a Nikon D40 that the thesis's authors measured, and their model of it without the gamut map.

    balanced: white-balanced linear RAW Tw E (n, 3); encoded: JPEG values I (n, 3) in [0, 1]; matrix: Ts (3, 3);
    multipliers: the white balances by name, green = 1.
    """

    balanced: Array
    encoded: Array
    matrix: Array
    response: Response
    multipliers: dict[str, tuple[float, float, float]]


def read_published_pairs() -> PublishedPairs:
    """Read the pairs of the Nikon D40's daylight, tungsten, flash, cloudy and shade settings."""
    with np.load(D40, allow_pickle=False) as stored:
        balances = zip(stored["white_balances"].tolist(), stored["multipliers"].tolist(), strict=True)
        return PublishedPairs(
            balanced=stored["balanced"].astype(np.float64),
            encoded=stored["encoded"].astype(np.float64),
            matrix=stored["matrix"],
            response=Response(stored["inverse_response"]),
            multipliers={name: (r, g, b) for name, (r, g, b) in balances},
        )
