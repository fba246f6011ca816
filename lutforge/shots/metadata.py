"""The settings that a picture was made with, from the tags of its files: camera, style, white balance, exposure."""

import contextlib
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.boundary import require_file
from lutforge.errors import ImageError, SettingsError, one_line
from lutforge.images.heif import is_heif
from lutforge.images.raw import RawImage, read_multipliers, read_preview
from lutforge.images.read import ImageReader
from lutforge.settings import UNKNOWN_CAMERA, Multipliers, camera_key, parse_selector, setting_name
from lutforge.shots.discover import RAW_SUFFIXES, picture_beside, raw_beside
from lutforge.shots.maker_multipliers import multipliers_of
from lutforge.shots.maker_settings import edited_notes, notes_of, style_of, white_balance_of
from lutforge.shots.tags import MAKE, MODEL, SOFTWARE, Tags, tags, tags_of

UNKNOWN = "unknown"
LUTFORGE = "LutForge"

_LENS = ("Photo", 0xA434)
_UNIQUE_CAMERA_MODEL = ("Image", 0xC614)
_BRANDS = (
    "Canon", "Nikon", "Sony", "Olympus", "Pentax", "Panasonic", "Fujifilm", "Samsung", "Leica", "Kodak",
    "Minolta", "Ricoh", "Sigma", "Casio", "Hasselblad", "Epson", "Apple", "Google", "DJI", "Mamiya", "Leaf",
    "Sinar", "Contax", "Kyocera", "Sanyo",
)  # fmt: skip
"""As their makers write them, whatever the Make tag says."""


@dataclass(frozen=True, eq=False)
class ShotMetadata:
    """Settings of a shot, or of a finished picture.

    camera: make and model, "" where a picture does not name it. style, white_balance: lower-case words ("standard",
    "vivid", …; "auto", "daylight", …; "unknown"); the white balance of a picture may be a temperature ("5200k").
    multipliers: (3,) with green = 1, None where unknown. exposure_s, iso, focal_mm, aperture (f-number): NaN where
    unknown. notes: what the user should know, a line each. lens: its name, "" where unknown. d65, from_xyz: as in
    `RawImage`. dng_camera: the UniqueCameraModel of a DNG, by which raw developers match profiles; "" of other files.
    """

    camera: str
    style: str
    white_balance: str
    multipliers: Array | None
    exposure_s: float = math.nan
    iso: float = math.nan
    notes: tuple[str, ...] = ()
    lens: str = ""
    focal_mm: float = math.nan
    aperture: float = math.nan
    d65: Array | None = None
    from_xyz: Array | None = None
    dng_camera: str = ""

    @property
    def exposure(self) -> float:
        """Time · ISO / 100 / f-number², at ISO 100 and f/1 where these are unknown; NaN without a time."""
        iso, aperture = (self.iso if self.iso > 0 else 100.0), (self.aperture if self.aperture > 0 else 1.0)
        return self.exposure_s * iso / 100.0 / aperture**2

    @property
    def exposure_notes(self) -> tuple[str, ...]:
        """A note on each number of `exposure` that is unknown, and on what replaces it."""
        absent = (("aperture", "f/1", self.aperture), ("ISO", "ISO 100", self.iso))
        return tuple(
            f"the file states no {name}, {default} is taken: exposures agree only among pictures of one {name}"
            for name, default, number in absent
            if not number > 0
        )


