"""Camera models as published by the thesis's authors (National University of Singapore): plain text folders.

A folder holds, for RAW → JPEG (`raw2jpg_*`) and back (`jpg2raw_*`), the matrix Ts and the white balances, the centres
and images of the gamut map, its coefficients, and the response f⁻¹ at 256 JPEG values. White balances carry the codes
of the EXIF LightSource tag.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import path_of
from lutforge.errors import ProfileError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import LIGHT_SOURCES, NAMED_KELVIN, WhiteBalance

WHITE_BALANCES = {code: name for name, code in LIGHT_SOURCES.items()} | {9: "daylight", 14: "fluorescent"}
"""White balances by code: fine weather and cool white fluorescent, too, which are what is written."""


@dataclass(frozen=True, eq=False)
class PublishedModel:
    """One folder: the model, its white balances, and the measured pairs that its centres and images are.

    linear: Ts Tw E (n, 3); mapped: f⁻¹(I) (n, 3), from the forward direction.
    """

    model: PhysicalModel
    white_balances: dict[str, WhiteBalance]
    linear: Array
    mapped: Array

    @property
    def balanced(self) -> Array:
        """The pairs' white-balanced RAW Tw E (n, 3)."""
        return self.linear @ np.linalg.inv(self.model.matrix).T

    @property
    def encoded(self) -> Array:
        """The pairs' JPEG values I (n, 3)."""
        return self.model.response.encode(self.mapped)


def read_published_model(folder: str | Path) -> PublishedModel:
    """Read one model folder. Raises ProfileError with the file (and line) that is missing or malformed."""
    folder = Path(folder)
    if not folder.is_dir():
        raise ProfileError(f"{folder}: no such folder; give the folder that holds raw2jpg_transform.txt")
    if not (folder / "raw2jpg_transform.txt").is_file():
        within = [str(file.parent) for file in sorted(folder.glob("*/raw2jpg_transform.txt"))]
        which = " ".join(within) if within else "a model's folder, which does"
        raise ProfileError(f"{folder}: holds no raw2jpg_transform.txt; give {which}")
    matrix, balances = _read_transform(folder / "raw2jpg_transform.txt")
    linear = _read_points(folder / "raw2jpg_ctrlPoints.txt")
    forward = _read_gamut_map(folder, "raw2jpg", linear)
    back = _read_gamut_map(folder, "jpg2raw", _read_points(folder / "jpg2raw_ctrlPoints.txt"))
    mapped = _read_points(folder / "raw2jpg_destPoints.txt")
    if len(mapped) != len(linear):
        raise ProfileError(f"{folder}: {len(linear)} control points but {len(mapped)} destination points")
    response = Response(np.maximum.accumulate(_numbers(folder / "raw2jpg_respFcns.txt", 1)[:256], axis=0))
    model = PhysicalModel(tuple(balances), matrix, response, forward, back)
    return PublishedModel(model, balances, linear, mapped)


def import_published(folders: Sequence[str | Path], camera: str = "", style: str = "standard") -> CameraProfile:
    """Read the model folders that the thesis's authors publish into a profile of one camera and style.

    Args:
        folders: those that hold raw2jpg_transform.txt.
        camera: its name, which else is read off the folder above.
        style: the picture style that the folders are of.

    Returns:
        The profile, with the published responses, matrices, white balances and gamut maps.

    Raises:
        ProfileError: a folder is none of a model.
    """
    folders = [path_of(each) for each in (folders if isinstance(folders, Sequence) else [folders])]
    if not folders:
        raise ProfileError("no model folder given")
    models = [read_published_model(folder) for folder in folders]
    balances = {name: balance for model in models for name, balance in model.white_balances.items()}
    largest = max(models, key=lambda model: len(model.linear)).model
    rows = largest.matrix.sum(axis=1, keepdims=True)
    return CameraProfile(
        camera=camera or _camera_name(Path(folders[0])),
        matrix=largest.matrix / rows,
        white_balances=balances,
        styles={style: PictureStyle(physical=tuple(model.model for model in models))},
        options={"source": "published model of the thesis's authors"},
    )


def _camera_name(folder: Path) -> str:
    """Read "Nikon D40" off "nus_nikon_d40/fluorescent". Raises ProfileError where nothing names the camera."""
    above = folder.resolve().parent.name
    if not above.startswith("nus_"):
        raise ProfileError(f'{folder}: the model does not name its camera; name it, such as --camera "Nikon D40"')
    words = above.removeprefix("nus_").split("_")
    return " ".join(word.upper() if any(c.isdigit() for c in word) else word.capitalize() for word in words)


