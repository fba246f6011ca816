"""What the studio's tests open: a chart of the simulated camera in bracketed exposures, and a photograph of it."""

from pathlib import Path

import numpy as np
from PIL import Image

from lutforge.colour.spectra import surface_reflectances
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.scenes import still_life

STYLES = ("standard", "vivid")
WHITE_BALANCES = ("daylight", "tungsten", "cloudy")
STOPS = (-2.5, -1.5, -0.5)


def chart_samples(patches: int = 60, noise: float = 0.002, names: tuple[str, str] = ("Simulated", "shot")) -> SampleSet:
    """Patches × exposures × white balances × styles: real surfaces and greys under daylight, with sensor noise."""
    camera, rng = nikon_d5100(), np.random.default_rng(3)
    surfaces = surface_reflectances()
    greys = np.repeat(np.linspace(0.03, 0.95, patches // 3)[:, None], surfaces.shape[1], axis=1)
    chosen = surfaces[rng.choice(len(surfaces), patches - len(greys), replace=len(surfaces) < patches)]
    reflectances = np.vstack([greys, chosen])
    parts = []
    for style in STYLES:
        for balance in WHITE_BALANCES:
            gain = camera.multipliers(balance)
            for stops in STOPS:
                time = camera.nominal_exposure_s * 2.0**stops
                raw = camera.expose(reflectances, "daylight", time)
                raw = np.clip(raw * (1 + noise * rng.standard_normal(raw.shape)), 0.0, 1.0)
                jpeg = np.round(camera.render(raw, style, balance) * 255) / 255
                parts.append(
                    SampleSet.from_arrays(
                        raw, jpeg, camera=names[0], style=style, white_balance=balance,
                        shot=f"{names[1]} {style} {balance} {stops:+g}", patch=np.arange(len(raw)).astype(np.str_),
                        exposure_s=time, wb=gain,
                    )
                )  # fmt: skip
    return concatenate(parts)


def photograph(path: Path, height: int = 1155, width: int = 1732) -> None:
    """A still life as the camera makes it: standard, on tungsten in daylight, a stop short; 2 Mpixel."""
    camera = nikon_d5100()
    scene = still_life(height // 3, width // 3, 7)
    raw = scene.irradiance(camera, "daylight", 0.5 * camera.nominal_exposure_s)
    picture = np.rint(camera.render(raw, "standard", "tungsten") * 255).astype(np.uint8)
    Image.fromarray(picture).resize((width, height), Image.Resampling.BICUBIC).save(path, quality=95)