def read_metadata(path: Path, raw: RawImage, jpeg: Path | None) -> ShotMetadata:
    """Settings by a RAW file's tags, completed by those of preview and JPEG; exposure and multipliers are LibRaw's."""
    shot_tags = tags(path)
    preview = tags_of(raw.preview or b"")
    if str(preview.get(SOFTWARE, "")).lower().startswith(("dcraw", "libraw")):
        # LibRaw made this header for a preview that had none: it names the camera, nothing else that is new.
        preview = {key: value for key, value in preview.items() if key in (MAKE, MODEL)}
    for further_tags in (tags(jpeg) if jpeg else {}, preview):
        shot_tags = {**further_tags, **shot_tags}
    make, model = (str(shot_tags.get(key, "")).strip() for key in (MAKE, MODEL))
    time_s, aperture, iso = _exposure_of(shot_tags)
    style = style_of(shot_tags)
    doubts = (
        (raw.multipliers is None, "the file has no valid white-balance multipliers: they must be fitted or given"),
        (
            not make and not model,
            f'the file does not name its camera: taken for that of other files, else for "{UNKNOWN_CAMERA}"',
        ),
        (style is None, 'the file does not name its picture style: taken for "standard"'),
    )
    notes = [*notes_of(shot_tags), *(note for holds, note in doubts if holds)]
    return ShotMetadata(
        camera=tidy_camera(make or UNKNOWN, model or "camera"), style=str(style or "standard"),
        white_balance=white_balance_of(shot_tags) or UNKNOWN, multipliers=raw.multipliers,
        exposure_s=raw.exposure_s if math.isfinite(raw.exposure_s) else time_s or math.nan,
        iso=raw.iso if math.isfinite(raw.iso) and raw.iso != 65535 else iso or raw.iso,
        notes=tuple(notes), lens=raw.lens or str(shot_tags.get(_LENS, "")).strip(),
        focal_mm=raw.focal_mm, aperture=raw.aperture if math.isfinite(raw.aperture) else aperture or math.nan,
        d65=raw.d65, from_xyz=raw.from_xyz,
        dng_camera=one_line(str(shot_tags.get(_UNIQUE_CAMERA_MODEL, "")), 120),
    )  # fmt: skip


def raw_attributes(path: Path, raw: RawImage) -> dict[str, object]:
    """Attributes of the shot for a picture rendered from a RAW file, by OpenImageIO's names; no unknown ones."""
    shot_tags = tags(path)
    attributes: dict[str, object] = {
        "Make": str(shot_tags.get(MAKE, "")).strip(),
        "Model": str(shot_tags.get(MODEL, "")).strip(),
        "DateTime": raw.taken,
        "Exif:DateTimeOriginal": raw.taken,
        "ExposureTime": raw.exposure_s,
        "FNumber": raw.aperture,
        "Exif:FocalLength": raw.focal_mm,
        "Exif:LensModel": raw.lens,
        "Exif:PhotographicSensitivity": min(round(raw.iso), 65535) if math.isfinite(raw.iso) else "",
    }
    return {name: value for name, value in attributes.items() if value and value == value}  # NaN is not equal to itself


def lens_of(path: Path, raw: RawImage) -> str:
    """The name of the lens of a RAW file, as its samples have it."""
    return raw.lens or str(tags(path).get(_LENS, "")).strip()


def tidy_camera(make: str, model: str) -> str:
    """One name from the Make and Model tags, with the brand once and in its usual spelling."""
    words = f"{make} {model}".lower()
    # The model names the brand more reliably: Pentax cameras say "RICOH IMAGING COMPANY, LTD." and "PENTAX K-3".
    brand = next((name for name in _BRANDS if model.lower().startswith(name.lower())), None)
    brand = brand or next((name for name in _BRANDS if name.lower() in words), None)
    if brand is None:
        return re.sub(r"\s+", " ", model if model.lower().startswith(make.lower()) else f"{make} {model}").strip()
    model_alone = re.sub(rf"^{brand}\b", "", model.strip(), flags=re.IGNORECASE).strip()
    return re.sub(r"\s+", " ", f"{brand} {model_alone}").strip()