def export_published(profile: CameraProfile, style: str, folder: str | Path) -> list[Path]:
    """Write the physical models of a style as the authors' text files, a folder each; return the folders.

    Centres, coefficients, matrix and white balances with their gains are written to nine digits, f⁻¹ at the 256 JPEG
    values. White balances that EXIF has no code for become 255, "other". Raises ProfileError where the files cannot
    hold the style, or two of its white balances are "other".
    """
    models = profile.styles[style].physical
    if profile.raw_camera:
        raise ProfileError(
            f"{profile.camera} has no RAW: the authors' files start from a camera's own, and hold no matrix from that "
            f"of {profile.raw_camera}; bake LUTs instead"
        )
    if not models:
        raise ProfileError(
            f"{profile.camera}, {style}: no physical model of its own RAW to write; calibrate with --model rbf"
        )
    if any(part.offset for model in models for part in (model.gamut_map, model.inverse_gamut_map)):
        raise ProfileError(
            f"{profile.camera}, {style}: its gamut map works on an even scale, which the authors' files cannot hold; "
            "calibrate with --model rbf --preset thesis"
        )
    folders = [Path(folder) / (style if len(models) == 1 else f"{style}_{n}") for n in range(1, len(models) + 1)]
    for model, place in zip(models, folders, strict=True):
        known = {name: profile.white_balances[name] for name in model.white_balances}
        codes = np.linspace(0.0, 1.0, 256)[:, None].repeat(3, axis=1)
        response = _text([[256, 0, 0, 0], *model.response.linearize(codes)])
        sides = {"raw2jpg": model.gamut_map, "jpg2raw": model.inverse_gamut_map}
        for direction, side in sides.items():
            other = next(part for name, part in sides.items() if name != direction)
            images = other.centres if other.centres.shape == side.centres.shape else side(side.centres)
            rows = [*side.coefficients, *side.polynomial]
            for name, text in {
                "transform": _transform_text(model.matrix, known),
                "ctrlPoints": _text([[len(side.centres)], *side.centres]),
                "destPoints": _text([[len(images)], *images]),
                "coefs": _text([[len(rows)], *rows]),
                "respFcns": response,
                "validRange": "1 254\n",
            }.items():
                with atomic_path(place / f"{direction}_{name}.txt") as temporary:
                    temporary.write_text(text, encoding="ascii")
    return folders


def _transform_text(matrix: Array, balances: Mapping[str, WhiteBalance]) -> str:
    codes = {name: code for code, name in WHITE_BALANCES.items()}
    numbered = {name: re.fullmatch(r"light source (\d{1,5})", name) for name in balances}
    found = {name: codes.get(name, int(number[1]) if number else 255) for name, number in numbered.items()}
    others = [name for name, code in found.items() if list(found.values()).count(code) > 1]
    if others:
        raise ProfileError(f"white balances {', '.join(others)}: EXIF has one code for them all; export fewer")
    rows: list[Sequence[float] | Array] = [[len(balances)], *matrix]
    for name, balance in balances.items():
        rows += [[found[name]], *(matrix * balance.factors), balance.factors]
    return _text(rows)


def _text(rows: Iterable[Sequence[float] | Array]) -> str:
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows)


def _read_transform(path: Path) -> tuple[Array, dict[str, WhiteBalance]]:
    """Ts (3, 3) and the white balances: the count, three rows, then blocks of code, Ts·Tw and the diagonal of Tw."""
    lines = _lines(path)
    values: list[list[float]] = [_row(path, number, line) for number, line in lines]
    count = int(values[0][0]) if values and len(values[0]) == 1 else -1
    if not 1 <= count <= 64 or len(values) != 4 + 5 * count:
        raise ProfileError(
            f"{path}: expected a count n, 3 matrix rows and n blocks of 5 lines; found {len(values)} lines"
        )
    shape = [1] + [3] * 3 + ([1] + [3] * 4) * count
    for (number, line), row, width in zip(lines, values, shape, strict=True):
        if len(row) != width:
            raise ProfileError(f'{path}, line {number}: expected {width} numbers, found "{line[:60]}"')
    balances = {}
    for block in range(count):
        start = 4 + 5 * block
        code = int(values[start][0])
        r, g, b = values[start + 4]
        if min(r, g, b) <= 0:
            raise ProfileError(f"{path}, line {lines[start + 4][0]}: white-balance multipliers must be positive")
        name = WHITE_BALANCES.get(code, f"light source {code}")
        balances[name] = WhiteBalance((r / g, 1.0, b / g), NAMED_KELVIN.get(name), gain=g)
    return np.array(values[1:4]), balances


def _read_gamut_map(folder: Path, direction: str, centres: Array) -> GamutMap:
    path = folder / f"{direction}_coefs.txt"
    rows = _read_points(path)
    if len(rows) != len(centres) + 4:
        raise ProfileError(f"{path}: expected {len(centres)} + 4 rows for {len(centres)} centres, found {len(rows)}")
    return GamutMap(centres, rows[:-4], rows[-4:])


def _read_points(path: Path) -> Array:
    """A count, then that many points."""
    lines = _lines(path)
    points = _numbers(path, 1)
    if not lines[0][1].strip().isdigit() or int(lines[0][1]) != len(points):
        raise ProfileError(f"{path}, line 1: says {lines[0][1][:20]!r} points, {len(points)} follow")
    return points


def _lines(path: Path) -> list[tuple[int, str]]:
    """The lines that are not empty, with their numbers."""
    try:
        if path.stat().st_size > 64 << 20:
            raise ProfileError(f"{path}: refused, it is far larger than any published model")
        text = path.read_text(encoding="ascii")
    except OSError as error:
        raise ProfileError(f"{path}: cannot read ({error.strerror}); is this a published model folder?") from error
    except UnicodeDecodeError as error:
        raise ProfileError(f"{path}: not a plain text file of numbers") from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise ProfileError(f"{path}: empty")
    return lines


def _row(path: Path, number: int, line: str) -> list[float]:
    try:
        row = [float(word) for word in line.split()]
    except ValueError:
        raise ProfileError(f'{path}, line {number}: not a row of numbers: "{line[:60]}"') from None
    if not np.all(np.isfinite(row)):
        raise ProfileError(f'{path}, line {number}: not finite: "{line[:60]}"')
    return row


def _numbers(path: Path, skip: int = 0) -> Array:
    """All rows after the first `skip` lines, three numbers each."""
    rows = []
    for number, line in _lines(path)[skip:]:
        row = _row(path, number, line)
        if len(row) != 3:
            raise ProfileError(f'{path}, line {number}: expected 3 numbers, found "{line[:60]}"')
        rows.append(row)
    if not rows:
        raise ProfileError(f"{path}: no rows of numbers")
    return np.array(rows)
