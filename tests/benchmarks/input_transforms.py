"""Input transforms of cameras without RAW from exposures of a chart, beside those of the published calculator's method.

    python -m tests.benchmarks.input_transforms [--fewer]

Simulated cameras photograph a ColorChecker at nine exposures, JPEG of quality 95, shutters off by 2 % (standard
deviation). Both methods get these pictures. Error: ΔE00 of the scene-linear colours that they make of the chart at
eight other exposures, and of 99 surfaces that neither has seen, after one gain for all.
"""

import argparse
import tempfile
from pathlib import Path

from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.benchmarks.common import heading, row
from tests.cases.input_transforms import LIGHTS, errors


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fewer", action="store_true", help="one white balance of each camera")
    settings = [("daylight", "daylight"), ("tungsten", "tungsten"), ("daylight", "cloudy")]
    heading("camera, light, dial", "chart", "the peer", "other surfaces", "the peer")
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        for light, white_balance in settings[:1] if parser.parse_args().fewer else settings:
            with tempfile.TemporaryDirectory() as folder:
                ours, peer = errors(camera, light, white_balance, Path(folder)).values()
            cells = (ours[0], peer[0], ours[1], peer[1])
            row(f"{camera.name}, {LIGHTS[light]}, {white_balance}", *cells, places=2)


if __name__ == "__main__":
    main()
