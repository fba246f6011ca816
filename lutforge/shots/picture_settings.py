"""What a finished picture says about the settings that it was made with: camera, picture style, white balance."""

import contextlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.boundary import require_file
from lutforge.errors import ImageError, SettingsError
from lutforge.images.heif import is_heif
from lutforge.images.raw import read_multipliers
from lutforge.images.read import ImageReader
from lutforge.settings import Multipliers, parse_selector, setting_name
from lutforge.shots.discover import RAW_SUFFIXES, raw_beside
from lutforge.shots.editors import edited_notes
from lutforge.shots.maker_multipliers import multipliers_of
from lutforge.shots.maker_settings import notes_of, style_of, white_balance_of
from lutforge.shots.metadata import UNKNOWN, tidy_camera
from lutforge.shots.tags import MAKE, MODEL, Tags, Value
from lutforge.shots.tags import SOFTWARE as SOFTWARE_TAG
from lutforge.shots.tags import tags as file_tags

SOFTWARE = "LutForge"


@dataclass(frozen=True, eq=False)
class PictureSettings:
    """The settings that a picture's metadata tell.

    camera: make and model, "" where the file does not name it. style, white_balance: lower-case words, "unknown" where
    the file does not tell; white_balance may be a temperature ("5200k"). multipliers: (3,) with green = 1, None where
    unknown. notes: what makes the rendering depend on the scene.
    """

    camera: str
    style: str
    white_balance: str
    multipliers: Array | None
    notes: tuple[str, ...] = ()


def read_picture_settings(path: Path) -> PictureSettings:
    """Settings of a JPEG, another finished picture or a RAW file, from its EXIF and maker notes.

    A picture that LutForge wrote has the settings that its Software tag names, whatever its maker notes still say. The
    RAW file of the same camera beside a JPEG (same stem) completes what the JPEG does not tell. Raises ImageError for
    what is no image.
    """
    is_raw = path.suffix.lower() in RAW_SUFFIXES
    require_file(path, "a RAW file" if is_raw else "an image", ImageError)
    tags = file_tags(path) if is_raw or is_heif(path) else {**_header_tags(path), **file_tags(path)}
    made = None if is_raw else _made_by_lutforge(tags)
    if made is not None:
        return made
    camera = camera_of(tags)
    raw, raw_tags = (path, tags) if is_raw else _raw_of(path, camera)
    tags = {**raw_tags, **tags}
    multipliers = multipliers_of(tags)
    if multipliers is None and raw is not None:
        try:
            multipliers = read_multipliers(raw)
        except ImageError:
            multipliers = None  # then the RAW file is of no help; the picture itself may be fine
    return PictureSettings(
        camera=camera,
        style=setting_name(style_of(tags) or UNKNOWN),
        white_balance=setting_name(white_balance_of(tags) or UNKNOWN),
        multipliers=multipliers,
        notes=(*notes_of(tags), *edited_notes(tags)),
    )


@dataclass(frozen=True)
class StatedExposure:
    """Time in seconds, f-number and ISO of a picture, each 0 where it is not stated."""

    time_s: float
    aperture: float
    iso: float

    @property
    def value(self) -> float:
        """Time · ISO / 100 / f-number², at ISO 100 and f/1 where these are not stated; NaN without a time."""
        return self.time_s * (self.iso or 100.0) / 100.0 / (self.aperture or 1.0) ** 2 if self.time_s > 0 else math.nan

    @property
    def notes(self) -> tuple[str, ...]:
        """A note on each number that is not stated, and on what stands in."""
        absent = (("aperture", "f/1", self.aperture), ("ISO", "ISO 100", self.iso))
        return tuple(
            f"the file states no {name}, {usual} stands in: exposures agree only among pictures of one {name}"
            for name, usual, number in absent
            if not number
        )


def stated_exposure(path: Path) -> float:
    """The exposure that a picture's EXIF states, time · ISO / 100 / f-number²; NaN where it has no time."""
    return read_exposure(path).value


def read_exposure(path: Path) -> StatedExposure:
    """Exposure of a picture by its EXIF, completed by that of the RAW file of the same camera beside it."""
    if is_heif(path):
        tags = file_tags(path)
        stated = _exposure_of(tags)
    else:
        tags = _header_tags(path)
        with ImageReader(path) as image:
            spec = image.spec
        names = (
            ("ExposureTime", "Exif:ExposureTime"),
            ("FNumber", "Exif:FNumber"),
            ("Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings"),
        )
        stated = [float(next(filter(None, map(spec.getattribute, each)), 0.0)) for each in names]
    if not all(stated):
        beside = _exposure_of(_raw_of(path, camera_of(tags))[1])
        stated = [one or other for one, other in zip(stated, beside, strict=True)]
    return StatedExposure(*stated)


def _exposure_of(tags: Tags) -> list[float]:
    return [_ratio(tags.get(("Photo", tag))) for tag in (0x829A, 0x829D, 0x8827)]


def _raw_of(picture: Path, camera: str) -> tuple[Path | None, Tags]:
    """The RAW file of the same camera beside a picture, and its tags; none where there is none."""
    raw = raw_beside(picture) if camera else None
    tags = {} if raw is None else file_tags(raw)
    return (raw, tags) if camera_of(tags) == camera else (None, {})


def _ratio(value: Value | None) -> float:
    """The number that EXIF stores as one or two integers; 0 where there is none."""
    if not isinstance(value, tuple) or not value or (len(value) > 1 and not value[1]):
        return 0.0
    return float(value[0]) / (float(value[1]) if len(value) > 1 else 1.0)


def camera_of(tags: Tags) -> str:
    """Make and model in one; "" where neither is there."""
    make, model = (str(tags.get(key, "")).strip() for key in (MAKE, MODEL))
    return tidy_camera(make, model) if make or model else ""


def software_tag(camera: str, selector: str) -> str:
    """What the Software tag says of a picture: its settings now, as `read_picture_settings` reads them back."""
    return f"{SOFTWARE} ({camera}: {selector})"


def _made_by_lutforge(tags: Tags) -> PictureSettings | None:
    """Settings of a picture that LutForge wrote: unknown ones, where it was not a profile that made it."""
    software = str(tags.get(SOFTWARE_TAG, ""))
    if software != SOFTWARE and not software.startswith(f"{SOFTWARE} ("):
        return None
    found = re.fullmatch(rf"{SOFTWARE} \((.+): ([^:]+)\)", software)
    with contextlib.suppress(SettingsError):
        if found is not None:
            selector = parse_selector(found[2])
            balance = selector.white_balance
            multipliers = np.array(balance.rgb) if isinstance(balance, Multipliers) else None
            name = "custom" if isinstance(balance, Multipliers) else str(selector).partition("/")[2].lower()
            return PictureSettings(found[1], selector.style, name, multipliers)
    return PictureSettings(camera_of(tags), UNKNOWN, UNKNOWN, None)


def _header_tags(path: Path) -> Tags:
    """What OpenImageIO reads of any format's header, under EXIF's numbers."""
    with ImageReader(path) as image:
        spec = image.spec
    names = {
        ("Image", 0x010E): "ImageDescription",
        MAKE: "Make",
        MODEL: "Model",
        SOFTWARE_TAG: "Software",
    }
    tags: Tags = {}
    for key, name in names.items():
        text = spec.get_string_attribute(name)
        if text:
            tags[key] = text
    if "adobe rgb" in spec.get_string_attribute("ICCProfile:profile_description").lower():
        tags["Iop", 0x0001] = "R03"
    return tags
