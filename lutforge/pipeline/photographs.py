"""Use case: a photograph → a picture that browsers show, and the settings that it was taken with."""

from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from lutforge.arrays import Single
from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.errors import ImageError, SettingsError
from lutforge.grading.picture_settings import choose_camera, source_selector
from lutforge.images.icc import foreign_profile, pixels_to_srgb
from lutforge.images.orientation import upright
from lutforge.images.raw import read_preview, read_raw
from lutforge.images.read import ImageReader, read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.progress import Progress
from lutforge.settings import Selector
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES, jpeg_beside
from lutforge.shots.metadata import read_picture_settings

THUMBNAIL_SIDE = 200
"""Pixels of a thumbnail's longer side."""


def picture_bytes(path: Path) -> bytes:
    """A picture as a file that browsers read: itself, or a PNG in sRGB of up to 8 million pixels. Raises ImageError."""
    if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
        with ImageReader(path) as image:
            # Browsers turn JPEGs by their orientation; not all turn PNG.
            is_turned = image.format == "png" and image.spec.get_int_attribute("Orientation", 1) != 1
            is_readable = not is_turned and not foreign_profile(image.spec)
        if is_readable:
            return path.read_bytes()
    pixels = read_small(path, 8_000_000)
    buffer = BytesIO()
    Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


def raw_picture_bytes(path: Path) -> bytes:
    """The camera's picture of a RAW file, upright, as a file that browsers read: the JPEG in its folder, or inside it.

    Raises ImageError where there is neither.
    """
    beside = jpeg_beside(path)
    if beside is not None:
        return picture_bytes(beside)
    raw = read_raw(path, half_size=True)
    if raw.preview is None:
        raise ImageError(f"{path.name}: {raw.preview_note}; put the camera's JPEG beside it")
    with scratch_folder() as folder:
        (folder / "preview.jpg").write_bytes(raw.preview)
        shown = picture_bytes(folder / "preview.jpg")
    with Image.open(BytesIO(shown)) as picture:
        if raw.orientation == 1 or picture.getexif().get(0x0112, 1) != 1:  # the browser turns the latter
            return shown
        buffer = BytesIO()
        Image.fromarray(upright(np.asarray(picture.convert("RGB")), raw.orientation)).save(buffer, format="PNG")
    return buffer.getvalue()


def thumbnail(path: Path) -> bytes:
    """A small upright JPEG of a picture, of a RAW file by the camera's own picture. Raises ImageError."""
    source: Path | BytesIO = path
    orientation = 1
    if path.suffix.lower() in RAW_SUFFIXES:
        beside = jpeg_beside(path)
        if beside is None:
            preview, orientation = read_preview(path)
        source = BytesIO(preview) if beside is None else beside
    elif path.suffix.lower() not in JPEG_SUFFIXES:
        pixels = read_small(path, THUMBNAIL_SIDE**2)
        return _as_jpeg(Image.fromarray(np.rint(255 * pixels).astype(np.uint8)))
    with reading(path, "a picture", ImageError), Image.open(source) as picture:
        picture.draft("RGB", (THUMBNAIL_SIDE, THUMBNAIL_SIDE))  # of fewer pixels where the decoder can
        picture.thumbnail((THUMBNAIL_SIDE, THUMBNAIL_SIDE))
        if picture.getexif().get(0x0112, 1) != 1:
            return _as_jpeg(ImageOps.exif_transpose(picture))
        return _as_jpeg(Image.fromarray(upright(np.asarray(picture.convert("RGB")), orientation)))


def _as_jpeg(picture: Image.Image) -> bytes:
    buffer = BytesIO()
    picture.convert("RGB").save(buffer, format="JPEG", quality=85)
    return buffer.getvalue()


def read_small(path: Path, most: int) -> Single:
    """Read an image upright, RGB in [0, 1], reduced by area means to at most `most` pixels. Raises ImageError.

    An 8-bit picture in another space than sRGB is converted, as by `apply_image`.
    """
    image = read_image(path)
    pixels = image.pixels
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ImageError(f"{path.name}: it needs red, green and blue")
    if profile := foreign_profile(image.spec):
        pixels = pixels_to_srgb(pixels, profile)
    pixels = np.clip(upright(pixels[..., :3], image.spec.get_int_attribute("Orientation", 1)), 0.0, 1.0)
    height, width = pixels.shape[:2]
    factor = int(np.ceil(np.sqrt(height * width / most)))
    if factor > 1:
        pixels = pixels[: height // factor * factor, : width // factor * factor]
        pixels = pixels.reshape(height // factor, factor, width // factor, factor, 3).mean(axis=(1, 3))
    return np.ascontiguousarray(pixels, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Photograph:
    """A picture, as a file that browsers read. selector: its settings, None where the metadata do not state them.

    style: stated by the metadata, "" where it is not one of the profile; notes: for the user.
    """

    path: Path
    picture: bytes
    selector: Selector | None
    style: str
    notes: tuple[str, ...]


def open_photograph(path: Path, profile: CameraProfile, progress: Progress) -> Photograph:
    """Read a picture, and the settings that it was taken with. Raises ImageError."""
    progress("reading", 0.1)
    settings = read_picture_settings(path)
    picture = raw_picture_bytes(path) if path.suffix.lower() in RAW_SUFFIXES else picture_bytes(path)
    notes: tuple[str, ...] = ()
    selector = None
    style = settings.style if settings.style in profile.styles else ""
    with suppress(SettingsError):
        choose_camera(path, settings, {profile.camera.lower(): profile}, is_stated=False)
        selector, notes = source_selector(path, settings, profile)
    return Photograph(path, picture, selector, style, (*settings.notes, *notes))