def read_picture_settings(path: Path) -> ShotMetadata:
    """Settings and exposure of a JPEG, another finished picture or a RAW file, from its EXIF and maker notes.

    A picture that LutForge wrote has the settings that its Software tag names, whatever its maker notes still say. The
    RAW file of the same camera beside a JPEG (same stem) completes what the JPEG does not state. Raises ImageError.
    """
    is_raw = path.suffix.lower() in RAW_SUFFIXES
    require_file(path, "a RAW file" if is_raw else "an image", ImageError)
    shot_tags = tags(path) if is_raw else _picture_tags(path)
    camera = camera_of(shot_tags)
    raw = path if is_raw else raw_beside(path) if camera else None
    raw_tags = shot_tags if is_raw else {} if raw is None else tags(raw)
    if camera_key(camera_of(raw_tags)) != camera_key(camera):
        raw, raw_tags = None, {}

    exposures = zip(_exposure_of(shot_tags), _exposure_of(raw_tags), strict=True)
    time_s, aperture, iso = (of_picture or of_raw or math.nan for of_picture, of_raw in exposures)
    settings = None if is_raw else _made_by_lutforge(shot_tags)
    if settings is not None:
        return replace(settings, exposure_s=time_s, iso=iso, aperture=aperture)

    shot_tags = {**raw_tags, **shot_tags}
    multipliers = multipliers_of(shot_tags)
    if multipliers is None and raw is not None:
        try:
            multipliers = read_multipliers(raw)
        except ImageError:
            multipliers = None  # then the RAW file is of no help; the picture itself may be fine
    return ShotMetadata(
        camera=camera, style=setting_name(str(style_of(shot_tags) or UNKNOWN)),
        white_balance=setting_name(white_balance_of(shot_tags) or UNKNOWN), multipliers=multipliers, exposure_s=time_s,
        iso=iso, notes=(*notes_of(shot_tags), *edited_notes(shot_tags)), aperture=aperture,
    )  # fmt: skip


_SHUTTER_SPEED = 0x9201
_RATIOS = (0x829A, 0x829D, _SHUTTER_SPEED, 0x9202, 0xA215)
"""The tags of an exposure that are ratios of two integers; the others are integers."""
_EXPOSURE_NAMES = {
    0x829A: ("ExposureTime", "Exif:ExposureTime"),
    0x829D: ("FNumber", "Exif:FNumber"),
    0x8827: ("Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings"),
    0x8830: ("Exif:SensitivityType",),
    0x8831: ("Exif:StandardOutputSensitivity",),
    0x8832: ("Exif:RecommendedExposureIndex",),
    0x8833: ("Exif:ISOSpeed",),
    _SHUTTER_SPEED: ("Exif:ShutterSpeedValue",),
    0x9202: ("Exif:ApertureValue",),
    0xA215: ("Exif:ExposureIndex",),
}
"""The tags of an exposure, and OpenImageIO's names of them."""


def _exposure_of(shot_tags: Tags) -> list[float]:
    """Time, f-number and ISO by the tags of Exif 2.32, 4.6.5; 0 where there is none."""
    time_s = _ratio(shot_tags, 0x829A)
    aperture = _ratio(shot_tags, 0x829D)
    if not time_s > 0:  # ShutterSpeedValue, of APEX: −log2 of the time
        shutter = _ratio(shot_tags, 0x9201)
        time_s = 2.0**-shutter if math.isfinite(shutter) and abs(shutter) < 30 else 0.0
    if not aperture > 0:  # ApertureValue, of APEX: 2 log2 of the f-number
        value = _ratio(shot_tags, 0x9202)
        aperture = 2.0 ** (value / 2) if 0 <= value < 20 else 0.0
    return [time_s, aperture, _iso_of(shot_tags)]


_SENSITIVITIES = {1: (0x8831,), 2: (0x8832,), 3: (0x8833,), 4: (0x8831, 0x8832), 5: (0x8831, 0x8833),
                  6: (0x8832, 0x8833), 7: (0x8831, 0x8832, 0x8833)}  # fmt: skip
"""SensitivityType → the tags that PhotographicSensitivity repeats: StandardOutputSensitivity, RecommendedExposureIndex,
ISOSpeed (Exif 2.32, table 9)."""


