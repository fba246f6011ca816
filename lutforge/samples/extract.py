"""Colour samples of one shot: chart patches and flat tiles, and the numbers of areas that were left out, by reason."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Codes, Mask, Single
from lutforge.colour.srgb import srgb_encode
from lutforge.images.orientation import upright, upright_places
from lutforge.samples.chart import ChartKind
from lutforge.samples.chart_search import detector_note, find_chart, sample_chart
from lutforge.samples.clipping import censored, clipping
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.tiles import FLATNESS_LIMITS, agreement, cell_size, choose_evenly, flatness
from lutforge.shots.read import Shot

SMALL_PICTURE_SIDE = 500
"""Pixels of the longer side of a shot's small pictures, about."""

FEW_TILES = 100
"""A shot with fewer tiles within the first two of FLATNESS_LIMITS may use the third, and is searched for a chart."""


ADVICE_BY_REASON = {
    "JPEG white": "it is overexposed: expose less",
    "RAW saturated": "it is overexposed: expose less",
    "JPEG black": "it is underexposed: expose more",
    "RAW black": "it is underexposed: expose more",
    "outside the RAW": "the JPEG shows what the RAW does not: use the camera's own JPEG",
    "RAW and JPEG disagree": "the JPEG was edited or corrected: use the camera's own JPEG",
}
"""Advice on a shot without samples, by the reason for which most of it was left out."""


@dataclass(frozen=True, eq=False)
class Thumbnails:
    """Small pictures of a shot, upright, (h, w, 3) of 8 bits: the white-balanced RAW, encoded, and the JPEG."""

    raw: NDArray[np.uint8]
    picture: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ShotSamples:
    """The samples of one shot, and the numbers of its areas.

    tiles, patches: how many of the samples are such. clipped, rejected: areas left out, by reason. notes: what the user
    should know, a line each; file_notes: of its files, which many shots share. cells: small pictures of the shot;
    places: (n, 2) of the samples in the upright JPEG, x and y as shares of its width and height. tile_cells: (tiles, 2)
    row and column of each tile in the grid of cells; tiles are the last of the samples.
    """

    shot: str
    samples: SampleSet
    tiles: int
    patches: int
    clipped: dict[str, int]
    rejected: dict[str, int]
    notes: tuple[str, ...]
    cells: Thumbnails | None = None
    places: Array = field(default_factory=lambda: np.zeros((0, 2)))
    file_notes: tuple[str, ...] = ()
    tile_cells: NDArray[np.intp] = field(default_factory=lambda: np.zeros((0, 2), dtype=np.intp))

    @property
    def kept(self) -> int:
        """The number of all samples of the shot."""
        return len(self.samples)

    @property
    def summary(self) -> str:
        """One line for people."""
        kinds = f"{self.tiles} tiles, {self.patches} chart patches"
        parts = [f"kept {self.kept} ({kinds})" if self.patches else f"kept {self.tiles} tiles"]
        for word, counts in (("clipped", self.clipped), ("rejected", self.rejected)):
            reasons = ", ".join(f"{count} {reason}" for reason, count in counts.items() if count)
            parts.append(f"{word} {sum(counts.values())}" + (f" ({reasons})" if reasons else ""))
        return f"{self.shot}: " + "; ".join([*parts, *self.notes])


