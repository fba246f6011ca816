"""Shots in small: JPEG, RAW, and what became of each tile, as data URLs; a component that shows shots as cards."""

from base64 import b64encode
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import param
from numpy.typing import NDArray
from panel.custom import JSComponent
from PIL import Image, ImageOps

from lutforge.apply.candidates import read_small
from lutforge.arrays import Array
from lutforge.images.icc import foreign_profile
from lutforge.images.read import ImageReader
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.falloff import falloff_of
from lutforge.samples.extract import OUTCOMES, ShotCells, ShotSamples
from lutforge.samples.sample_set import SampleSet

OUTCOME_COLOURS = ("#ffffff", "#e69f00", "#111111", "#8c8c8c", "#cc79a7", "#4f83e0")
"""The colour of each outcome of a tile, in the order of `OUTCOMES`."""


def picture_url(pixels: NDArray[np.uint8]) -> str:
    """A picture (h, w, 3) as a PNG data URL."""
    buffer = BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, format="PNG")
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")


def jpeg_url(file: bytes) -> str:
    """A JPEG file as a data URL."""
    return "data:image/jpeg;base64," + b64encode(file).decode("ascii")


def picture_bytes(path: Path) -> bytes:
    """A picture in sRGB as a file that browsers read: itself, or PNG of at most 8 million pixels. Raises ImageError."""
    if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
        with ImageReader(path) as image:
            as_it_is = not foreign_profile(image.spec)
        if as_it_is:
            return path.read_bytes()
    pixels, buffer = read_small(path, 8_000_000), BytesIO()
    Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


def thumbnail(picture: bytes) -> bytes:
    """A picture file as a small JPEG, upright."""
    with Image.open(BytesIO(picture)) as file:
        file.draft("RGB", (232, 156))  # a JPEG is decoded at a fraction of its size
        small = ImageOps.exif_transpose(file.convert("RGB"))
    small.thumbnail((232, 156))
    return jpeg_of(small)


def jpeg_of(image: Image.Image) -> bytes:
    """A picture as a JPEG file."""
    buffer = BytesIO()
    image.save(buffer, format="JPEG", quality=92)
    return buffer.getvalue()


def outcomes_drawn(cells: ShotCells) -> NDArray[np.uint8]:
    """The JPEG with its kept tiles as they are and the others under the colour of what became of them."""
    colours = np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in OUTCOME_COLOURS])
    mixed = 0.3 * cells.jpeg + 0.7 * colours[cells.outcome]
    return np.where(cells.outcome[..., None] == 0, cells.jpeg, mixed).astype(np.uint8)


def swatches(encoded: Array) -> NDArray[np.uint8]:
    """The colours of samples (n, 3) as a picture of squares, for a shot whose files are not there."""
    few = encoded[np.linspace(0, len(encoded) - 1, min(len(encoded), 600)).astype(np.intp)]
    columns = max(1, int(np.ceil(np.sqrt(1.5 * len(few)))))
    grid = np.full((-(-len(few) // columns) * columns, 3), 0.46)
    grid[: len(few)] = few
    codes: NDArray[np.uint8] = np.rint(255 * np.clip(grid, 0, 1)).astype(np.uint8)
    return codes.reshape(-1, columns, 3)


def pictures_of(samples: SampleSet, account: ShotSamples | None, shown: str) -> list[tuple[str, str]]:
    """Titles and pictures of a shot. shown: "JPEG and RAW" or "tiles"."""
    if account is None or account.cells is None:
        return [("samples", picture_url(swatches(samples.srgb)))]
    cells = account.cells
    if shown == "tiles":
        return [("tiles", picture_url(outcomes_drawn(cells)))]
    return [("JPEG", picture_url(cells.jpeg)), ("RAW", picture_url(cells.raw))]


def facts_of(name: str, samples: SampleSet, account: ShotSamples | None, profile: CameraProfile | None) -> list[str]:
    """What is known of a shot, a line each: settings, samples, falloff and tone."""
    time, balance = float(samples.exposure_s[0]), samples.white_balance[0]
    seconds = "" if not np.isfinite(time) else f", 1/{1 / time:.0f} s" if time < 0.4 else f", {time:g} s"
    facts = [f"{samples.style[0]}/{balance}{seconds}", f"{len(samples):,} samples"]
    if account is not None:
        facts = [facts[0], account.summary.removeprefix(f"{account.shot}: ")]
    if profile is not None:
        lens = falloff_of(
            profile.falloffs, str(samples.lens[0]), float(samples.focal_mm[0]), float(samples.aperture[0])
        )
        facts += [f"falloff: corners {lens.corner_ev:+.2f} EV"] if lens is not None else []
        facts += [f"departs from the fixed rendering: {tone.words}" for tone in profile.tones if tone.shot == name]
    return facts


class ShotGrid(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """Shots as cards, each a button that takes the shot out and in again.

    shots: name, pictures (title and data URL) and facts of each; out: the names of those that are out; legend: words
    and colours of what became of tiles, where these are shown.
    """

    shots = param.List(item_type=dict)
    out = param.List(item_type=str)
    legend = param.List(item_type=tuple)

    _stylesheets = [(Path(__file__).parent / "shot_grid.css").read_text(encoding="utf-8")]  # noqa: RUF012 - Panel's way
    _esm = (Path(__file__).parent / "shot_grid.js").read_text(encoding="utf-8")


def cards(
    samples: SampleSet, accounts: Mapping[str, ShotSamples], profile: CameraProfile | None, shown: str
) -> list[dict[str, Any]]:
    """The cards of all shots, as `ShotGrid` takes them."""
    return [
        {
            "name": name,
            "pictures": pictures_of(shot, accounts.get(name), shown),
            "facts": facts_of(name, shot, accounts.get(name), profile),
        }
        for name, shot in samples.by_shot()
    ]


LEGEND = list(zip(("kept: in its own colour", *OUTCOMES[1:]), OUTCOME_COLOURS, strict=True))
