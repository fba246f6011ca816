"""The shots of the demo: two picture styles, five white balances, varied exposures, and a photograph to correct."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from lutforge.simulate.camera import SimulatedCamera, nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import Photograph, develop_again, photograph
from lutforge.simulate.scene import Scene
from lutforge.simulate.scenes import SCENES


@dataclass(frozen=True)
class DemoShot:
    """One shot to take: the camera's settings, the scene and its seed, the relative exposure, and the illuminant.

    light: None for the illuminant that the white balance is made for. A white balance that is wrong for the illuminant
    gives strong colours, and so covers the corners of the colour space, as the thesis's shots do (4.2.3).
    """

    style: str
    white_balance: str
    scene: str
    seed: int
    exposure: float
    light: str | None = None

    def settings(self, camera: SimulatedCamera) -> CameraSettings:
        """The dials of the camera."""
        return CameraSettings(self.style, self.white_balance, camera.nominal_exposure_s * self.exposure)


SHOTS = (
    DemoShot("standard", "daylight", "chart", 0, 1.0),
    DemoShot("standard", "daylight", "wall", 0, 1.4),
    DemoShot("standard", "daylight", "wall", 1, 0.35),
    DemoShot("standard", "tungsten", "wall", 2, 1.0),
    DemoShot("standard", "tungsten", "wall", 3, 0.6, light="daylight"),
    DemoShot("standard", "tungsten", "still-life", 1, 0.8, light="daylight"),  # with a deep blue ball
    DemoShot("standard", "fluorescent", "wall", 4, 0.8),
    DemoShot("standard", "cloudy", "wall", 3, 1.2),
    DemoShot("vivid", "daylight", "chart", 0, 1.0),
    DemoShot("vivid", "daylight", "wall", 0, 1.4),
    DemoShot("vivid", "daylight", "wall", 1, 0.35),
    DemoShot("vivid", "tungsten", "wall", 2, 1.0),
    DemoShot("vivid", "daylight", "wall", 3, 0.8, light="tungsten"),
    DemoShot("vivid", "shade", "wall", 4, 1.2),
    DemoShot("vivid", "cloudy", "still-life", 0, 1.4),
    DemoShot("standard", "shade", "wall", 5, 0.8),
    DemoShot("vivid", "tungsten", "still-life", 2, 0.8, light="daylight"),
    DemoShot("vivid", "fluorescent", "wall", 5, 1.2, light="daylight"),
    DemoShot("vivid", "daylight", "wall", 6, 1.4, light="fluorescent"),
    DemoShot("vivid", "tungsten", "wall", 6, 1.2, light="daylight"),
)
"""The shots that the demo calibrates from, as the guide advises: each white balance at least twice, white balances that
are wrong for the illuminant, darker and brighter shots. Every second has no JPEG file, only a preview in the DNG."""

HELD_OUT_SHOT = DemoShot("standard", "tungsten", "still-life", 7, 0.6, light="daylight")
"""The shot that the demo grades, and does not calibrate from: with tungsten white balance in daylight, underexposed."""


@dataclass(frozen=True)
class DemoShots:
    """The files of `demo_shots`: RAW files to calibrate from, a photograph with wrong settings, and the right JPEG.

    source, target: the wrong and the right settings as selectors; ev: the exposure change to the right one, in stops.
    """

    camera: SimulatedCamera
    calibration: tuple[Path, ...]
    held_out: Photograph
    right: Path
    source: str
    target: str
    ev: float


def demo_shots(
    folder: str | Path,
    progress: Callable[[str], None] = lambda _: None,
    camera: SimulatedCamera | None = None,
    shape: tuple[int, int] = (808, 1216),
) -> DemoShots:
    """Photograph the demo's scenes into `folder`, and one into its "held-out". shape: of the sensor, even numbers."""
    camera = nikon_d5100() if camera is None else camera
    folder = Path(folder)
    scenes: dict[tuple[str, int], Scene] = {}

    def take(shot: DemoShot, place: Path, name: str, jpeg_beside: bool) -> Photograph:
        progress(name)
        key = (shot.scene, shot.seed)
        if key not in scenes:
            scenes[key] = SCENES[shot.scene](*shape, shot.seed)
        settings = shot.settings(camera)
        return photograph(camera, scenes[key], settings, place, name, jpeg_beside=jpeg_beside, light=shot.light)

    calibration = tuple(
        take(shot, folder, f"LF{number:04d}-{shot.style}-{shot.white_balance}-{shot.scene}", number % 2 == 1).dng
        for number, shot in enumerate(SHOTS, start=1)
    )

    # The photograph with wrong settings, and the JPEG with the right ones.
    held_out = take(HELD_OUT_SHOT, folder / "held-out", "held-out", True)
    style = "vivid"
    white_balance = "daylight"
    ev = 0.7
    settings = replace(HELD_OUT_SHOT.settings(camera), style=style, white_balance=white_balance, push_ev=ev)
    right = develop_again(camera, held_out, settings, folder / "held-out" / "wanted.JPG")
    return DemoShots(
        camera=camera,
        calibration=calibration,
        held_out=held_out,
        right=right,
        source=f"{HELD_OUT_SHOT.style}/{HELD_OUT_SHOT.white_balance}",
        target=f"{style}/{white_balance}",
        ev=ev,
    )
