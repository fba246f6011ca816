"""The linearisation error δ over exposure pairs (thesis 4.3.1, equation 4.11), with and without the gamut map."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.exposure_pairs import ExposurePairs, pairs_of_samples
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import PhysicalModel
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearisationError:
    """δ per channel (r, g, b) of one style, in linear units, 1 = full scale; pairs: points counted."""

    style: str
    method: str
    delta: tuple[float, float, float]
    pairs: int

    def as_json(self) -> dict[str, object]:
        """Plain values by name."""
        return asdict(self)


def delta(first: Array, second: Array, ratio: NDArray[np.float64]) -> tuple[float, float, float]:
    """(4.11): root mean square of k' f⁻¹(i) − f⁻¹(i') per channel; first, second linear (n, 3); ratio k' (n,)."""
    r, g, b = (float(value) for value in np.sqrt(np.mean((ratio[:, None] * first - second) ** 2, axis=0)))
    return (r, g, b)


def linearisation_errors(
    style: str, samples: SampleSet, models: Sequence[PhysicalModel]
) -> tuple[LinearisationError, ...]:
    """δ of all exposure pairs of a style without and with h; empty where there are no pairs or no physical model.

    With h the colours compared are h⁻¹(f⁻¹(I)).
    """
    if not models:
        return ()
    try:
        pairs = pairs_of_samples(samples)
    except CalibrationError:
        return ()
    return errors_of_pairs(style, pairs, models[0])


def errors_of_pairs(style: str, pairs: ExposurePairs, model: PhysicalModel) -> tuple[LinearisationError, ...]:
    """δ without h, then with it."""
    ratio = np.exp(pairs.log_ratio)
    first, second = model.response.linearize(pairs.first), model.response.linearize(pairs.second)
    with_map = delta(model.inverse_gamut_map(first), model.inverse_gamut_map(second), ratio)
    return (
        LinearisationError(style, "without h", delta(first, second, ratio), len(pairs)),
        LinearisationError(style, "with h", with_map, len(pairs)),
    )
