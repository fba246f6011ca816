"""Camera models as published by the thesis's authors (National University of Singapore): plain text folders.

A folder holds, for RAW → JPEG (`raw2jpg_*`) and back (`jpg2raw_*`), the matrix Ts and the white balances, the centres
and images of the gamut map, its coefficients, and the response f⁻¹ at 256 JPEG values. White balances have the codes
of the EXIF LightSource tag.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import path_of
from lutforge.errors import ProfileError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.response import Response
from lutforge.model.white_balance import LIGHT_SOURCES, NAMED_KELVIN, WhiteBalance

WHITE_BALANCES = {code: name for name, code in LIGHT_SOURCES.items()} | {9: "daylight", 14: "fluorescent"}
"""White balances by code: fine weather and cool white fluorescent, too, which are what is written."""
LIGHTS = {name: code for code, name in WHITE_BALANCES.items()}


@dataclass(frozen=True, eq=False)
class PublishedModel:
    """One folder: the model, its white balances, and the measured pairs that its centres and images are.

    linear: Ts Tw E (n, 3); mapped: f⁻¹(I) (n, 3), from the forward direction.
    """

    model: CameraModel
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

    maps = []
    for direction in ("raw2jpg", "jpg2raw"):
        centres, path = _read_points(folder / f"{direction}_ctrlPoints.txt"), folder / f"{direction}_coefs.txt"
        rows, count = _read_points(path), len(centres)
        if len(rows) != count + 4:
            raise ProfileError(f"{path}: expected {count} + 4 rows for {count} centres, found {len(rows)}")
        maps.append(GamutMap(centres, rows[:-4], rows[-4:]))
    linear, mapped = maps[0].centres, _read_points(folder / "raw2jpg_destPoints.txt")
    if len(mapped) != len(linear):
        raise ProfileError(f"{folder}: {len(linear)} control points but {len(mapped)} destination points")

    codes = _read_points(folder / "raw2jpg_respFcns.txt", counted=False)[:256]
    model = CameraModel(tuple(balances), matrix, Response(np.maximum.accumulate(codes, axis=0)), *maps)
    return PublishedModel(model, balances, linear, mapped)


def import_published(folders: Sequence[str | Path], camera: str = "", style: str = "standard") -> CameraProfile:
    """Read the model folders that the thesis's authors publish into a profile of one camera and style.

    Args:
        folders: those that hold raw2jpg_transform.txt.
        camera: its name; without it the name is taken from the folder above.
        style: the picture style that the folders are of.

    Returns:
        The profile, with the published responses, matrices, white balances and gamut maps.

    Raises:
        ProfileError: a folder is none of a model.
    """
    paths = [path_of(folder) for folder in (folders if isinstance(folders, Sequence) else [folders])]
    if not paths:
        raise ProfileError("no model folder given")
    models = [read_published_model(path) for path in paths]
    if not camera:  # "Nikon D40" of "nus_nikon_d40/fluorescent"
        above = paths[0].resolve().parent.name
        if not above.startswith("nus_"):
            raise ProfileError(f'{paths[0]}: the model does not name its camera; name it, such as --camera "Nikon D40"')
        words = above.removeprefix("nus_").split("_")
        camera = " ".join(word.upper() if any(c.isdigit() for c in word) else word.capitalize() for word in words)
    balances = {name: balance for model in models for name, balance in model.white_balances.items()}
    largest = max(models, key=lambda model: len(model.linear)).model
    rows = largest.matrix.sum(axis=1, keepdims=True)
    return CameraProfile(
        camera=camera,
        matrix=largest.matrix / rows,
        white_balances=balances,
        styles={style: PictureStyle(models=tuple(model.model for model in models))},
        notes=("the model was read from files that the thesis's authors publish",),
    )


def export_published(profile: CameraProfile, style: str, folder: str | Path) -> list[Path]:
    """Write the camera model of a style as the authors' text files, a folder each; return the folders.

    Centres, coefficients, matrix and white balances with their gains are written to nine digits, f⁻¹ at the 256 JPEG
    values. White balances that EXIF has no code for become 255, "other". Raises ProfileError where the files cannot
    hold the style, or two of its white balances are "other".
    """
    models = profile.styles[style].models
    gamut_maps = _writable_gamut_maps(profile, style)
    folders = [Path(folder) / (style if len(models) == 1 else f"{style}_{n}") for n in range(1, len(models) + 1)]
    for model, (forward, back), place in zip(models, gamut_maps, folders, strict=True):
        for name, text in _texts(profile, model, forward, back).items():
            with atomic_path(place / f"{name}.txt") as temporary:
                temporary.write_text(text, encoding="ascii")
    return folders


def _writable_gamut_maps(profile: CameraProfile, style: str) -> list[tuple[GamutMap, GamutMap]]:
    """The gamut maps of the models of a style, h and h⁻¹. Raises ProfileError where the files cannot hold them."""
    models = profile.styles[style].models
    if isinstance(profile.provenance, ReferenceRaw):
        raise ProfileError(
            f"{profile.camera} has no RAW: the authors' files start from a camera's own, and hold no matrix from that "
            f"of {profile.provenance.camera}; bake LUTs instead"
        )
    if not models:
        raise ProfileError(
            f"{profile.camera}, {style}: no camera model of its own RAW to write; calibrate with --preset thesis"
        )
    measured = [(model.gamut_map, model.inverse_gamut_map) for model in models]
    writable = [
        (forward, back)
        for forward, back in measured
        if isinstance(back, GamutMap) and not forward.offset and not back.offset
    ]
    if len(writable) < len(models):
        raise ProfileError(
            f"{profile.camera}, {style}: its gamut map works on a perceptual scale, which the authors' files cannot "
            "hold; calibrate with --preset thesis"
        )
    return writable


def _texts(profile: CameraProfile, model: CameraModel, forward: GamutMap, back: GamutMap) -> dict[str, str]:
    """The files of a model, of both directions, by their names without the suffix.

    Raises ProfileError where two of its white balances have one code.
    """
    # The matrix, then for each white balance its code, the matrix with its gains, and the gains.
    known = {name: profile.white_balances[name] for name in model.white_balances}
    lights = _light_codes(known)
    transform: list[Sequence[float] | Array] = [[len(known)], *model.matrix]
    for name, balance in known.items():
        transform += [[lights[name]], *(model.matrix * balance.factors), balance.factors]
    codes = np.linspace(0.0, 1.0, 256)[:, None].repeat(3, axis=1)
    response = _text([[256, 0, 0, 0], *model.response.linearize(codes)])

    texts: dict[str, str] = {}
    for direction, side, opposite in (("raw2jpg", forward, back), ("jpg2raw", back, forward)):
        images = opposite.centres if opposite.centres.shape == side.centres.shape else side(side.centres)
        rows = [*side.coefficients, *side.polynomial]
        texts |= {
            f"{direction}_transform": _text(transform),
            f"{direction}_ctrlPoints": _text([[len(side.centres)], *side.centres]),
            f"{direction}_destPoints": _text([[len(images)], *images]),
            f"{direction}_coefs": _text([[len(rows)], *rows]),
            f"{direction}_respFcns": response,
            f"{direction}_validRange": "1 254\n",
        }
    return texts


def _light_codes(white_balances: Iterable[str]) -> dict[str, int]:
    """The EXIF codes of white balances by their names. Raises ProfileError where two have one code."""
    numbered = {name: re.fullmatch(r"light source (\d{1,5})", name) for name in white_balances}
    lights = {name: LIGHTS.get(name, int(number[1]) if number else 255) for name, number in numbered.items()}
    shared_lights = [name for name, light in lights.items() if list(lights.values()).count(light) > 1]
    if shared_lights:
        names = ", ".join(shared_lights)
        raise ProfileError(f"white balances {names}: EXIF has one code for them all; export fewer")
    return lights


def _text(rows: Iterable[Sequence[float] | Array]) -> str:
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows)


def _read_transform(path: Path) -> tuple[Array, dict[str, WhiteBalance]]:
    """Ts (3, 3) and the white balances: the count, three rows, then blocks of code, Ts·Tw and the diagonal of Tw."""
    rows = _rows(path)
    count = int(rows[0][1][0]) if len(rows[0][1]) == 1 else -1
    if not 1 <= count <= 64 or len(rows) != 4 + 5 * count:
        raise ProfileError(
            f"{path}: expected a count n, 3 matrix rows and n blocks of 5 lines; found {len(rows)} lines"
        )
    for place, (number, row) in enumerate(rows):
        _require_width(path, number, row, 1 if place == 0 or place % 5 == 4 else 3)
    balances = {}
    for start in range(4, len(rows), 5):
        code, (number, (r, g, b)) = int(rows[start][1][0]), rows[start + 4]
        if min(r, g, b) <= 0:
            raise ProfileError(f"{path}, line {number}: white-balance multipliers must be positive")
        name = WHITE_BALANCES.get(code, f"light source {code}")
        balances[name] = WhiteBalance((r / g, 1.0, b / g), NAMED_KELVIN.get(name), gain=g)
    return np.array([row for _, row in rows[1:4]]), balances


def _read_points(path: Path, counted: bool = True) -> Array:
    """Points (n, 3) after a first row, which is their count where they are counted."""
    (first, head), *rows = _rows(path)
    for number, row in rows:
        _require_width(path, number, row, 3)
    if not rows or (counted and head != [len(rows)]):
        says = " ".join(f"{value:g}" for value in head)
        raise ProfileError(f"{path}, line {first}: says {says[:20]!r} points, {len(rows)} follow")
    return np.array([row for _, row in rows])


def _require_width(path: Path, number: int, row: Sequence[float], width: int) -> None:
    if len(row) != width:
        words = " ".join(f"{value:g}" for value in row)
        raise ProfileError(f'{path}, line {number}: expected {width} numbers, found "{words[:60]}"')


def _rows(path: Path) -> list[tuple[int, list[float]]]:
    """The rows of numbers with the numbers of their lines; empty lines are passed over."""
    try:
        if path.stat().st_size > 64 << 20:
            raise ProfileError(f"{path}: refused, it is far larger than any published model")
        text = path.read_text(encoding="ascii")
    except OSError as error:
        raise ProfileError(f"{path}: cannot read ({error.strerror}); is this a published model folder?") from error
    except UnicodeDecodeError as error:
        raise ProfileError(f"{path}: not a plain text file of numbers") from error
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            raise ProfileError(f'{path}, line {number}: not a row of numbers: "{line[:60]}"') from None
        if not np.all(np.isfinite(row)):
            raise ProfileError(f'{path}, line {number}: not finite: "{line[:60]}"')
        if row:
            rows.append((number, row))
    if not rows:
        raise ProfileError(f"{path}: empty")
    return rows
