"""Transforms R³ → R³ that a calibrated camera offers: evaluation only."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response

Array = NDArray[np.float64]
Transform = Callable[[ArrayLike], Array]
"""Any function of colours (…, 3) → (…, 3), float64."""


class ShapedTransform(Protocol):
    """A transform whose first step is a gain per channel and whose last is a matrix: y = matrix · core(gain · x).

    The core is what a lookup table has to hold; its domain is [0, 1]³, to which the camera clips.
    """

    @property
    def gain(self) -> Array:
        """(3,), the white balance in front; 1 for none."""

    @property
    def matrix(self) -> Array:
        """(3, 3) behind."""

    def core(self, x: Array) -> Array:
        """The function between the two, (…, 3) in [0, 1] → (…, 3)."""

    def __call__(self, x: ArrayLike) -> Array:
        """The whole transform, (…, 3) → (…, 3)."""


@dataclass(frozen=True, eq=False)
class _Shaped:
    gain: Array
    matrix: Array

    def core(self, x: Array) -> Array:
        raise NotImplementedError  # each transform below has its own

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at x (…, 3); gain · x is clamped to [0, 1], where the camera clips."""
        return self.core(np.clip(np.asarray(x, dtype=np.float64) * self.gain, 0.0, 1.0)) @ self.matrix.T


@dataclass(frozen=True, eq=False)
class LatticeTransform(_Shaped):
    """y = matrix · lattice(gain · x): render with the white balance as the gain, linearize with its inverse behind."""

    lattice: Lattice

    def core(self, x: Array) -> Array:
        """The lattice."""
        return self.lattice(x)


@dataclass(frozen=True, eq=False)
class RenderChain(_Shaped):
    """I = f(h(Ts Tw E)), equation (4.1), Tw as the gain. to_linear: Ts (3, 3)."""

    to_linear: Array
    gamut_map: GamutMap
    response: Response

    def core(self, x: Array) -> Array:
        """White-balanced RAW → encoded, in [0, 1]."""
        return self.response.encode(self.gamut_map(x @ self.to_linear.T))


@dataclass(frozen=True, eq=False)
class LinearizeChain(_Shaped):
    """E = Tw⁻¹ Ts⁻¹ h⁻¹(f⁻¹(I)), equation (4.1) backward; the linear steps, or another scene space, are the matrix."""

    response: Response
    gamut_map: GamutMap

    def core(self, x: Array) -> Array:
        """Encoded → linear, before Ts⁻¹; not clipped."""
        return self.gamut_map(self.response.linearize(x))


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