def extract(shot: Shot, kind: ChartKind | None = None) -> ShotSamples:
    """Sample a shot: flat tiles that cover its colours evenly, and a chart, of `kind` or where tiles are few."""
    tiles = _tiles(shot)
    notes = [*filter(None, [shot.lens_note]), *tiles.notes]
    clipped = dict(tiles.clipped)
    patches = None
    if kind is not None or len(tiles.samples) < FEW_TILES:
        missing = detector_note()
        chart = find_chart(shot.jpeg, kind) if missing is None else None
        notes += [missing] if missing else []
        if chart is None and kind is not None and missing is None:
            notes.append(f"no {kind.name} was found in it")
        if chart is not None:
            jpeg, raw = sample_chart(shot, chart)
            clips = clipping(jpeg, raw)
            clipped = {reason: clipped[reason] + int(np.count_nonzero(mask)) for reason, mask in clips.items()}
            is_clipped = np.any(list(clips.values()), axis=0)
            rows = np.flatnonzero(np.isfinite(jpeg.mean + raw.mean).all(axis=-1) & ~is_clipped)
            names = [f"chart_{index + 1:0{len(str(len(jpeg.mean)))}d}" for index in rows]
            patches = _sample_set(shot, names, raw.mean[rows], jpeg.mean[rows], chart.patches().mean(axis=1)[rows])

    samples, places = tiles.samples, tiles.places
    if patches is not None:
        samples = concatenate([patches[0], samples])
        places = np.vstack([patches[1], places])
    if len(samples) == 0:
        counts = {**clipped, **tiles.rejected}
        advice = ADVICE_BY_REASON.get(
            max(counts, key=lambda reason: counts[reason]),
            "nothing in it is flat: photograph plain surfaces or a chart, in focus or out of it",
        )
        notes.insert(0, f"gives no samples, {advice}")
    return replace(
        tiles, samples=samples, patches=len(samples) - tiles.tiles, clipped=clipped, notes=tuple(notes), places=places
    )


def _tiles(shot: Shot) -> ShotSamples:
    """The flat tiles of a shot, and the number of its other cells by the reason for which they are left out."""
    cell = cell_size(shot.registration)
    raw = shot.raw_cells(cell)
    jpeg = shot.jpeg_cells(cell)

    # Usable cells lie within the RAW and are not clipped. Some clipped cells are censored observations: a channel is
    # black, or white, all over the cell.
    inside: Mask = np.isfinite(raw.mean[..., 0])
    clips = clipping(jpeg, raw)
    is_clipped = np.any(list(clips.values()), axis=0)
    usable = inside & ~is_clipped
    black, white = censored(jpeg, raw)
    at_an_end = inside & np.any(black | white, axis=-1)

    # Flat cells in which RAW and JPEG vary together. The limits of flatness are relaxed where these are few.
    level, roughness = flatness(jpeg, raw, cell, shot.metadata.multipliers, usable, usable | at_an_end)
    agrees = agreement(jpeg, raw)
    is_flat = usable & (level < len(FLATNESS_LIMITS) - 1)
    notes = []
    if np.count_nonzero(is_flat & agrees) < FEW_TILES:
        relaxed = usable & (level < len(FLATNESS_LIMITS)) & agrees
        if np.count_nonzero(relaxed) > np.count_nonzero(is_flat & agrees):
            notes.append("few flat tiles: limits relaxed")
            is_flat = usable & (level < len(FLATNESS_LIMITS))

    # Tiles that cover the colours evenly, unclipped ones and censored ones each by themselves.
    codes = np.where(white, 255.0, np.where(black, 0.0, jpeg.mean))
    parts = []
    for candidates in (is_flat & agrees, at_an_end & (level < len(FLATNESS_LIMITS) - 1) & agrees):
        rows, columns = np.nonzero(candidates)
        places = places_in_picture(shot, cell * (np.column_stack([columns, rows]).astype(np.float64) + 0.5))
        chosen = choose_evenly(codes[rows, columns], places, level[rows, columns], roughness[rows, columns])
        parts.append((rows[chosen], columns[chosen]))
    rows, columns = (np.concatenate(part) for part in zip(*parts, strict=True))

    rejected = {
        "outside the RAW": int(np.count_nonzero(~inside)),
        "not flat": int(np.count_nonzero(usable & ~is_flat)),
        "RAW and JPEG disagree": int(np.count_nonzero(is_flat & ~agrees)),
        "colour already covered": int(np.count_nonzero(is_flat & agrees)) - len(parts[0][0]),
    }
    counted = inside.copy()
    counted[rows, columns] = False

    names = [f"tile_{x * cell:04d}_{y * cell:04d}" for y, x in zip(rows, columns, strict=True)]
    centres = cell * (np.column_stack([columns, rows]).astype(np.float64) + 0.5)
    samples, places = _sample_set(shot, names, raw.mean[rows, columns], codes[rows, columns], centres)

    clipped = {reason: int(np.count_nonzero(mask & counted)) for reason, mask in clips.items()}
    return ShotSamples(
        shot.name, samples, len(samples), 0, clipped, rejected, tuple(notes), _thumbnails(shot), places,
        shot.metadata.notes, np.column_stack([rows, columns]),
    )  # fmt: skip


