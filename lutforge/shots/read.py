"""Read a shot: RAW, the JPEG that the camera made of it, settings, and the registration of the two."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Codes
from lutforge.boundary import MAX_SAMPLES
from lutforge.errors import ImageError, ShotError
from lutforge.images.developed import Development
from lutforge.images.films import FILM_SUFFIXES
from lutforge.images.heif import is_heif, read_heif
from lutforge.images.icc import is_srgb, profile_name, to_srgb
from lutforge.images.jpeg import read_header
from lutforge.images.jpeg_pixels import decode
from lutforge.images.orientation import MIRRORED, QUARTER_TURNS, inverse, orientation_between, upright
from lutforge.images.packets import read_packets
from lutforge.images.raw import RawImage, read_raw
from lutforge.images.read import read_image
from lutforge.shots.cells import CellStatistics
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES, picture_beside
from lutforge.shots.geometry import Placement, Registration
from lutforge.shots.maker_settings import edited_notes, in_adobe_rgb
from lutforge.shots.metadata import ShotMetadata, read_metadata
from lutforge.shots.registration.register import NON_RIGID_MESSAGE, register_rotated
from lutforge.shots.tags import tags, tags_of


@dataclass(frozen=True, eq=False)
class Shot:
    """A RAW/JPEG pair, both oriented like the sensor.

    name: the file's stem. jpeg: (h, w, 3) uint8. jpeg_source: "embedded preview", or the path of the JPEG file.
    registration: of the JPEG on `raw`. development: the picture that replaces the RAW. raw_camera: the other camera
    that the RAW is of, or "". fine: the JPEG's picture, 0 … 65535, where its file has more than 8 bits.

    before_straightening: None, unless the camera corrected its lens in the JPEG. `raw` is then straightened to match,
    and this is the placement on the RAW as the lens distorted it.
    """

    name: str
    path: Path
    raw: RawImage
    jpeg: NDArray[np.uint8]
    jpeg_source: str
    metadata: ShotMetadata
    registration: Registration
    development: Development | None = None
    raw_camera: str = ""
    fine: NDArray[np.uint16] | None = None
    before_straightening: Placement | None = None

    @property
    def placement(self) -> Placement:
        """The placement of the JPEG on the RAW as the lens distorted it, at which other shots can be sought first."""
        if self.before_straightening is not None:
            return self.before_straightening
        height, width = self.raw.pixels.shape[:2]
        return Placement((height, width, self.raw.pixel_size), self.jpeg.shape[:2], self.registration)

    @property
    def lens_note(self) -> str:
        """The lens corrections of the camera in its JPEG, in words for a user; "" where there are none."""
        lens = self.placement.registration.distortion
        if lens is None:
            return ""
        height, width = self.jpeg.shape[:2]
        corners = np.array([[0, 0], [width, 0], [0, height], [width, height]])
        at_corners = self.placement.registration.straight(corners)
        distances = np.linalg.norm(lens.distorted(at_corners) - (lens.x, lens.y), axis=1)
        share = float(np.mean(distances / np.linalg.norm(at_corners - (lens.x, lens.y), axis=1))) - 1
        mustache = lens.k1 * lens.k2 < 0 and abs(share) < abs(lens.k1) / 4
        shape = "mustache" if mustache else ("barrel", "pincushion")[share > 0]
        parts = [f"{shape} distortion of {100 * share:+.1f} % in the corners"] if lens.k1 or lens.k2 else []
        if lens.red or lens.blue:
            parts.append(f"red {100 * lens.red:+.2f} % and blue {100 * lens.blue:+.2f} % compared with green")
        return "corrected in the JPEG, and followed: " + ", ".join(parts)

    def raw_cells(self, cell: int) -> CellStatistics:
        """RAW statistics under the blocks of cell × cell JPEG pixels; a rest at the right and bottom is left out."""
        shape = self.jpeg.shape[0] // cell, self.jpeg.shape[1] // cell
        return CellStatistics.of(self.raw.pixels, *self.registration.borders(shape, cell, self.raw.pixel_size))

    def jpeg_cells(self, cell: int) -> CellStatistics:
        """Statistics of the JPEG over the same blocks, in codes 0 … 255."""
        jpeg = self.jpeg if self.fine is None else self.fine
        rows, columns = (cell * np.arange(side // cell + 1.0) for side in jpeg.shape[:2])
        return CellStatistics.of(jpeg, rows, columns)

    def straightened(self) -> "Shot":
        """The shot with a RAW as straight as its JPEG, where the registration states how the lens distorted it."""
        if self.registration.distortion is None:
            return self
        pixels, registration = self.registration.straightened(self.raw.pixels, self.raw.pixel_size, self.jpeg.shape)
        raw = replace(self.raw, pixels=pixels)
        return replace(self, raw=raw, registration=registration, before_straightening=self.placement)


EMBEDDED = "embedded preview"
MIRROR_IMAGE = "the picture is the mirror image of the RAW, and was mirrored back"


def read_shot(
    path: Path | str,
    development: Development | None = None,
    expected: Callable[[], Placement | None] = lambda: None,
    source: str | None = None,
) -> Shot:
    """Read one RAW file: the RAW at half size, the camera's JPEG registered on it, and the metadata.

    The JPEG is the file beside the RAW with the same stem, where that registers, and else the preview in the RAW. JPEGs
    that another program wrote are tried last, such as the preview in a converter's DNG. The notes of the metadata state
    which JPEGs were passed over, and why.

    Args:
        path: of the RAW file.
        development: a picture that a program made of the RAW, which replaces it. It is balanced, so its multipliers
            are 1. Its tones may let a JPEG seem distorted as by no lens, which is then no reason to refuse the JPEG.
        expected: returns the placement of another shot of the camera, which is tried first; called once the RAW is
            decoded.
        source: the only JPEG to try, as `Shot.jpeg_source` names it.

    Raises:
        ImageError, ShotError: the RAW cannot be read, or no JPEG matches it.
    """
    path = Path(path)
    if path.suffix.lower() in JPEG_SUFFIXES or is_heif(path):
        raise ShotError(f"{path}: a JPEG by itself is not a shot; name the RAW file that it was made from")
    try:
        raw = read_raw(path, half_size=True)
    except ImageError as error:
        if path.suffix.lower() in RAW_SUFFIXES | FILM_SUFFIXES or error.__cause__ is None:
            raise
        table = "a table of samples is a .csv or .npz file"
        raise ImageError(f"{path}: not a RAW file that LibRaw can read; {table}") from None
    if development is not None:
        ones = np.ones(3)
        raw = replace(raw, pixels=development.pixels, pixel_size=1.0, multipliers=ones, clip_level=ones)

    reasons: list[str] = []
    jpeg_file = picture_beside(path)
    candidates = [candidate for candidate in _candidates(path, jpeg_file) if source in (None, candidate[0])]
    for index, (name, edited) in enumerate(candidates):
        try:
            jpeg = _registered(raw, name, expected())
            non_rigid = jpeg.registration.non_rigid
            if non_rigid and development is None:
                raise ShotError(f"{name}: {NON_RIGID_MESSAGE.format(non_rigid)}")
        except (ImageError, ShotError) as error:
            reasons.append(str(error))
            continue

        metadata = read_metadata(path, raw, Path(name) if name != EMBEDDED else None)
        reasons += [f"{untried}: {note}" for untried, notes in candidates[index + 1 :] for note in notes]
        notes = (*edited, *jpeg.notes, *(f"passed over: {reason}" for reason in reasons))
        metadata = replace(metadata, notes=metadata.notes + notes)
        shot = Shot(path.stem, path, raw, jpeg.codes, name, metadata, jpeg.registration, development, fine=jpeg.fine)
        return shot.straightened()

    if development is not None:
        height, width = raw.pixels.shape[:2]
        reasons.append(f"the picture in the RAW's place, {width} × {height}, must be the whole frame, uncropped")
    advice = "" if jpeg_file else "; put the JPEG that the camera made beside it, under the same name"
    raise ShotError(f"{path}: no camera JPEG to pair it with: {'; '.join(reasons)}{advice}")


def _candidates(path: Path, jpeg_file: Path | None) -> list[tuple[str, tuple[str, ...]]]:
    """The JPEGs of a RAW file in the order in which they are tried, each with notes on the program that wrote it.

    Those of the camera come before those that a program wrote, and a file before the preview in the RAW.
    """
    candidates = [(str(jpeg_file), edited_notes(tags(jpeg_file)))] if jpeg_file else []
    return sorted([*candidates, (EMBEDDED, edited_notes(tags(path)))], key=lambda candidate: len(candidate[1]))


def read_pair(picture: Path, development: Development) -> Shot:
    """Register a finished sRGB picture on a developed one in the place of the RAW. Raises ImageError or ShotError."""
    ones = np.ones(3)
    raw = RawImage(development.pixels, 1.0, 0, ones, None, "a developed picture", math.nan, math.nan, ones)
    codes = np.rint(np.clip(read_image(picture).pixels[..., :3], 0.0, 1.0) * 255).astype(np.uint8)
    turned, registration, mirrored = _in_any_orientation(raw, codes)
    metadata = read_metadata(picture, raw, None)
    if mirrored:
        metadata = replace(metadata, notes=(*metadata.notes, MIRROR_IMAGE))
    return Shot(picture.stem, picture, raw, turned, str(picture), metadata, registration, development).straightened()


@dataclass(frozen=True, eq=False)
class _RegisteredJpeg:
    """A camera's picture in the sensor's orientation, in 8 bits and, where its file has more, in 16.

    notes: what was changed in it.
    """

    codes: Codes
    fine: NDArray[np.uint16] | None
    registration: Registration
    notes: tuple[str, ...]


def _registered(raw: RawImage, source: str, expected: Placement | None) -> _RegisteredJpeg:
    """Read and register a picture. source: as `Shot.jpeg_source` names it. Raises ImageError or ShotError."""
    if source == EMBEDDED and raw.preview is None:
        raise ShotError(raw.preview_note)
    heif = read_heif(Path(source)) if source != EMBEDDED and is_heif(Path(source)) else None
    if heif is not None:
        jpeg, fine, profile = heif.codes8, heif.codes if heif.bits > 8 else None, heif.icc
    else:
        try:
            data = raw.preview if source == EMBEDDED and raw.preview is not None else Path(source).read_bytes()
        except OSError as error:
            raise ImageError(f"{source}: cannot be read ({error.strerror or error})") from None
        (jpeg, profile), fine = _decoded(data, source), None
        # A camera's Adobe RGB is a style of its own.
        profile = b"" if in_adobe_rgb(tags_of(data)) else profile

    notes = []
    if heif is not None and (stated := read_packets(Path(source)).encoding):
        raise ShotError(f"{source}: its colours are in {stated}, unlike a JPEG's; set the camera to sRGB, without HDR")
    if profile and not is_srgb(profile):
        jpeg, fine = to_srgb(jpeg, profile), None
        advice = "converted to sRGB, so grade pictures that are converted"
        notes.append(f"the picture is in {profile_name(profile)}: {advice}")

    try:
        turned, registration, mirrored = _in_any_orientation(raw, jpeg, expected)
    except ShotError as error:
        raise ShotError(f"{source}: {error}") from None
    if mirrored and raw.orientation not in MIRRORED:
        notes.append(MIRROR_IMAGE)
    if fine is not None:
        fine = upright(fine, orientation_between(jpeg, turned) or 1)
    return _RegisteredJpeg(turned, fine, registration, tuple(notes))


def _in_any_orientation(
    raw: RawImage, jpeg: Codes, expected: Placement | None = None
) -> tuple[Codes, Registration, bool]:
    """Register a picture that may be turned or mirrored.

    Returned are the picture as the sensor lies, its registration, and True where it was mirrored.
    """
    # Previews lie like the sensor or upright; a JPEG file may have been turned by any program. A camera that mirrors
    # its pictures, for those who photograph themselves, leaves the RAW as it is.
    turns = tuple(dict.fromkeys((0, QUARTER_TURNS[inverse(raw.orientation)], 1, 2, 3)))
    try:
        return *register_rotated(raw, jpeg, turns, expected), False
    except ShotError as error:
        try:
            return *register_rotated(raw, np.ascontiguousarray(jpeg[:, ::-1]), turns, expected), True
        except ShotError:
            raise error from None


def _decoded(data: bytes, source: str) -> tuple[NDArray[np.uint8], bytes]:
    """(h, w, 3) of JPEG bytes, as stored, and their ICC profile. Raises ImageError: damaged, not RGB, or too large."""
    header = read_header(data)
    if header is None:
        raise ImageError(f"{source}: not a JPEG file, or a damaged one")
    if len(header.tables) != 3:
        raise ImageError(f"{source}: a JPEG of {len(header.tables)} channels, not a colour image")
    if header.width * header.height * 3 > MAX_SAMPLES:
        raise ImageError(f"{source}: claims {header.width} × {header.height} pixels, more than is read at once")
    pixels = np.empty((header.height, header.width, 3), np.uint8)
    decode(Path(source), data, pixels)
    return pixels, header.icc
