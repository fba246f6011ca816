"""The lens of a camera of the fleet: the distortion put into a photograph, and what registration finds of it."""

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.model.white_balance import WhiteBalance
from lutforge.shots.geometry import Distortion
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from tests.benchmarks.fleet_cameras import FleetCamera
from tests.cases.lenses import displacements

SIZE = (404, 608)
"""Height and width of the photograph, in pixels."""
STRONGEST = 0.08
"""Corners are moved by no more than this share of half the diagonal."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body(SimulatedCamera):
    """A camera of the fleet that takes photographs: its sensor in the simulated body, its rendering in the JPEG."""

    camera: FleetCamera

    def render(self, raw: ArrayLike, style: str, white_balance: str | ArrayLike, ev: float = 0.0) -> Array:
        """RAW (…, 3) → encoded (…, 3), by the camera's own rendering."""
        assert isinstance(white_balance, str)
        exposed = 2.0**ev * np.asarray(raw, dtype=np.float64)
        return self.camera.render(exposed.reshape(-1, 3), style, white_balance).reshape(exposed.shape)


def body_of(camera: FleetCamera) -> Body:
    """The body of a camera of the fleet, with its white balances."""
    balances = {name: WhiteBalance(tuple(factors / factors[1])) for name, factors in camera.balances.items()}
    return Body(
        "Fleet", camera.name, camera.sensitivities, camera.matrix, MappingProxyType(balances), {}, camera=camera
    )


def lens_of(camera: FleetCamera) -> Distortion:
    """The lens of a camera: barrel or pincushion, drawn by its name and seed, its centre off the sensor's."""
    rng = np.random.default_rng([11, camera.seed, len(camera.name)])
    height, width = SIZE
    radius = float(np.hypot(height, width)) / 2
    x, y = np.array([width, height]) / 2 + rng.uniform(-0.02, 0.02, 2) * radius
    return Distortion(float(x), float(y), radius, k1=float(rng.uniform(-STRONGEST, STRONGEST)))


def distortion_error(camera: FleetCamera, folder: Path) -> dict[str, float]:
    """How far registration places points from where the camera's lens does, in RAW pixels."""
    true, body = lens_of(camera), body_of(camera)
    settings = CameraSettings(exposure_s=body.nominal_exposure_s, distortion=true)
    shot = read_shot(photograph(body, SCENES["still-life"](*SIZE, 0), settings, folder, camera.name).dng)
    found = shot.placement.registration.distortion
    none = Distortion(true.x, true.y, true.radius)
    return {
        "distortion, truth: RAW pixels": float(np.abs(displacements(none, true, *SIZE)).max()),
        "distortion: off by, RAW pixels": float(np.abs(displacements(found or none, true, *SIZE)).max()),
    }