def _iso_of(shot_tags: Tags) -> float:
    """PhotographicSensitivity, which ends at 65535; there, or without it, the tag that SensitivityType names.

    Without any of them it is ExposureIndex, which old cameras wrote instead; or 0.
    """
    iso = _ratio(shot_tags, 0x8827)
    if 0 < iso < 65535:
        return iso
    kind = shot_tags.get(("Photo", 0x8830))
    named = _SENSITIVITIES.get(kind[0], ()) if isinstance(kind, tuple) and kind else ()
    for tag in (*named, 0x8831, 0x8832, 0x8833):
        value = _ratio(shot_tags, tag)
        if value > 0:
            return value
    index = _ratio(shot_tags, 0xA215)
    return next((value for value in (iso, index) if value > 0), 0.0)


def _ratio(shot_tags: Tags, tag: int) -> float:
    """A number of the EXIF directory, stored as one integer or two; NaN where there is none."""
    value = shot_tags.get(("Photo", tag))
    if not isinstance(value, tuple) or not value:
        return math.nan
    if tag in _RATIOS:
        return value[0] / value[1] if len(value) > 1 and value[1] > 0 else math.nan
    return float(value[0])


def camera_of(shot_tags: Tags) -> str:
    """Make and model in one; "" where neither is there."""
    make, model = (str(shot_tags.get(key, "")).strip() for key in (MAKE, MODEL))
    return tidy_camera(make, model) if make or model else ""


def stated_camera(path: Path) -> str:
    """The camera that a RAW file or a picture names, without decoding it; "" where none of its tags do.

    As in `read_metadata`, the JPEG beside a RAW file and its preview complete what its own tags do not state.
    """
    camera = camera_of(tags(path))
    if not camera and path.suffix.lower() in RAW_SUFFIXES:
        beside = picture_beside(path)
        camera = camera_of(tags(beside)) if beside is not None else ""
        with contextlib.suppress(ImageError):
            camera = camera or camera_of(tags_of(read_preview(path)[0]))
    return camera


def software_tag(camera: str, selector: str) -> str:
    """The Software tag of a graded picture: its settings now, as `read_picture_settings` reads them back."""
    return f"{LUTFORGE} ({camera}: {selector})"


def _made_by_lutforge(shot_tags: Tags) -> ShotMetadata | None:
    """The settings of a picture that LutForge wrote, None of another; "unknown" where no profile rendered it."""
    software = str(shot_tags.get(SOFTWARE, ""))
    if software != LUTFORGE and not software.startswith(f"{LUTFORGE} ("):
        return None
    stated = re.fullmatch(rf"{LUTFORGE} \((.+): ([^:]+)\)", software)
    with contextlib.suppress(SettingsError):
        if stated is not None:
            selector = parse_selector(stated[2])
            balance = selector.white_balance
            multipliers = np.array(balance.rgb) if isinstance(balance, Multipliers) else None
            name = "custom" if isinstance(balance, Multipliers) else str(selector).partition("/")[2].lower()
            return ShotMetadata(stated[1], selector.style, name, multipliers)
    return ShotMetadata(camera_of(shot_tags), UNKNOWN, UNKNOWN, None)


def _picture_tags(path: Path) -> Tags:
    """A finished picture's tags, completed by what OpenImageIO reads of any format's header, under EXIF's numbers."""
    if is_heif(path):
        return tags(path)
    with ImageReader(path) as image:
        spec = image.spec
    header: Tags = {}
    names = {("Image", 0x010E): "ImageDescription", MAKE: "Make", MODEL: "Model", SOFTWARE: "Software"}
    for key, name in names.items():
        if text := spec.get_string_attribute(name):
            header[key] = text
    for tag, words in _EXPOSURE_NAMES.items():
        # An attribute of an OpenEXR file may be of any type.
        stated = [value for value in map(spec.getattribute, words) if isinstance(value, int | float)]
        value = float(next(filter(None, stated), 0.0))
        if math.isfinite(value) and (value > 0 or (value and tag == _SHUTTER_SPEED)):
            header["Photo", tag] = value.as_integer_ratio() if tag in _RATIOS else (round(value),)
    if "adobe rgb" in spec.get_string_attribute("ICCProfile:profile_description").lower():
        header["Iop", 0x0001] = "R03"
    return {**header, **tags(path)}
