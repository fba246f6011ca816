"""Use case: a kit and shots → the difference between what the kit's program develops and the camera's JPEGs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.atomic_write import scratch_folder
from lutforge.child_processes import run_command
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutForgeError, ShotError
from lutforge.images.developed import Development
from lutforge.images.orientation import inverse, orientation_between, upright
from lutforge.images.read import read_image
from lutforge.kits.manifest import SCRIPT, names_in, read_manifest
from lutforge.progress import Progress, silent
from lutforge.samples.extract import extract
from lutforge.samples.tiles import cell_size
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot


@dataclass(frozen=True)
class KitCheck:
    """The difference between a kit's program and the camera's JPEG on one shot: ΔE00 (CIE 2000) of its flat tiles.

    tiles: their number; p95: the 95th percentile; codes: the mean absolute difference of 8-bit values. calibrated: the
    profile was calibrated from this shot, so that the difference is smaller than on others.
    """

    shot: str
    tiles: int
    mean: float
    p95: float
    maximum: float
    codes: float
    calibrated: bool = False


def check_kit(
    folder: str | Path, shots: Sequence[str | Path], progress: Progress = silent
) -> tuple[list[KitCheck], list[str]]:
    """Develop RAW files with a kit's program, and compare them with the camera's JPEGs.

    Returns the differences, and a note for each shot that could not be measured. Raises LutForgeError where the kit has
    no script, ShotError where no shot could be measured.
    """
    script = Path(folder) / SCRIPT
    if not script.is_file():
        raise LutForgeError(f"{folder}: holds no {SCRIPT}: its program cannot be run from the command line")
    files = discover(shots)
    calibrated = set(names_in(read_manifest(Path(folder)), "shots"))
    checks: list[KitCheck] = []
    notes: list[str] = []
    for index, file in enumerate(files):
        progress(file.name, index / len(files))
        try:
            with scratch_folder() as scratch:
                output = scratch / "developed.tif"
                run_command([str(script.resolve()), str(file.resolve()), str(output)], script.name, file, output)
                check = compare_with_jpeg(file, output)
            checks.append(replace(check, calibrated=file.stem in calibrated))
        except LutForgeError as error:
            notes.append(str(error))
    progress("done", 1.0)
    if not checks:
        raise ShotError("no shot could be compared: " + "; ".join(notes))
    return checks, notes


def compare_with_jpeg(raw: Path, picture: Path) -> KitCheck:
    """Compare a picture that a program developed from a RAW file, encoded sRGB, with the camera's JPEG of the shot.

    The tiles are chosen from the RAW and the JPEG only, so that a tile which the program clips counts; a tile that is
    outside its picture does not. Raises ImageError where a file cannot be read, ShotError where pictures do not match.
    """
    pixels = np.asarray(read_image(picture).pixels[..., :3], dtype=np.float32)
    shot = read_shot(raw)
    sampled = extract(shot)
    samples = sampled.samples.select(np.arange(sampled.patches, sampled.kept))
    developed = read_shot(raw, Development(pixels, "srgb", picture.name), source=shot.jpeg_source)
    orientation = orientation_between(shot.jpeg, developed.jpeg)
    if orientation is None:
        raise ShotError(f"{raw}: {picture.name} matches another JPEG than the RAW does")
    if orientation != 1:
        sensor_oriented = upright(pixels, inverse(orientation))
        developed = read_shot(raw, Development(sensor_oriented, "srgb", picture.name), source=shot.jpeg_source)

    cell = cell_size(shot.registration)
    means = developed.raw_cells(cell).mean[tuple(sampled.tile_cells.T)]
    inside = np.isfinite(means).all(axis=1)
    if not inside.any():
        raise ShotError(f"{raw}: no flat tiles to compare")
    by_program = np.clip(means[inside], 0.0, 1.0)
    by_camera = samples.srgb[inside]
    difference = delta_e_2000(by_program, by_camera)
    return KitCheck(
        shot=raw.name,
        tiles=len(difference),
        mean=float(difference.mean()),
        p95=float(np.quantile(difference, 0.95)),
        maximum=float(difference.max()),
        codes=255 * float(np.abs(by_program - by_camera).mean()),
    )
