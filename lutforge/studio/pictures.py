"""Pictures as browsers read them, in small, framed, and graded; the looks of photographs, baked as `apply` does."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageOps

from lutforge.apply.baked_grades import BakedGrades
from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.candidates import read_small
from lutforge.apply.setting_change import SettingChange
from lutforge.apply.source_settings import choose_camera, source_selector
from lutforge.arrays import Array, Mask
from lutforge.boundary import reading
from lutforge.errors import ImageError, SettingsError
from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.images.icc import foreign_profile
from lutforge.images.read import ImageReader
from lutforge.luts.bake import bake
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import confidence
from lutforge.model.transform import Transform
from lutforge.progress import Progress
from lutforge.settings import Selector
from lutforge.shots.picture_settings import read_picture_settings

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", *HEIF_SUFFIXES)


def picture_bytes(path: Path) -> bytes:
    """A picture in sRGB as a file that browsers read: itself, or PNG of at most 8 million pixels. Raises ImageError."""
    if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
        with ImageReader(path) as image:
            as_it_is = not foreign_profile(image.spec)
        if as_it_is:
            return path.read_bytes()
    pixels, buffer = read_small(path, 8_000_000), BytesIO()
    Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


def thumbnail(picture: bytes) -> bytes:
    """A picture file as a small JPEG, upright."""
    with Image.open(BytesIO(picture)) as file:
        file.draft("RGB", (480, 320))  # a JPEG is decoded at a fraction of its size
        small = ImageOps.exif_transpose(file.convert("RGB"))
    small.thumbnail((480, 320))
    return jpeg_of(small)


def jpeg_of(image: Image.Image) -> bytes:
    """A picture as a JPEG file."""
    buffer = BytesIO()
    image.save(buffer, format="JPEG", quality=92)
    return buffer.getvalue()


def jpeg_url(file: bytes | NDArray[np.uint8]) -> str:
    """A JPEG file, or a picture (h, w, 3) as one, as a data URL."""
    data = file if isinstance(file, bytes) else jpeg_of(Image.fromarray(np.ascontiguousarray(file)))
    return "data:image/jpeg;base64," + b64encode(data).decode("ascii")


def swatches(encoded: Array) -> NDArray[np.uint8]:
    """The colours of samples (n, 3) as a picture of squares, for a shot whose files are not there."""
    few = encoded[np.linspace(0, len(encoded) - 1, min(len(encoded), 600)).astype(np.intp)]
    columns = max(1, int(np.ceil(np.sqrt(1.5 * len(few)))))
    grid = np.full((-(-len(few) // columns) * columns, 3), 0.46)
    grid[: len(few)] = few
    codes: NDArray[np.uint8] = np.rint(255 * np.clip(grid, 0, 1)).astype(np.uint8)
    return np.kron(codes.reshape(-1, columns, 3), np.ones((8, 8, 1), dtype=np.uint8))


def framed(picture: NDArray[np.uint8], places: Array, outlier: Mask) -> NDArray[np.uint8]:
    """A picture (h, w, 3) with a frame round each sample, orange if an outlier. places: (n, 2), shares of its sides."""
    image = Image.fromarray(np.ascontiguousarray(picture))
    draw, reach = ImageDraw.Draw(image), max(2, image.width // 110)
    for (x, y), out in sorted(
        zip((places * image.size).tolist(), outlier.tolist(), strict=True), key=lambda one: one[1]
    ):
        draw.rectangle((x - reach, y - reach, x + reach, y + reach), outline="#ff8c00" if out else "#ffffff")
    return np.asarray(image)


# --- Looks -----------------------------------------------------------------------------------------------------------


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


def change_of(profile: CameraProfile, source: str, target: str, ev: float) -> SettingChange:
    """What a look changes: STYLE/WB before and after, exposure in stops. Raises SettingsError."""
    return SettingChange(profile, profile.selector(source), profile, profile.selector(target), ev)


def look_lut(profile: CameraProfile, source: str, target: str, ev: float) -> Lut | None:
    """The LUT that `apply` grades with; None where the look changes nothing. Raises SettingsError."""
    change = change_of(profile, source, target, ev)
    if not ev and str(change.given) == str(change.wanted):
        return None
    return grades_of(profile).refinish(change)


def bake_all(steps: Sequence[Transform], progress: Progress) -> tuple[Lut, ...]:
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
