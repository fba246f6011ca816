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

    _stylesheets = [  # noqa: RUF012 - Panel's own way to declare it
        """
        :host { overflow: auto; color: var(--mui-palette-text-primary); font: 0.875rem/1.35 system-ui, sans-serif; }
        .legend span { display: inline-block; margin: 2px 14px 6px 8px; }
        .legend i { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.4em;
          outline: 1px solid var(--mui-palette-divider); }
        .grid p { grid-column: 1 / -1; }
        .grid { display: grid; gap: 10px; padding: 4px 8px; width: 100%; box-sizing: border-box;
          grid-template-columns: repeat(auto-fill, minmax(min(24rem, 100%), 1fr)); }
        button { all: unset; box-sizing: border-box; padding: 8px; cursor: pointer; display: block; border-radius: 4px;
          border: 2px solid var(--mui-palette-divider); background: var(--mui-palette-background-default); }
        button:focus-visible { outline: 3px solid var(--mui-palette-text-primary); outline-offset: 2px; }
        .pictures { display: flex; gap: 6px; background: #767676; height: 12rem; justify-content: center; }
        .pictures img { flex: 1 1 0; min-width: 0; height: 100%; object-fit: contain; image-rendering: pixelated; }
        .out .pictures { opacity: 0.25; }
        b { overflow-wrap: anywhere; } .state { float: right; }
        """
    ]
    _esm = """
    export function render({ model }) {
      const root = document.createElement("div");
      const legend = document.createElement("div"), grid = document.createElement("div");
      legend.className = "legend"; grid.className = "grid"; root.append(legend, grid); root.style.width = "100%";
      const words = (parent, tag, text, name) => {
        const node = document.createElement(tag);
        node.textContent = text; if (name) node.className = name;
        parent.append(node); return node;
      };
      const explain = () => {
        legend.replaceChildren();
        for (const [text, colour] of model.legend) {
          const entry = words(legend, "span", text), mark = document.createElement("i");
          mark.style.background = colour; entry.prepend(mark);
        }
      };
      const mark = () => {
        for (const card of grid.querySelectorAll("button")) {
          const out = model.out.includes(card.dataset.shot);
          card.className = out ? "out" : ""; card.setAttribute("aria-pressed", String(!out));
          card.querySelector(".state").textContent = out ? "left out" : "in";
        }
      };
      const draw = () => {
        grid.replaceChildren();
        if (!model.shots.length) {
          words(grid, "p", "No shots yet. To calibrate a camera takes five photographs or more, each as RAW with its " +
            "JPEG, inside the RAW file or beside it; without RAW, JPEGs of one scene at several exposures.");
        }
        for (const shot of model.shots) {
          const card = document.createElement("button"), row = document.createElement("div");
          card.dataset.shot = shot.name; row.className = "pictures";
          for (const [title, url] of shot.pictures) {
            const image = document.createElement("img");
            image.src = url; image.alt = `${title} of ${shot.name}`; image.title = title; row.append(image);
          }
          words(card, "span", "", "state"); words(card, "b", shot.name); card.append(row);
          for (const fact of shot.facts) words(card, "div", fact);
          card.addEventListener("click", () => {
            const name = shot.name, out = model.out.includes(name);
            model.out = out ? model.out.filter((other) => other !== name) : [...model.out, name];
          });
          grid.append(card);
        }
        mark();
      };
      model.on("shots", draw); model.on("out", mark); model.on("legend", explain);
      explain(); draw();
      return root;
    }
    """


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
