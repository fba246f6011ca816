"""Read a shot: RAW, the JPEG that the camera made of it, settings, and the registration of the two."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Codes
from lutforge.atomic_write import scratch_folder
from lutforge.boundary import MAX_SAMPLES
from lutforge.errors import ImageError, ShotError
from lutforge.images.heif import is_heif, read_heif
from lutforge.images.icc import is_srgb, profile_name, to_srgb
from lutforge.images.jpeg import decode, read_header
from lutforge.images.raw import RawImage, read_raw
from lutforge.images.read import Development, read_image
from lutforge.shots.align import IS_WARPED, register_rotated
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES, jpeg_beside
from lutforge.shots.geometry import Placement, Registration
from lutforge.shots.maker_settings import edited_notes, in_adobe_rgb
from lutforge.shots.metadata import read_metadata
from lutforge.shots.shot import Shot
from lutforge.shots.tags import tags, tags_of

EMBEDDED = "embedded preview"

TURNS = {0: 0, 3: 2, 5: 3, 6: 1}
"""LibRaw's flip → quarter turns (numpy.rot90) that bring an upright picture back to the sensor's
orientation."""


def read_shot(
    path: Path | str,
    development: Development | None = None,
    expected: Callable[[], Placement | None] = lambda: None,
    source: str | None = None,
) -> Shot:
    """RAW at half size, the registered camera JPEG, and the metadata of one RAW file.

    The JPEG beside the RAW (same stem) is used where it registers, else the embedded preview; one that another program
    wrote (a converter's DNG holds that converter's rendering) comes last. metadata.notes says so, and which was passed
    over and why. development: a picture that a program made of the RAW, which then takes the RAW's place: balanced, so
    that its multipliers are 1; its tones may let a JPEG seem warped, which then is no reason to refuse it. expected:
    called once the RAW is decoded, for where another shot of the camera lies; the place is looked at first. source: the
    JPEG to take and no other, as `Shot.jpeg_source` names it. Raises ImageError where the RAW cannot be decoded,
    ShotError where no JPEG matches it.
    """
    path = Path(path)
    if path.suffix.lower() in JPEG_SUFFIXES or is_heif(path):
        raise ShotError(f"{path}: a JPEG by itself is not a shot; name the RAW file that it was made from")
    try:
        raw = read_raw(path, half_size=True)
    except ImageError as error:
        if path.suffix.lower() in RAW_SUFFIXES or error.__cause__ is None:
            raise
        raise ImageError(
            f"{path}: not a RAW file that LibRaw can read; a table of samples is a .csv or .npz file"
        ) from None
    if development is not None:
        ones = np.ones(3)
        raw = replace(raw, pixels=development.pixels, pixel_size=1.0, multipliers=ones, clip_level=ones)
    reasons: list[str] = []
    beside = jpeg_beside(path)
    candidates = [(str(beside), edited_notes(tags(beside)))] if beside else []
    candidates = sorted([*candidates, (EMBEDDED, edited_notes(tags(path)))], key=lambda candidate: len(candidate[1]))
    candidates = [candidate for candidate in candidates if source in (None, candidate[0])]
    for index, (name, edited) in enumerate(candidates):
        try:
            jpeg, fine, registration, converted = _registered(raw, path, name, expected())
            if registration.warp and development is None:
                raise ShotError(f"{name}: {IS_WARPED.format(registration.warp)}")
        except (ImageError, ShotError) as error:
            reasons.append(str(error))
            continue
        metadata = read_metadata(path, raw, Path(name) if name != EMBEDDED else None)
        reasons += [f"{other}: {note}" for other, notes in candidates[index + 1 :] for note in notes]
        notes = (*edited, *converted, *(f"passed over: {reason}" for reason in reasons))
        metadata = replace(metadata, notes=metadata.notes + notes)
        shot = Shot(path.stem, path, raw, jpeg, name, metadata, registration, development, fine=fine)
        return shot.straightened()
    size = (
        "" if development is None else "; the picture in the RAW's place, {1} × {0}, must be the whole frame, uncropped"
    )
    raise ShotError(
        f"{path}: no camera JPEG to pair it with: {'; '.join(reasons)}" + size.format(*raw.pixels.shape[:2])
    )


def read_pair(picture: Path, development: Development) -> Shot:
    """Register a finished sRGB picture on a developed one in the place of the RAW. Raises ImageError or ShotError."""
    ones = np.ones(3)
    left = RawImage(
        pixels=development.pixels,
        pixel_size=1.0,
        flip=0,
        multipliers=ones,
        preview=None,
        preview_note="a developed picture",
        exposure_s=math.nan,
        iso=math.nan,
        clip_level=ones,
    )
    codes = np.rint(np.clip(read_image(picture).pixels[..., :3], 0.0, 1.0) * 255).astype(np.uint8)
    turned, registration = register_rotated(left, codes)
    metadata = read_metadata(picture, left, None)
    return Shot(picture.stem, picture, left, turned, str(picture), metadata, registration, development).straightened()


def _registered(
    raw: RawImage, path: Path, source: str, expected: Placement | None
) -> tuple[Codes, NDArray[np.uint16] | None, Registration, tuple[str, ...]]:
    """The picture in 8 and, where it has more, in 16 bits, as the sensor lies; its registration; notes."""
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
        jpeg, fine = _decode(data, source), None
        header = read_header(data)
        # A camera's Adobe RGB is a style of its own.
        profile = header.icc if header is not None and not in_adobe_rgb(tags_of(data)) else b""
    notes = []
    if heif is not None and heif.hdr:
        raise ShotError(f"{source}: encoded for HDR ({heif.hdr}), unlike a JPEG; set the camera to SDR")
    if profile and not is_srgb(profile):
        jpeg, fine = to_srgb(jpeg, profile), None
        notes.append(
            f"the picture is in {profile_name(profile)}: converted to sRGB, so grade pictures that are converted"
        )
    # Previews lie like the sensor or upright; a file beside may have been turned by any program.
    likely = (0, TURNS.get(raw.flip, 0), 1, 2, 3)
    try:
        turned, registration = register_rotated(raw, jpeg, tuple(dict.fromkeys(likely)), expected)
    except ShotError as error:
        raise ShotError(f"{source}: {error}") from None
    if fine is not None:
        turn = next(turn for turn in range(4) if np.array_equal(np.rot90(jpeg, turn), turned))
        fine = np.ascontiguousarray(np.rot90(fine, turn))
    return turned, fine, registration, tuple(notes)


def _decode(data: bytes, source: str) -> NDArray[np.uint8]:
    """(h, w, 3) of JPEG bytes, as stored. Raises ImageError: damaged, not RGB, or too large."""
    if not data.startswith(b"\xff\xd8"):
        raise ImageError(f"{source}: not a JPEG file")
    header = read_header(data)
    if header is not None and header.plain and header.width * header.height * 3 <= MAX_SAMPLES:
        pixels = np.empty((header.height, header.width, 3), np.uint8)
        decode(Path(source), data, pixels)
        return pixels
    with scratch_folder() as folder:
        file = folder / "preview.jpg"
        file.write_bytes(data)
        try:
            picture = read_image(file).pixels
        except ImageError as error:
            raise ImageError(str(error).replace(str(file), source)) from None
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise ImageError(f"{source}: decodes to {picture.shape} pixels, not to a colour image")
    return np.rint(picture * 255).astype(np.uint8)
