"""The gamut map h of the simulated camera, linear sRGB → linear sRGB, smooth and exactly invertible.

A colour p is split into Y = w·p, its signal on the sensor, and the chroma c = p − Y (1, 1, 1). h does not change Y; it
turns and scales c. Every slice of equal Y is therefore mapped onto itself, along rays up to a turn, and h is one-to-one
where its radial curve increases. Low saturations do not move: h(p) = p, as section 4.2.1 of the thesis assumes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.simulate.tone_response import invert_increasing

LEAST_DIVISOR = 1e-12
"""Signals below this count as black, so that saturation stays finite."""


@dataclass(frozen=True)
class SimulatedGamutMap:
    """The map h: it compresses saturated colours into the cube, and for a vivid style boosts and turns them first.

    signal: w (3,), sum 1. knee: the saturation (1 = face of the RGB cube) from which colours are compressed. boost:
    gain of saturations beyond `onset`. turn: radians by which full saturations turn; bend: a part of the turn that
    depends on the hue. It does not fold where knee and |bend| are below 1.
    """

    signal: tuple[float, float, float]
    knee: float
    onset: float = 0.4
    boost: float = 0.0
    turn: float = 0.0
    bend: float = 0.0

    def __call__(self, linear: ArrayLike) -> Array:
        """h: linear sRGB (…, 3) as the sensor gives it, to linear sRGB that fits the cube."""
        level, chroma = self._split(linear)
        turned = self._turned(level, chroma)
        saturation = self._saturation(level, turned)
        scale = np.where(saturation > 0, self._curve(saturation) / np.maximum(saturation, LEAST_DIVISOR), 1.0)
        return level[..., None] + scale[..., None] * turned

    def inverse(self, mapped: ArrayLike) -> Array:
        """h⁻¹, to about 1e-10 where h reaches; colours out of its reach go to a very saturated one."""
        level, chroma = self._split(mapped)
        saturation = np.minimum(self._saturation(level, chroma), 1 - 1e-9)  # beyond, different colours have one mapped
        wide = invert_increasing(self._curve, saturation, 0.0, 60.0)  # far outside any camera's gamut
        scale = np.where(saturation > LEAST_DIVISOR, wide / np.maximum(saturation, LEAST_DIVISOR), 1.0)
        return level[..., None] + self._turned(level, scale[..., None] * chroma, back=True)

    def _split(self, linear: ArrayLike) -> tuple[Array, Array]:
        """Y (…) and c (…, 3)."""
        p = np.asarray(linear, dtype=np.float64)
        level: Array = np.maximum(p @ np.asarray(self.signal), LEAST_DIVISOR)
        return level, p - level[..., None]

    def _saturation(self, level: Array, chroma: Array) -> Array:
        """How far c reaches to the faces of the RGB cube: 0 neutral, 1 on a face.

        The 6-norm over the faces stands in for the maximum: smooth, and never below it. Linear along each ray. The
        upper faces open by 0.35 Y⁴ near white, so that light, nearly neutral colours need not move. A bright saturated
        colour may pass 1 there and is clipped by the response, as in a real camera.
        """
        room = np.maximum(1 - level + 0.35 * level**4, 0.05)
        down, up = np.maximum(-chroma, 0) / level[..., None], np.maximum(chroma, 0) / room[..., None]
        squares = down * down + up * up  # only one of the two is not 0
        return np.asarray(np.cbrt(np.sqrt((squares * squares * squares).sum(axis=-1))))

    def _curve(self, saturation: Array) -> Array:
        """Boost beyond the onset, then compress beyond the knee towards 1; increasing, C²."""
        over = np.maximum(saturation - self.onset, 0)
        boosted = saturation + self.boost * over**3 / (over**2 + 0.1)
        z = np.maximum(boosted - self.knee, 0) / (1 - self.knee)
        return np.minimum(boosted, self.knee) + (1 - self.knee) * z / (1 + z**1.5) ** (1 / 1.5)

    def _turned(self, level: Array, chroma: Array, back: bool = False) -> Array:
        """Chroma turned in the plane w·c = 0, the more the further it lies from grey; or turned back."""
        if self.turn == 0 and self.bend == 0:
            return chroma
        _, _, rows = np.linalg.svd(np.asarray(self.signal)[None, :])
        plane = np.ascontiguousarray(rows[1:].T)  # an orthonormal basis (3, 2)
        u, v = np.moveaxis(chroma @ plane, -1, 0)
        radius, angle = np.hypot(u, v), np.arctan2(v, u)
        over = np.maximum(radius / (level + 0.1) - self.onset, 0)
        part = over**3 / (over**3 + 1)  # of the turn, at this radius
        if back:
            turned, angle = angle, angle - part * self.turn
            for _ in range(30):  # Newton on angle + part·(turn + bend·sin angle) = turned; slope ≥ 1 − |bend|
                wrong = angle + part * (self.turn + self.bend * np.sin(angle)) - turned
                angle = angle - wrong / (1 + part * self.bend * np.cos(angle))
        else:
            angle = angle + part * (self.turn + self.bend * np.sin(angle))
        return np.asarray(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1) @ plane.T)
