"""Use case: a file of any kind → its contents, and what it can be used for."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lutforge.boundary import reading
from lutforge.child_processes import OverrunError, guarded
from lutforge.errors import ImageError, LutError, one_line
from lutforge.images.heif import is_heif, read_heif
from lutforge.pipeline.file_kinds import (
    CAMERA_PROFILE_SUFFIXES,
    CONFIG_SUFFIXES,
    PICTURE_SUFFIXES,
    PROFILE_SUFFIXES,
    TABLE_SUFFIXES,
    is_lut_picture,
)
from lutforge.reports.tables import exposure_time
from lutforge.samples.table import read_samples
from lutforge.samples.table_file import is_table
from lutforge.shots.discover import RAW_SUFFIXES, raw_beside

# The reader of each kind of file is imported in the function that needs it, so that others start faster.
if TYPE_CHECKING:
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.shots.metadata import ShotMetadata

NamedValues = Iterator[tuple[str, str]]


@dataclass(frozen=True)
class Inspection:
    """The contents of a file. rows: names and values, for a table; lines: the report of `check`, for LUTs and configs.

    profile: the profile, where the file is one.
    """

    rows: tuple[tuple[str, str], ...] = ()
    profile: "CameraProfile | None" = None
    lines: tuple[str, ...] = ()


def files_to_inspect(path: str | Path) -> list[Path]:
    """Return a file itself, or a folder's RAW files, pictures, tables and profiles; the folder where it has none.

    A picture is left out where the RAW file of the same shot is in its folder.
    """
    path = Path(path)
    if not path.is_dir():
        return [path]
    suffixes = RAW_SUFFIXES | PICTURE_SUFFIXES | {*PROFILE_SUFFIXES, *TABLE_SUFFIXES}
    files = sorted(entry for entry in path.iterdir() if entry.suffix.lower() in suffixes and entry.is_file())
    return [file for file in files if file.suffix.lower() not in PICTURE_SUFFIXES or raw_beside(file) is None] or [path]


def inspect(path: str | Path) -> Inspection:
    """Read a RAW file, picture, profile, sample table, LUT or config, and report its contents. Raises LutForgeError."""
    with reading(path, "what its name says", ImageError):
        return _inspected(Path(path))


def _inspected(path: Path) -> Inspection:
    """The contents of a file, by the reader for its suffix."""
    suffix = path.suffix.lower()
    if path.is_dir():
        raise ImageError(f"{path}: no RAW file, picture, sample table or profile in this folder")
    if suffix in TABLE_SUFFIXES and is_table(path):
        return Inspection(tuple(_table(path)))
    if suffix in PROFILE_SUFFIXES:
        from lutforge.model.camera_profile import load_profile

        profile = load_profile(path)
        return Inspection(tuple(_profile(profile)), profile)
    if suffix in PICTURE_SUFFIXES and not is_lut_picture(path):
        return Inspection(tuple(_picture(path)))
    import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

    from lutforge.luts.formats import FORMATS

    ocio_suffixes = {f".{ending.lower()}" for _, ending in OCIO.FileTransform.getFormats()}
    if suffix in CONFIG_SUFFIXES:
        return Inspection(lines=tuple(check(path)))
    if suffix in {*CAMERA_PROFILE_SUFFIXES, *FORMATS, *ocio_suffixes}:
        use = "a camera profile: a RAW developer" if suffix in CAMERA_PROFILE_SUFFIXES else "a LUT: apply, check"
        return Inspection(lines=(*check(path), f"  use       {use}"))
    return Inspection(tuple(_shot(path)))


def _shot(path: Path) -> NamedValues:
    """The rows on a RAW file and its JPEG."""
    from lutforge.shots.read import read_shot

    shot = read_shot(path)
    data = shot.metadata
    place = shot.placement.registration
    yield "camera", data.camera
    yield "picture style", data.style
    yield "white balance", f"{data.white_balance}, multipliers {_numbers(data.multipliers)}"
    yield "exposure", _exposure(data)
    height, width = shot.jpeg.shape[:2]
    yield "JPEG", f"{width} × {height}, {shot.jpeg_source}"
    offset = f"{place.offset_x:.1f}, {place.offset_y:.1f}, correlation {place.correlation:.3f}"
    yield "registration", f"{place.scale:.4f} RAW pixels per JPEG pixel, offset {offset}"
    if shot.lens_note:
        yield "lens", shot.lens_note
    yield "use", "a RAW/JPEG pair: sample, calibrate, evaluate"
    yield from (("note", text) for text in data.notes)


def _picture(path: Path) -> NamedValues:
    """The rows on a picture, which is read to its end."""
    from lutforge.images.read import ImageReader
    from lutforge.shots.metadata import read_picture_settings

    settings = read_picture_settings(path)
    if is_heif(path):
        heif = read_heif(path)
        yield "picture", f"{heif.codes.shape[1]} × {heif.codes.shape[0]}, heif, {heif.bits} bits"
    else:
        with ImageReader(path) as image:
            for region in image.regions(1 << 22, rows_only=True):
                image.read(region)  # raises an error where the file is cut short
            yield "picture", f"{image.spec.width} × {image.spec.height}, {image.format}"
    yield "camera", settings.camera or "the file does not name it"
    yield "picture style", settings.style
    yield "white balance", f"{settings.white_balance}, multipliers {_numbers(settings.multipliers)}"
    yield "exposure", _exposure(settings)
    yield "use", "a finished picture: apply; a RAW file of the same name beside it makes it a pair to calibrate from"
    yield from (("note", text) for text in settings.notes)


def _table(path: Path) -> NamedValues:
    """The rows on a sample table."""
    samples = read_samples(path)
    columns = {"camera": samples.camera, "style": samples.style, "white balance": samples.white_balance}
    for name, values in columns.items():
        for value, count in zip(*np.unique(values, return_counts=True), strict=True):
            yield name, f"{value}: {count} samples"
    yield "shots", str(len(np.unique(samples.shot)))
    yield "use", "a sample table: calibrate, evaluate, report, studio"


def _profile(profile: "CameraProfile") -> NamedValues:
    """The rows on a profile."""
    yield "camera", profile.camera
    yield "shots", str(len(profile.shots))
    for name, balance in profile.white_balances.items():
        kelvin = f", {balance.kelvin:.0f} K" if balance.kelvin is not None else ""
        spread = f", varies by {balance.spread:.0%} from shot to shot" if balance.spread > 0.005 else ""
        gain = f", times {balance.gain:.4g}" if balance.gain != 1.0 else ""
        yield "white balance", f"{name}: {_numbers(balance.multipliers)}{gain}{kelvin}{spread}"
    for name, style in profile.styles.items():
        sizes = {direction: " × ".join(map(str, lattice.size)) for direction, lattice in style.lattices.items()}
        parts = [f"{direction} lattice {size}" for direction, size in sizes.items()]
        parts += [f"camera model for {', '.join(model.white_balances)}" for model in style.models]
        yield "style", f"{name}: {'; '.join(parts)}"
    for vignetting in profile.vignettings:
        yield "vignetting", f"{vignetting.setting}: {vignetting.corners} in the corners"
    yield from (("note", text) for text in (*map(str, profile.diagnoses), *profile.notes))
    yield "use", "a camera profile: bake, config, apply, evaluate, report"


def check(path: str | Path) -> list[str]:
    """The report on a LUT file, a camera profile or a config: contents, programs that read it, and problems.

    Raises LutForgeError.
    """
    with reading(path, "a LUT, profile or config", LutError):
        return _checked(Path(path))


def _checked(path: Path) -> list[str]:
    """The lines of `check`, by the reader for the suffix."""
    suffix = path.suffix.lower()
    if suffix in CONFIG_SUFFIXES:
        return _config_lines(path)
    if suffix == ".dcp":
        from lutforge.kits.dcp import dcp_lines

        return dcp_lines(path)
    if suffix in (".icc", ".icm"):
        from lutforge.kits.icc import icc_lines

        return icc_lines(path)
    from lutforge.luts.check import check_lut, report_lines

    return report_lines(check_lut(path))


OCIO_RELEASES = {
    (2, 0): "January 2021",
    (2, 1): "August 2021",
    (2, 2): "October 2022",
    (2, 3): "October 2023",
    (2, 4): "September 2024",
    (2, 5): "September 2025",
}
"""The release dates of OpenColorIO, by the profile versions of configs that it can read."""


def _config_lines(path: Path) -> list[str]:
    """The report on a config of any origin: contents, problems, and the versions of OpenColorIO that read it."""
    try:
        return guarded(_config_report, path, True)
    except OverrunError:
        note = "  note      its transforms take too long to try: not checked"
        return [*guarded(_config_report, path, False), note]


def _config_report(path: Path, with_transforms: bool) -> list[str]:
    """The lines of `check` for a config; with_transforms: pixels go through each of its transforms."""
    import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

    from lutforge.ocio.check import check_config, file_names, load_config

    OCIO.ClearAllCaches()  # without this a file that was deleted since the last call would still be found
    config = load_config(path)
    version = config.getMajorVersion(), config.getMinorVersion()
    lines = [f"{path}: OpenColorIO config, profile version {version[0]}.{version[1]}"]
    if description := one_line(config.getDescription(), 160):
        lines.append(f"  about     {description}")
    spaces = [*config.getColorSpaceNames(OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL)]
    displays = [*config.getDisplaysAll()]
    views = {view for display in displays for view in config.getViews(display)}
    for title, names in (
        ("spaces", spaces),
        ("displays", displays),
        ("views", sorted(views)),
        ("looks", [*config.getLookNames()]),
        ("roles", [f"{role}: {space}" for role, space in config.getRoles()]),
    ):
        if names:
            lines.append(f"  {title:<9} {len(names)}: {one_line(', '.join(names), 240)}")

    files = file_names(config)
    problems = check_config(config) if with_transforms else []
    shown = [str(problem) for problem in problems]
    if files:
        missing = [str(problem) for problem in problems if problem.is_missing_file]
        lines.append(f"  files     {len(files)}, {f'{len(missing)} missing' if missing else 'all found'}")
        # OpenColorIO's errors on the same files are left out.
        others = [str(problem) for problem in problems if not problem.is_missing_file]
        shown = [*missing, *(text for text in others if "could not be located" not in text)]
    lines += [f"  problem   {one_line(text, 300)}" for text in shown[:20]]
    if len(shown) > 20:
        lines.append(f"  problem   and {len(shown) - 20} others")

    needed = max(version, (2, 2)) if path.suffix.lower() == ".ocioz" else version
    since = f" ({OCIO_RELEASES[needed]})" if needed in OCIO_RELEASES else ""
    reads = f"OpenColorIO {needed[0]}.{needed[1]}{since} or later" if needed >= (2, 0) else "every OpenColorIO"
    archive = "; older versions read no .ocioz, but a folder with config.ocio" if needed > version else ""
    lines.append(f"  read by   {reads}{archive}")
    lines.append("  use       apply --from SPACE --to SPACE; in a program the environment variable OCIO names it")
    return lines


def _exposure(data: "ShotMetadata") -> str:
    """The exposure in words; numbers that are NaN or not above 0 are unknown."""
    aperture = data.aperture
    iso = data.iso
    seconds = exposure_time(data.exposure_s) if data.exposure_s > 0 else "time unknown"
    f_number = f"f/{aperture:.3g}" if aperture > 0 else "aperture unknown"
    return f"{seconds}, {f_number}, {f'ISO {iso:g}' if iso > 0 else 'ISO unknown'}"


def _numbers(multipliers: "np.ndarray[tuple[int, ...], np.dtype[np.float64]] | tuple[float, ...] | None") -> str:
    return "unknown" if multipliers is None else ", ".join(f"{value:.4f}" for value in multipliers)
