"""Photographs of the Look step: read, with the steps of their looks baked, in another process; thumbnails graded."""

from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from lutforge.apply.baked_grades import BakedGrades
from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.setting_change import SettingChange
from lutforge.apply.source_settings import choose_camera, source_selector
from lutforge.boundary import reading
from lutforge.errors import ImageError, SettingsError
from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.luts.bake import bake
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.transform import Transform
from lutforge.progress import Progress
from lutforge.settings import Selector
from lutforge.shots.picture_settings import read_picture_settings
from lutforge.studio.session import ChosenLook
from lutforge.studio.shot_pictures import jpeg_of, picture_bytes, thumbnail

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", *HEIF_SUFFIXES)


@dataclass(frozen=True, eq=False)
class Photograph:
    """A picture, as a file that browsers read, and in small. selector: its settings, None where it does not tell.

    style: told by the metadata, "" where they do not; notes: what the visitor should know.
    """

    path: Path
    picture: bytes
    small: bytes
    selector: Selector | None
    style: str
    notes: tuple[str, ...]


def open_photograph(path: Path, profile: CameraProfile, progress: Progress) -> Photograph:
    """Read a picture, and what it was taken as. Raises ImageError."""
    progress("reading", 0.1)
    settings, picture = read_picture_settings(path), picture_bytes(path)
    with reading(path, "a picture", ImageError):
        small = thumbnail(picture)
    notes: tuple[str, ...] = ()
    selector, style = None, settings.style if settings.style in profile.styles else ""
    try:
        choose_camera(path, settings, {profile.camera.lower(): profile}, asked=False)
        selector, notes = source_selector(path, settings, profile, None)
    except SettingsError:
        pass
    return Photograph(path, picture, small, selector, style, (*settings.notes, *notes))


def graded(small: bytes, lut: Lut | None) -> bytes:
    """A thumbnail, a JPEG file, through a LUT."""
    if lut is None:
        return small
    with Image.open(BytesIO(small)) as file:
        pixels = np.asarray(file, dtype=np.float32) / np.float32(255)
    codes = np.rint(255 * np.clip(apply_to_pixels(lut.processor(), pixels), 0.0, 1.0)).astype(np.uint8)
    return jpeg_of(Image.fromarray(codes))


@lru_cache(4)
def grades_of(profile: CameraProfile) -> BakedGrades:
    """The baked steps of a profile, kept between changes of the look."""
    return BakedGrades()


def change_of(profile: CameraProfile, look: ChosenLook) -> SettingChange:
    """What a look changes. Raises SettingsError."""
    return SettingChange(profile, profile.selector(look.source), profile, profile.selector(look.target), look.ev)


def look_lut(profile: CameraProfile, look: ChosenLook) -> Lut | None:
    """The LUT that `apply` grades with; None where the look changes nothing. Raises SettingsError."""
    change = change_of(profile, look)
    if not look.ev and str(change.given) == str(change.wanted):
        return None
    return grades_of(profile).refinish(change)


def bake_all(steps: tuple[Transform, ...], progress: Progress) -> tuple[Lut, ...]:
    """Bake the steps of looks as `apply` does."""
    baked = []
    for number, step in enumerate(steps):
        progress("baking", number / len(steps))
        baked.append(bake(step, display_referred=False))
    return tuple(baked)


@lru_cache(8)
def coverage_lut(profile: CameraProfile, style: str) -> Lut:
    """Encoded colours of a style → (confidence, unclipped, covered), as of `confidence`, without a wanted look."""
    return Lut(lattice_ops(confidence(profile.styles[style])))
