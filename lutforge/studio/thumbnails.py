"""A shot in small: its photograph where its file is known, and its samples' colours with the selected ones framed."""

from base64 import b64encode
from collections.abc import Mapping
from functools import lru_cache
from html import escape
from io import BytesIO
from pathlib import Path

import numpy as np

from lutforge.arrays import Mask
from lutforge.errors import LutForgeError
from lutforge.samples.sample_set import SampleSet
from lutforge.shots.discover import jpeg_beside
from lutforge.studio.plots import hex_colours

WIDTH, SIDE = 330, 12


def shot_picture(samples: SampleSet, selected: Mask, shot: str, files: Mapping[str, Path]) -> str:
    """HTML of one shot: photograph and swatches."""
    rows = np.flatnonzero(samples.shot == shot)
    most = 540
    # The selected ones are all there, however many samples the shot has.
    if len(rows) > most:
        inside = rows[selected[rows]][:most]
        others = np.setdiff1d(rows, inside)[: most - len(inside)]
        rows = np.sort(np.concatenate([inside, others]))
    columns = WIDTH // SIDE
    height = SIDE * -(-len(rows) // columns)
    swatches = []
    for place, (row, colour) in enumerate(zip(rows, hex_colours(samples.srgb[rows]), strict=True)):
        x, y = SIDE * (place % columns), SIDE * (place // columns)
        frame = " stroke='#000' stroke-width='2'" if selected[row] else ""
        swatches.append(
            f"<rect x='{x + 1}' y='{y + 1}' width='{SIDE - 2}' height='{SIDE - 2}' fill='{colour}'{frame}/>"
        )
    picture = thumbnail(files[shot]) if shot in files else ""
    image = f"<img src='{picture}' alt='shot {escape(shot, quote=True)}'>" if picture else ""
    return (
        f"<h2>shot {escape(shot)}</h2>{image}"
        f"<svg width='{WIDTH}' height='{height}' role='img' aria-label='samples of the shot'>{''.join(swatches)}</svg>"
    )


@lru_cache(maxsize=64)
def thumbnail(file: Path) -> str:
    """A small JPEG of a RAW file's camera JPEG as a data URL; "" where there is none to be read quickly."""
    import rawpy
    from PIL import Image, UnidentifiedImageError

    try:
        beside = jpeg_beside(file)
        if beside is not None:
            data = beside.read_bytes()
        else:
            with rawpy.imread(str(file)) as raw:
                data = bytes(raw.extract_thumb().data)
        with Image.open(BytesIO(data)) as picture:
            picture.draft("RGB", (WIDTH, 160))
            small = picture.convert("RGB")
        small.thumbnail((WIDTH, 160))
        buffer = BytesIO()
        small.save(buffer, format="JPEG", quality=85)
    except (OSError, ValueError, TypeError, UnidentifiedImageError, rawpy.LibRawError, LutForgeError):
        return ""
    return "data:image/jpeg;base64," + b64encode(buffer.getvalue()).decode("ascii")
