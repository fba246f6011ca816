"""Small profiles: one with all that a profile may hold, and one that is linear."""

from dataclasses import replace

import numpy as np

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.profile import DIRECTIONS, CameraModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.4, 1.4]])
GAMMA = 2.2


def gamma_response() -> Response:
    """f⁻¹(I) = I^2.2."""
    return Response(np.stack([np.linspace(0.0, 1.0, 512) ** GAMMA] * 3, axis=1))


def identity_map() -> GamutMap:
    """h(p) = p."""
    return GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.vstack([np.zeros((1, 3)), np.eye(3)]))


def small_profile(camera: str = "Test One") -> CameraProfile:
    """Two styles: "standard" with lattices and a camera model, "vivid" with lattices only."""
    levels = uniform_levels(5)
    render = Lattice(levels, np.clip(grid(levels) @ MATRIX.T, 0.0, 1.0) ** (1 / GAMMA))
    linearize = Lattice(levels, (grid(levels) ** GAMMA) @ np.linalg.inv(MATRIX).T, "tetrahedral")
    rng = np.random.default_rng(5)
    wavy = GamutMap(rng.uniform(size=(7, 3)), rng.normal(size=(7, 3)) / 50, identity_map().polynomial)
    even = replace(identity_map(), offset=0.01, correction_offset=0.01)
    physical = CameraModel(("daylight", "tungsten"), MATRIX, gamma_response(), even, wavy)
    coverage = {direction: rng.uniform(size=(5, 5, 5)) for direction in DIRECTIONS}
    balances = {
        "daylight": WhiteBalance((2.0, 1.0, 1.5), 5200.0),
        "tungsten": WhiteBalance((1.3, 1.0, 2.6), 3200.0),
        "auto": WhiteBalance((1.9, 1.0, 1.6), None, 0.1),
    }
    standard = PictureStyle(render, linearize, (physical,), {"render_mean": 0.01}, coverage)
    styles, options = {"standard": standard, "vivid": PictureStyle(render, linearize)}, {"model": "lattice", "size": 5}
    notes = ("a note with ü and 中",)
    return CameraProfile(camera, MATRIX, balances, styles, shots=("a", "b"), options=options, notes=notes)


def plain_profile(camera: str, style: str = "standard", balances: tuple[str, ...] = ("daylight",)) -> CameraProfile:
    """A rendering that is linear, so that its lattices are small, exact, and each other's inverse."""
    cube = uniform_levels(2)
    tint = 0.01 * len(camera)
    forward, backward = Lattice(cube, grid(cube) * 0.9 + tint / 10), Lattice(cube, (grid(cube) - tint / 10) / 0.9)
    known = {name: WhiteBalance((2.0 - 0.1 * k, 1.0, 1.5 + 0.1 * k)) for k, name in enumerate(balances)}
    return CameraProfile(camera, MATRIX, known, {style: PictureStyle(forward, backward)})
