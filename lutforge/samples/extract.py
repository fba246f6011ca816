"""Colour samples of one shot: chart patches and flat tiles, with an account of what was left out and why."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import srgb_encode
from lutforge.samples.chart import detector_note, find_chart, sample_chart
from lutforge.samples.clipping import Extremes, clipping, one_sided, saturation_levels
from lutforge.samples.even_choice import choose_evenly
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.tiles import LEVELS, agreement, cell_size, flatness, jpeg_cells
from lutforge.shots.cells import raw_on_jpeg_cells
from lutforge.shots.read import TURNS
from lutforge.shots.shot import Shot

FEW_TILES = 100
"""A shot with fewer tiles within the first two limits may use the hard bound, and is searched for a chart."""


OUTCOMES = ("kept", "clipped", "outside the RAW", "not flat", "RAW and JPEG disagree", "colour already covered")
"""What can become of a cell of a shot."""


@dataclass(frozen=True, eq=False)
class ShotCells:
    """A shot in small, upright, a pixel a cell: 8-bit JPEG and RAW (h, w, 3), RAW balanced and encoded as in a JPEG.

    outcome: (h, w) what became of each cell, an index into OUTCOMES. picture: the whole JPEG (h, w, 3), reduced to some
    500 pixels.
    """

    jpeg: NDArray[np.uint8]
    raw: NDArray[np.uint8]
    outcome: NDArray[np.uint8]
    picture: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ShotSamples:
    """The samples of one shot and the account of its areas.

    tiles, patches: kept. clipped, rejected: areas left out, by reason. notes: what the user should know, a line each;
    file_notes: of its files, which many shots share. cells: the shot's means over a coarse grid; places: (n, 2) of the
    samples in the upright JPEG, x and y as shares of its width and height.
    """

    shot: str
    samples: SampleSet
    tiles: int
    patches: int
    clipped: dict[str, int]
    rejected: dict[str, int]
    notes: tuple[str, ...]
    cells: ShotCells | None = None
    places: Array = field(default_factory=lambda: np.zeros((0, 2)))
    file_notes: tuple[str, ...] = ()

    @property
    def kept(self) -> int:
        """All samples of the shot."""
        return len(self.samples)

    @property
    def summary(self) -> str:
        """One line for people."""
        kinds = f"{self.tiles} tiles, {self.patches} chart patches"
        kept = f"kept {self.kept} ({kinds})" if self.patches else f"kept {self.tiles} tiles"
        parts = [kept, _account("clipped", self.clipped), _account("rejected", self.rejected), *self.notes]
        return f"{self.shot}: " + "; ".join(parts)


def extract(shot: Shot) -> ShotSamples:
    """Sample a shot: flat tiles that cover its colours evenly, and where they are few the patches of a ColorChecker.

    A shot that gives nothing has an empty set, and a note that says why. Raises nothing of its own.
    """
    saturation = saturation_levels(shot.raw.pixels)
    tiles = _tiles(shot, saturation)
    few = len(tiles.samples) < FEW_TILES
    patches = _patches(shot, saturation, searched=few)
    clipped = {key: tiles.clipped.get(key, 0) + patches.clipped.get(key, 0) for key in tiles.clipped}
    notes = [*filter(None, [shot.lens_note]), *tiles.notes, *patches.notes]
    samples = concatenate([patches.samples, tiles.samples])
    if len(samples) == 0:
        notes.insert(0, _why_nothing(clipped, tiles.rejected))
    return ShotSamples(
        shot.name, samples, len(tiles.samples), len(patches.samples), clipped, tiles.rejected, tuple(notes),
        tiles.cells, np.vstack([patches.places, tiles.places]), shot.metadata.notes,
    )  # fmt: skip


def _tiles(shot: Shot, saturation: Array) -> ShotSamples:
    cell = cell_size(shot.registration)
    raw = raw_on_jpeg_cells(shot, cell)
    hot = raw.hot
    raw = raw_on_jpeg_cells(shot, cell, hot) if hot else raw
    jpeg = jpeg_cells(shot.jpeg if shot.fine is None else shot.fine, cell, hot)
    inside: Mask = np.isfinite(raw.mean[..., 0])
    clip = clipping(jpeg.extremes, Extremes(raw.minimum, raw.maximum), saturation)
    usable = inside & ~clip.any
    black, white = one_sided(jpeg.extremes, Extremes(raw.minimum, raw.maximum), saturation)
    at_an_end = inside & np.any(black | white, axis=-1)
    flat = flatness(jpeg, raw, shot.metadata.multipliers, usable, usable | at_an_end)
    agrees = agreement(jpeg, raw)
    is_flat = usable & (flat.level < len(LEVELS) - 1)
    notes = ["many hot pixels: left out by medians"] if hot else []
    if np.count_nonzero(is_flat & agrees) < FEW_TILES:
        relaxed = usable & (flat.level < len(LEVELS)) & agrees
        if np.count_nonzero(relaxed) > np.count_nonzero(is_flat & agrees):
            notes.append("few flat tiles: limits relaxed")
            is_flat = usable & (flat.level < len(LEVELS))
    codes = np.where(white, 255.0, np.where(black, 0.0, jpeg.mean))
    parts = []
    for chosen in (is_flat & agrees, at_an_end & (flat.level < len(LEVELS) - 1) & agrees):
        rows, columns = np.nonzero(chosen)
        centres = cell * (np.column_stack([columns, rows]).astype(np.float64) + 0.5)
        places = places_in_picture(shot, centres)
        kept = choose_evenly(codes[rows, columns], places, flat.level[rows, columns], flat.roughness[rows, columns])
        parts.append((rows[kept], columns[kept], centres[kept], places[kept]))
    rows, columns, centres, places = (np.concatenate(part) for part in zip(*parts, strict=True))
    rejected = {
        "outside the RAW": int(np.count_nonzero(~inside)),
        "not flat": int(np.count_nonzero(usable & ~is_flat)),
        "RAW and JPEG disagree": int(np.count_nonzero(is_flat & ~agrees)),
        "colour already covered": int(np.count_nonzero(is_flat & agrees)) - len(parts[0][0]),
    }
    outcome = np.select([~inside, clip.any, ~is_flat, ~agrees], [2, 1, 3, 4], 5).astype(np.uint8)
    outcome[rows, columns] = 0
    names = [f"tile_{x * cell:04d}_{y * cell:04d}" for y, x in zip(rows, columns, strict=True)]
    samples = _sample_set(shot, names, raw.mean[rows, columns], codes[rows, columns], places)
    small = _cells(shot, jpeg.mean, raw.mean, outcome)
    left_out = clip.counts(inside & (outcome != 0))
    return ShotSamples(
        shot.name, samples, len(samples), 0, left_out, rejected, tuple(notes), small, _upright(shot, centres)
    )


def _cells(shot: Shot, jpeg: Array, raw: Array, outcome: NDArray[np.uint8]) -> ShotCells:
    """The shot in small, of the means of its cells: JPEG codes and RAW, (h, w, 3)."""
    multipliers = np.ones(3) if shot.metadata.multipliers is None else shot.metadata.multipliers
    balanced = np.clip(np.nan_to_num(raw) * multipliers, 0.0, 1.0)
    turns = -TURNS.get(shot.raw.flip, 0)
    jpeg8, raw8 = (np.rint(values).astype(np.uint8) for values in (jpeg, 255 * srgb_encode(balanced)))
    height, width = shot.jpeg.shape[:2]
    step = max(1, round(max(height, width) / 500))
    whole = shot.jpeg[: height // step * step, : width // step * step].reshape(height // step, step, -1, step, 3)
    picture = np.rint(whole.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)
    return ShotCells(*(np.rot90(each, turns) for each in (jpeg8, raw8, outcome, picture)))


def _upright(shot: Shot, centres: Array) -> Array:
    """Places in the JPEG (n, 2), in pixels, as shares of the width and height of the upright picture."""
    places = centres / shot.jpeg.shape[1::-1]
    for _ in range(TURNS.get(shot.raw.flip, 0)):  # numpy.rot90 to the right
        places = np.column_stack([1.0 - places[:, 1], places[:, 0]])
    return np.asarray(places)


def _patches(shot: Shot, saturation: Array, searched: bool) -> ShotSamples:
    empty = np.zeros((0, 3))
    nothing = _sample_set(shot, [], empty, empty, empty[:, :2])
    missing = detector_note() if searched else None
    chart = find_chart(shot.jpeg) if searched and missing is None else None
    if chart is None:
        return ShotSamples(shot.name, nothing, 0, 0, {}, {}, (missing,) if missing else ())
    sampled = sample_chart(shot, chart, saturation)
    kept = np.flatnonzero(np.isfinite(sampled.raw).all(axis=-1) & ~sampled.clipping.any)
    names = [f"chart_{index + 1:02d}" for index in kept]
    centres: Array = chart.patches().mean(axis=1)[kept]
    samples = _sample_set(shot, names, sampled.raw[kept], sampled.codes[kept], places_in_picture(shot, centres))
    return ShotSamples(
        shot.name, samples, 0, len(kept), sampled.clipping.counts(), {}, (), places=_upright(shot, centres)
    )


def _sample_set(shot: Shot, names: list[str], raw: Array, codes: Array, places: Array) -> SampleSet:
    """The samples of a shot from RAW (n, 3), JPEG codes (n, 3) and their places in the RAW's visible area (n, 2)."""
    metadata, count = shot.metadata, len(names)
    multipliers = metadata.multipliers if metadata.multipliers is not None else np.full(3, math.nan)
    return SampleSet(
        camera=np.full(count, metadata.camera),
        style=np.full(count, metadata.style),
        white_balance=np.full(count, metadata.white_balance),
        shot=np.full(count, shot.name),
        patch=np.array(names, dtype=np.str_),
        exposure_s=np.full(count, metadata.exposure_s, dtype=np.float64),
        raw=np.array(raw, dtype=np.float64),
        srgb=codes / 255,
        wb=np.tile(np.asarray(multipliers, dtype=np.float64), (count, 1)),
        raw_camera=np.full(count, shot.raw_camera or metadata.camera),
        position=places,
        lens=np.full(count, metadata.lens),
        raw_space=np.full(count, "" if shot.development is None else shot.development.space),
        developer=np.full(count, "" if shot.development is None else shot.development.developer),
        focal_mm=np.full(count, metadata.focal_mm),
        aperture=np.full(count, metadata.aperture),
        d65_r=np.full(count, math.nan if metadata.d65 is None else metadata.d65[0]),
        d65_b=np.full(count, math.nan if metadata.d65 is None else metadata.d65[2]),
    )


