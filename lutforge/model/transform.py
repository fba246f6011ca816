"""Transforms R³ → R³ that a calibrated camera offers: evaluation only."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import ImageError
from lutforge.model.gamut_map import GamutMap
from lutforge.model.highlights import neutral_where_clipped
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response

Array = NDArray[np.float64]
Transform = Callable[[ArrayLike], Array]
"""Any function of colours (…, 3) → (…, 3), float64."""


def checked_colours(x: ArrayLike) -> Array:
    """Colours (…, 3) as float64. Raises ImageError on another shape, and on integers, whose scale is unknown: but not
    on lists of 0 and 1.
    """
    try:
        values = np.asarray(x)
    except ValueError as error:
        raise ImageError(f"colours have shape (…, 3), not rows of different lengths ({error})") from error
    plain = not isinstance(x, np.ndarray) and values.dtype.kind in "iu" and bool(np.all((values == 0) | (values == 1)))
    if values.dtype.kind != "f" and not plain and values.ndim > 0:
        raise ImageError(f"pixels of type {values.dtype}: scale them to [0, 1] first, such as pixels / 255.0")
    if values.ndim == 0 or values.shape[-1] != 3:
        raise ImageError(f"colours have shape (…, 3), not {values.shape}; pass pixels[..., :3] of an image with alpha")
    return np.asarray(values, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Shaped:
    """A transform whose first step is a gain per channel and whose last is a matrix: y = matrix · core(gain · x).

    The core is what a lookup table has to hold; its domain is [0, 1]³, to which the camera clips.
    """

    gain: Array
    matrix: Array

    def core(self, x: Array) -> Array:
        raise NotImplementedError  # each transform below has its own

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at x (…, 3); gain · x is clamped to [0, 1], where the camera clips. NaN stays NaN."""
        values = checked_colours(x)
        y = self.core(np.clip(values * self.gain, 0.0, 1.0)) @ self.matrix.T
        unknown = np.isnan(values).any(axis=-1)
        if unknown.any():
            y[unknown] = np.nan
        return y


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
    """I' = render(M · Tc(linearize(I))), equations (6.1) and (6.3). between: M (3, 3), the exposure k and, between two
    cameras without a transfer of their own, their matrices; transfer: Tc, RAW of one camera → RAW of the other.
    neutral_highlights: what clipped in the source stays neutral (`neutral_where_clipped`).
    """

    linearize: Transform
    between: Array
    render: Transform
    transfer: Transform | None = None
    neutral_highlights: bool = False

    def exposed(self, raw: Array) -> Array:
        """What is rendered of the source's RAW (…, 3)."""
        return (raw if self.transfer is None else self.transfer(raw)) @ self.between.T

    def balanced(self, encoded: Array, raw: Array) -> Array:
        """The same under the target's white balance, for the source's `encoded` colours (…, 3) and their RAW."""
        balanced = self.exposed(raw) * self.balance
        return neutral_where_clipped(encoded, balanced) if self.neutral_highlights else balanced

    @property
    def balance(self) -> Array:
        """(3,), the target's multipliers; 1 where the render has none."""
        return np.asarray(getattr(self.render, "gain", np.ones(3)))

    def __call__(self, x: ArrayLike) -> Array:
        """Encoded (…, 3) → encoded (…, 3)."""
        encoded = checked_colours(x)
        return self.render(self.balanced(encoded, self.linearize(encoded)) / self.balance)
