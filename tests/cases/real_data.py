"""Numbers of real cameras, beside the tests (`tests/data/README.md` names their sources), or with the real data."""

import json
import runpy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator, interp1d

from lutforge.arrays import Array
from lutforge.colour.spectra import WAVELENGTHS
from lutforge.model.response import Response

FOLDER = Path(__file__).parents[1] / "data"
S40 = FOLDER / "canon_powershot_s40.npz"
D40 = FOLDER / "nikon_d40_pairs.npz"
CHARTS = FOLDER / "middlebury_charts.npz"


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


def split(count: int, seed: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The rows that are fitted, 70 % of them, and the others."""
    order = np.random.default_rng(seed).permutation(count)
    return order[: int(0.7 * count)], order[int(0.7 * count) :]


def radial_basis_functions(x: Array, y: Array) -> Callable[[Array], Array]:
    """φ(r) = r on the gamut map, with the published matrix and response of the Nikon D40 (thesis 4.2.3)."""
    pairs = read_published_pairs()
    h = RBFInterpolator(x @ pairs.matrix.T, pairs.response.linearize(y), kernel="linear", degree=1)
    return lambda points: pairs.response.encode(h(points @ pairs.matrix.T))


def sensors(data: Path) -> dict[str, Array]:
    """Measured sensitivities (L, 3) over `spectra.WAVELENGTHS` by camera: rawtoaces-data, and Jiang et al. 2013."""
    measured: dict[str, tuple[Array, Array]] = {}
    for path in sorted((data / "spectra" / "rawtoaces-data" / "camera").glob("*.json")):
        measured[path.stem.removesuffix("_380_780_5")] = spectral_data(path)
    lines = (data / "spectra" / "jiang2013_28_cameras.txt").read_text(encoding="utf-8").splitlines()
    for place, line in enumerate(lines):
        if "\t" in line and "\t" not in lines[place - 1]:
            rows = [[float(cell) for cell in text.split()] for text in lines[place : place + 3]]
            measured[lines[place - 1].strip()] = np.arange(400.0, 721.0, 10.0), np.array(rows).T
    return {
        name: interp1d(wavelengths, values, axis=0, bounds_error=False, fill_value=0.0)(WAVELENGTHS)
        for name, (wavelengths, values) in measured.items()
    }


def spectral_data(path: Path) -> tuple[Array, Array]:
    """Wavelengths (m,) and values (m, n) of a JSON file of rawtoaces-data."""
    stored = json.loads(path.read_text(encoding="utf-8"))["spectral_data"]["data"]["main"]
    return np.array([float(key) for key in stored]), np.array(list(stored.values()))


@cache
def middlebury_table() -> SimpleNamespace:
    """What the example defines that prints the table of ten chart cameras."""
    return SimpleNamespace(**runpy.run_path(str(FOLDER.parents[1] / "examples" / "middlebury_table.py")))
