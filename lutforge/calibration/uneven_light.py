"""Uneven light over a chart: the smooth field by which the light on its patches differs from that on its middle.

Where the known colours ρ of a chart take the place of RAW, f⁻¹(I) = 2^g(x, y) M ρ: f is known from the exposures, M
(3, 3) is the camera's matrix, and g a plane or a quadratic polynomial of the place on the chart. M and g are fitted in
turns, robustly, since a gamut map moves saturated colours. A field is kept if patches that it was not fitted to are
predicted better by it (leave-one-out cross-validation, Stone 1974,
https://doi.org/10.1111/j.2517-6161.1974.tb00994.x). A shadow's edge is no such field, and is only reported.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.solvers.robust_weights import RobustWeights, cauchy

LEAST_PATCHES = 16
"""Fewer patches do not determine a field and a matrix."""
LEAST_FALL = 0.06
"""Share by which light falls over a chart where that is corrected; it moves a middle grey by four codes."""
PLANE, QUADRATIC = 2, 5
"""Numbers of coefficients."""
ABRUPT = 0.15
"""Error of patches left out, in stops, beyond which light changes as no smooth field does."""
PREDICTED_BETTER = 0.75
"""Share of the error of patches left out, without a field, that is left with one, at most."""
FIELD_SPREAD = 1.0
"""Standard deviation of the coefficients of a field, in stops."""
PATCH_NOISE = 0.05
"""Deviation of patches from a matrix, in stops, with which that prior is compared."""
FIELD_WEIGHTS = RobustWeights(cauchy, multiple=2.5, least=0.03)
FIELD_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class UnevenLight:
    """A field of light over a chart. coefficients: (5,) of x, y, x², x y, y² in stops; places: −1 … 1 on each axis.

    abrupt: it changes as no smooth field does, so that the coefficients are 0.
    """

    coefficients: Array
    abrupt: bool = False

    def gain(self, places: Array) -> Array:
        """The light at places (n, 2) on the chart, (n,), as a share of that in its middle."""
        return np.asarray(2.0 ** (field_terms(places) @ self.coefficients))

    @property
    def fall(self) -> float:
        """The share by which the darkest place of the chart has less light than the brightest."""
        return parts_of_field(self.coefficients)[0]

    @property
    def note(self) -> str:
        """The field in one sentence."""
        if self.abrupt:
            return (
                "the light on the chart changes abruptly, as at the edge of a shadow, and the colours are off by that: "
                "photograph it again in even light"
            )
        fall, bright, dark = parts_of_field(self.coefficients)
        return (
            f"light falls by {fall:.0%} from {bright} to {dark} over the chart, as it is upright: corrected as a "
            "smooth field; even light is surer"
        )


_NINE = np.array([[x, y] for y in (-1.0, 0.0, 1.0) for x in (-1.0, 0.0, 1.0)])
_NAMES = (
    "top left", "top", "top right", "left", "the middle", "right", "bottom left", "bottom", "bottom right",
)  # fmt: skip


def fit_uneven_light(linear: Array, colours: Array, places: Array) -> UnevenLight | None:
    """The field of light on patches; None where it is even, or the patches do not determine it.

    linear: (n, 3) f⁻¹(I) of each patch, on any scale, NaN where unknown; colours: (n, 3) ρ, linear; places: (n, 2) on
    the chart, −1 … 1.
    """
    known = np.all(np.isfinite(linear) & (linear > 0.0), axis=1) & np.all(np.isfinite(colours), axis=1)
    if np.count_nonzero(known) < LEAST_PATCHES:
        return None
    linear, colours, places = linear[known], colours[known], places[known]
    errors = {count: _left_out(linear, colours, places, count) for count in (0, PLANE, QUADRATIC)}
    best = min((PLANE, QUADRATIC), key=lambda count: errors[count])
    if errors[best] > PREDICTED_BETTER * errors[0]:
        return None
    if errors[best] > ABRUPT:
        return UnevenLight(np.zeros(QUADRATIC), abrupt=True)

    fitted, _ = _fit(linear, colours, places, np.ones(len(linear), dtype=np.bool_), best)
    field = UnevenLight(np.pad(fitted, (0, QUADRATIC - best)))
    return field if field.fall > LEAST_FALL else None


def _left_out(linear: Array, colours: Array, places: Array, count: int) -> float:
    """The median absolute error, in stops, of the brightness of each patch by a fit of `count` terms to the others."""
    errors = np.zeros(len(linear))
    for patch in range(len(linear)):
        other_patches = np.arange(len(linear)) != patch
        _, residual = _fit(linear, colours, places, other_patches, count)
        errors[patch] = residual[patch]
    return float(np.median(np.abs(errors)))


def _fit(linear: Array, colours: Array, places: Array, rows: Mask, count: int) -> tuple[Array, Array]:
    """The first coefficients (count,) of a field, and by what all patches are brighter than predicted, (n,) in stops.

    rows: (n,) the patches that it is fitted to.
    """
    terms = field_terms(places)[:, :count]
    coefficients = np.zeros(count)
    weight = rows.astype(np.float64)
    size = linear.sum(axis=1)
    residual = np.zeros(len(linear))
    for _ in range(FIELD_ROUNDS):
        gain = 2.0 ** (terms @ coefficients)
        # Errors are relative, so that dark patches count as bright ones
        scale = np.sqrt(weight) / size
        lit = colours * (gain * scale)[:, None]
        matrix = np.linalg.lstsq(lit, linear * scale[:, None], rcond=None)[0]
        predicted = np.maximum((colours @ matrix).sum(axis=1), 1e-9)
        brighter = np.log2(size / predicted)
        weighted = terms * weight[:, None]
        normal = weighted.T @ terms + (PATCH_NOISE / FIELD_SPREAD) ** 2 * np.eye(count)
        coefficients = np.linalg.solve(normal, weighted.T @ brighter)
        residual = brighter - terms @ coefficients
        weight = rows * FIELD_WEIGHTS(np.abs(residual), np.abs(residual[rows]))
    return coefficients, residual


def parts_of_field(coefficients: Array, half_size: tuple[float, float] = (1.0, 1.0)) -> tuple[float, str, str]:
    """By what share light falls, and from which part to which: of a field (5,) in stops.

    half_size: the largest x and y of its places, which lie around 0.
    """
    coefficients = coefficients * field_terms(np.array([half_size]))[0]
    gains = 2.0 ** (field_terms(_NINE) @ coefficients)
    bright, dark = _NAMES[int(np.argmax(gains))], _NAMES[int(np.argmin(gains))]
    slopes = coefficients[:2]
    axis = int(np.argmax(np.abs(slopes)))
    across = np.abs(np.delete(coefficients, axis)).max()
    if np.abs(slopes[axis]) > 2.5 * across:  # along one axis alone
        low, high = (("left", "right"), ("top", "bottom"))[axis]
        bright, dark = (low, high) if slopes[axis] < 0.0 else (high, low)
    return float(1.0 - gains.min() / gains.max()), bright, dark


def field_terms(places: Array) -> Array:
    """The polynomials (n, 5) of places (n, 2)."""
    x, y = places.T
    return np.stack([x, y, x**2, x * y, y**2], axis=1)
