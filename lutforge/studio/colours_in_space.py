"""Compute where colours are drawn: in the chromaticity diagram, and in a view of XYZ with the edges of sRGB's cube."""

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import D65, SRGB_TO_XYZ


def chromaticities(linear: Array) -> Array:
    """CIE 1931 xy (n, 2) of linear sRGB (n, 3); black lies at the white point."""
    xyz = tristimulus(linear)
    total = xyz.sum(axis=1, keepdims=True)
    dark = total[:, 0] < 1e-6
    xy = xyz[:, :2] / np.where(dark[:, None], 1.0, total)
    xy[dark] = D65[:2] / D65.sum()
    return np.asarray(xy)


def tristimulus(linear: Array) -> Array:
    """CIE XYZ (n, 3) of linear sRGB, Y of white 1."""
    return np.asarray(linear @ SRGB_TO_XYZ.T)


def projected(xyz: Array, azimuth: float, elevation: float) -> Array:
    """An orthographic view (n, 2) of points (n, 3), angles in degrees; Y is up."""
    a, e = np.radians([azimuth, elevation])
    centred = xyz - np.array([0.475, 0.5, 0.545])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    up = np.array([-np.sin(e) * np.sin(a), np.cos(e), -np.sin(e) * np.cos(a)])
    return np.stack([centred @ right, centred @ up], axis=1)


def cube_edges() -> tuple[Array, Array]:
    """The twelve edges of sRGB's cube: linear ends (12, 3) and (12, 3)."""
    corners = np.array([[r, g, b] for r in (0.0, 1.0) for g in (0.0, 1.0) for b in (0.0, 1.0)])
    ends = [(i, j) for i in range(8) for j in range(i) if np.abs(corners[i] - corners[j]).sum() == 1]
    first, second = np.array(ends).T
    return corners[first], corners[second]