def places_in_picture(shot: Shot, centres: Array) -> Array:
    """Places in the JPEG (n, 2) as places in the RAW's visible area, from its centre, half its diagonal = 1."""
    height, width, pixel_size = shot.placement.raw
    size = np.array([width, height]) * pixel_size
    places = shot.placement.registration.on_raw(centres)
    return np.clip((places - size / 2) / (np.linalg.norm(size) / 2), -1.0, 1.0)


def _account(word: str, counts: dict[str, int]) -> str:
    found = {reason: count for reason, count in counts.items() if count}
    reasons = ", ".join(f"{count} {reason}" for reason, count in found.items())
    return f"{word} {sum(found.values())}" + (f" ({reasons})" if found else "")


def _why_nothing(clipped: dict[str, int], rejected: dict[str, int]) -> str:
    reasons = {**clipped, **rejected}
    worst = max(reasons, key=lambda reason: reasons[reason])
    advice = {
        "JPEG white": "it is overexposed: expose less",
        "RAW saturated": "it is overexposed: expose less",
        "JPEG black": "it is underexposed: expose more",
        "RAW black": "it is underexposed: expose more",
        "outside the RAW": "the JPEG shows what the RAW does not: use the camera's own JPEG",
        "RAW and JPEG disagree": "the JPEG was edited or corrected: use the camera's own JPEG",
    }.get(worst, "nothing in it is flat: photograph plain surfaces or a chart, in focus or out of it")
    return f"gives no samples, {advice}"
