"""What the file says about a shot: camera, picture style, white balance, exposure."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

from lutforge.arrays import Array
from lutforge.images.raw import RawImage
from lutforge.shots.maker_settings import notes_of, style_of, white_balance_of
from lutforge.shots.tags import MAKE, MODEL, SOFTWARE, Tags, Value, tags, tags_of

UNKNOWN = "unknown"

_BRANDS = (
    "Canon", "Nikon", "Sony", "Olympus", "Pentax", "Panasonic", "Fujifilm", "Samsung", "Leica", "Kodak",
    "Minolta", "Ricoh", "Sigma", "Casio", "Hasselblad", "Epson", "Apple", "Google", "DJI", "Mamiya", "Leaf",
    "Sinar", "Contax", "Kyocera", "Sanyo",
)  # fmt: skip
"""As their makers write them, whatever the Make tag says."""


@dataclass(frozen=True, eq=False)
class ShotMetadata:
    """Settings of one shot.

    style, white_balance: lower-case words ("standard", "vivid", …; "auto", "daylight", …; "unknown").
    multipliers: (3,) with green = 1, None where unknown. exposure_s, iso, focal_mm, aperture (f-number): NaN where
    unknown. lens: its name, "" where unknown. d65: as of `RawImage`. notes: what the user should know, a line each.
    """

    make: str
    model: str
    style: str
    white_balance: str
    multipliers: Array | None
    exposure_s: float
    iso: float
    notes: tuple[str, ...]
    lens: str = ""
    focal_mm: float = math.nan
    aperture: float = math.nan
    d65: Array | None = None

    @property
    def camera(self) -> str:
        """Make and model in one, without a doubled make: "Canon PowerShot S40", "Nikon D40"."""
        return tidy_camera(self.make, self.model)


def read_metadata(path: Path, raw: RawImage, jpeg: Path | None) -> ShotMetadata:
    """Settings from the RAW file's own tags, completed by those of its preview and of the JPEG beside it.

    Exposure, ISO and multipliers are LibRaw's. Raises nothing: what is not found is unknown, and the notes say so.
    """
    found = tags(path)
    preview = tags_of(raw.preview or b"")
    if str(preview.get(SOFTWARE, "")).lower().startswith(("dcraw", "libraw")):
        # LibRaw made this header for a preview that had none: it names the camera, nothing else that is new.
        preview = {key: value for key, value in preview.items() if key in (MAKE, MODEL)}
    for other in (tags(jpeg) if jpeg else {}, preview):
        found = {**other, **found}
    make, model = (str(found.get(key, "")).strip() for key in (MAKE, MODEL))
    notes = list(notes_of(found))
    if raw.multipliers is None:
        notes.append("the file has no valid white-balance multipliers: they must be fitted or given")
    if not make and not model:
        notes.append("the file does not name its camera")
    style = style_of(found)
    if style is None:
        notes.append('the file does not name its picture style: taken for "standard"')
    return ShotMetadata(
        make=make or UNKNOWN,
        model=model or "camera",
        style=style or "standard",
        white_balance=white_balance_of(found) or UNKNOWN,
        multipliers=raw.multipliers,
        exposure_s=raw.exposure_s if math.isfinite(raw.exposure_s) else _ratio(found.get(("Photo", 0x829A))),
        iso=raw.iso if math.isfinite(raw.iso) else _number(found.get(("Photo", 0x8827))),
        notes=tuple(notes),
        lens=raw.lens or _lens(found),
        focal_mm=raw.focal_mm,
        aperture=raw.aperture,
        d65=raw.d65,
    )


def raw_attributes(path: Path, raw: RawImage) -> dict[str, object]:
    """What a picture rendered from a RAW file has to say of the shot, by OpenImageIO's names; unknown ones left out."""
    named = tags(path)
    attributes: dict[str, object] = {
        "Make": str(named.get(MAKE, "")).strip(),
        "Model": str(named.get(MODEL, "")).strip(),
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
    return raw.lens or _lens(tags(path))


def _lens(found: Tags) -> str:
    return str(found.get(("Photo", 0xA434), "")).strip()


def tidy_camera(make: str, model: str) -> str:
    """One name from the Make and Model tags, with the brand once and in its usual spelling."""
    words = f"{make} {model}".lower()
    # The model names the brand more reliably: Pentax cameras say "RICOH IMAGING COMPANY, LTD." and "PENTAX
    # K-3".
    brand = next((name for name in _BRANDS if model.lower().startswith(name.lower())), None)
    brand = brand or next((name for name in _BRANDS if name.lower() in words), None)
    if brand is None:
        return re.sub(r"\s+", " ", model if model.lower().startswith(make.lower()) else f"{make} {model}").strip()
    rest = re.sub(rf"^{brand}\b", "", model.strip(), flags=re.IGNORECASE).strip()
    return re.sub(r"\s+", " ", f"{brand} {rest}").strip()


def _number(value: Value | None) -> float:
    return float(value[0]) if isinstance(value, tuple) and value and value[0] > 0 else math.nan


def _ratio(value: Value | None) -> float:
    if isinstance(value, tuple) and len(value) >= 2 and value[0] > 0 and value[1] > 0:
        return value[0] / value[1]
    return math.nan
