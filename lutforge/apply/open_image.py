"""Open an image to be graded: region by region, or whole in memory where it must be rendered, turned or converted."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from threading import Semaphore

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.grade import Grade
from lutforge.arrays import Pixels
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif
from lutforge.images.icc import foreign_profile, pixels_to_srgb
from lutforge.images.read import ImageReader, Region, read_image
from lutforge.images.write import IN_SRGB, keeps_orientation, upright, with_shape
from lutforge.shots.discover import RAW_SUFFIXES

_ORIENTATION_OF_FLIP = {3: 3, 5: 8, 6: 6}
"""LibRaw's flip → EXIF orientation."""


@dataclass(frozen=True, eq=False)
class InMemoryImage:
    """An image that is needed as a whole: RAW files and HEIF pictures, and those that must be turned or converted.

    profile: the ICC profile of the space that the pixels were converted from, to sRGB; empty where they were not.
    """

    pixels: Pixels
    spec: oiio.ImageSpec
    format: str = ""
    parts: int = 1
    profile: bytes = b""

    def regions(self, pixels: int, rows_only: bool) -> list[Region]:
        """Bands of about so many pixels, as `ImageReader.regions`."""
        height, width = self.pixels.shape[:2]
        step = max(1, pixels // width)
        return [Region(0, top, width, min(top + step, height)) for top in range(0, height, step)]

    def read(self, region: Region) -> Pixels:
        """The pixels (h, w, c) of a region."""
        return self.pixels[region.top : region.bottom]

    def count_parts(self) -> int:
        """How many images the file holds."""
        return self.parts


@contextmanager
def open_image(source: Path, target: Path, grade: Grade) -> Iterator[ImageReader | InMemoryImage]:
    """Open an image for its grade: RAW files rendered linear, pictures turned where the target's format cannot tell so.

    Raises ImageError.
    """
    if grade.raw:
        from lutforge.images.raw import read_raw  # LibRaw, and what reads metadata, for RAW files alone
        from lutforge.model.falloff import falloff_of
        from lutforge.shots.metadata import lens_of, raw_attributes

        with _in_memory():
            image = read_raw(source)
            falloff = falloff_of(grade.falloffs, lens_of(source, image), image.focal_mm, image.aperture)
            if falloff is not None:
                image.pixels[:] *= falloff.gain(*image.pixels.shape[:2])[..., None]
            pixels = upright(image.pixels, _ORIENTATION_OF_FLIP.get(image.flip, 1))
            spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint16")
            for name, value in raw_attributes(source, image).items():
                spec[name] = value
            yield InMemoryImage(pixels, spec)
        return
    if source.suffix.lower() in RAW_SUFFIXES:
        raise ImageError(f"{source}: a RAW file; what renders it is a camera's profile (.npz)")
    if is_heif(source):
        with _in_memory():
            picture = read_image(source)
            yield _in_srgb(InMemoryImage(picture.pixels, picture.spec, picture.format), grade)
        return
    with ImageReader(source) as reader:
        orientation = reader.spec.get_int_attribute("Orientation", 1)
        turned = orientation != 1 and not keeps_orientation(target)
        if not turned and not (grade.for_srgb and foreign_profile(reader.spec)):
            yield reader
            return
        with _in_memory():
            pixels, spec = reader.read(reader.whole), reader.spec
            if turned:
                pixels = upright(pixels, orientation)
                spec = with_shape(spec, pixels.shape)
                spec.attribute("Orientation", 1)
            yield _in_srgb(InMemoryImage(pixels, spec, reader.format, reader.count_parts()), grade)


def _in_srgb(image: InMemoryImage, grade: Grade) -> InMemoryImage:
    """The image, converted to sRGB where its grade wants that."""
    profile, spec = foreign_profile(image.spec), oiio.ImageSpec(image.spec)
    if not grade.for_srgb or not profile:
        return image
    spec.erase_attribute("ICCProfile")
    spec.attribute("Exif:ColorSpace", IN_SRGB)
    return replace(image, pixels=pixels_to_srgb(image.pixels, profile), spec=spec, profile=profile)


@cache
def _in_memory() -> Semaphore:
    """How many images may be in memory as a whole at once: a decoded RAW file takes about 2 GB in the worst case."""
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8_000_000_000
    return Semaphore(max(1, pages // 4_000_000_000))
