"""Transforms R³ → R³ that a calibrated camera offers: evaluation only."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response

Array = NDArray[np.float64]
Transform = Callable[[ArrayLike], Array]
"""Any function of colours (…, 3) → (…, 3), float64."""


@dataclass(frozen=True, eq=False)
class LatticeTransform:
    """y = matrix · lattice(gain · x), the input of the lattice clamped to its domain as the camera clips it.

    gain: (3,), the white balance in front (1 for none); matrix: (3, 3) behind.
    """

    gain: Array
    lattice: Lattice
    matrix: Array

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at x (…, 3)."""
        return self.lattice(np.asarray(x, dtype=np.float64) * self.gain) @ self.matrix.T


@dataclass(frozen=True, eq=False)
class RenderChain:
    """I = f(h(Ts Tw E)), equation (4.1). to_linear: Ts Tw (3, 3)."""

    to_linear: Array
    gamut_map: GamutMap
    response: Response

    def __call__(self, x: ArrayLike) -> Array:
        """RAW (…, 3) → encoded (…, 3) in [0, 1]."""
        return self.response.encode(self.gamut_map(np.asarray(x, dtype=np.float64) @ self.to_linear.T))


@dataclass(frozen=True, eq=False)
class LinearizeChain:
    """E = (Ts Tw)⁻¹ h⁻¹(f⁻¹(I)), equation (4.1) backward. from_linear: (3, 3), what follows h⁻¹."""

    response: Response
    gamut_map: GamutMap
    from_linear: Array

    def __call__(self, x: ArrayLike) -> Array:
        """Encoded (…, 3) → scene (…, 3), not clipped."""
        return self.gamut_map(self.response.linearize(x)) @ self.from_linear.T


@dataclass(frozen=True, eq=False)
class Refinish:
    """I' = render(M · linearize(I)), equations (6.1) and (6.3). between: M (3, 3), exposure k and, where the two
    cameras differ, Tc."""

    linearize: Transform
    between: Array
    render: Transform

    def __call__(self, x: ArrayLike) -> Array:
        """Encoded (…, 3) → encoded (…, 3)."""
        return self.render(self.linearize(x) @ self.between.T)