def _thumbnails(shot: Shot) -> Thumbnails:
    """Small pictures of a shot, from its RAW and from its JPEG."""
    multipliers = np.ones(3) if shot.metadata.multipliers is None else shot.metadata.multipliers
    balanced = np.clip(_reduced(shot.raw.pixels) * multipliers, 0.0, 1.0)
    raw8 = np.rint(255 * srgb_encode(balanced)).astype(np.uint8)
    picture = np.rint(_reduced(shot.jpeg)).astype(np.uint8)
    return Thumbnails(upright(raw8, shot.raw.orientation), upright(picture, shot.raw.orientation))


def _reduced(pixels: Single | Codes) -> Single:
    """Area means of a picture (h, w, 3), the longer side of about SMALL_PICTURE_SIDE pixels, or of its own if fewer."""
    height, width = pixels.shape[:2]
    step = max(1, round(max(height, width) / SMALL_PICTURE_SIDE))
    blocks = pixels[: height // step * step, : width // step * step].reshape(height // step, step, -1, step, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float32))


def _sample_set(shot: Shot, names: list[str], raw: Array, codes: Array, centres: Array) -> tuple[SampleSet, Array]:
    """Samples of RAW (n, 3) and codes (n, 3) at places (n, 2) of the JPEG, and these as shares of it, upright."""
    metadata = shot.metadata
    count = len(names)
    multipliers = np.full(3, math.nan) if metadata.multipliers is None else metadata.multipliers
    d65 = np.full(3, math.nan) if metadata.d65 is None else metadata.d65
    of_shot = {
        "camera": metadata.camera,
        "style": metadata.style,
        "white_balance": metadata.white_balance,
        "shot": shot.name,
        "exposure_s": float(metadata.exposure_s),
        "raw_camera": shot.raw_camera or metadata.camera,
        "lens": metadata.lens,
        "raw_space": "" if shot.development is None else shot.development.space,
        "developer": "" if shot.development is None else shot.development.developer,
        "dng_camera": metadata.dng_camera,
        "focal_mm": metadata.focal_mm,
        "aperture": metadata.aperture,
        "d65_r": d65[0],
        "d65_b": d65[2],
    }
    samples = SampleSet(
        **{name: np.full(count, value) for name, value in of_shot.items()},
        patch=np.array(names, dtype=np.str_),
        raw=np.array(raw, dtype=np.float64),
        srgb=codes / 255,
        wb=np.tile(np.asarray(multipliers, dtype=np.float64), (count, 1)),
        position=places_in_picture(shot, centres),
        from_xyz=np.tile(np.full(9, math.nan) if metadata.from_xyz is None else metadata.from_xyz.ravel(), (count, 1)),
    )
    return samples, upright_places(centres / shot.jpeg.shape[1::-1], shot.raw.orientation)


def places_in_picture(shot: Shot, centres: Array) -> Array:
    """Places in the JPEG (n, 2) as places in the RAW's visible area, from its centre, half its diagonal = 1."""
    height, width, pixel_size = shot.placement.raw
    size = np.array([width, height]) * pixel_size
    places = shot.placement.registration.on_raw(centres)
    return np.clip((places - size / 2) / (np.linalg.norm(size) / 2), -1.0, 1.0)
