"""A contact sheet of a picture under presumed white balances, for one that tells none (thesis, chapter 6)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.apply.image import apply_to_pixels
from lutforge.apply.profile_recipe import ProfileRecipe
from lutforge.apply.source_settings import AS_SHOT, choose_camera
from lutforge.errors import SettingsError
from lutforge.images.read import Image, read_image
from lutforge.images.write import upright, write_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range
from lutforge.settings import Kelvin, Selector, parse_selector
from lutforge.shots.picture_settings import read_picture_settings

Pixels = NDArray[np.float32]

COUNT = 12
"""Temperatures on a sheet, evenly spaced in mired, as the eye sees them."""
COLUMNS = 4
SIDE = 480
"""Longest side of one picture on the sheet."""
LABEL = 40
"""Height of the line above each."""
GAP = 8
BACKGROUND, INK = 0.18, (0.92, 0.92, 0.92)


def candidates(camera: CameraProfile, style: str) -> list[Selector]:
    """Settings along the temperature axis of a camera, then those of its lamps beside it; without temperatures, all."""
    try:
        low, high = temperature_range(camera.white_balances)
    except SettingsError:
        return [Selector(style, name) for name in camera.white_balances]
    kelvins = 1e6 / np.linspace(1e6 / low, 1e6 / high, COUNT)
    rounded = np.clip(np.rint(kelvins / 50), np.ceil(low / 50), np.floor(high / 50)) * 50
    lamps = [name for name in camera.white_balances if "fluorescent" in name]
    return [Selector(style, Kelvin(float(kelvin))) for kelvin in rounded] + [Selector(style, name) for name in lamps]


def candidate_sheet(recipe: ProfileRecipe, source: Path, sheet: Path) -> tuple[str, ...]:
    """Write the sheet: the picture refinished from each presumed setting, which is named above; returns these.

    Raises SettingsError where the recipe keeps the white balance, so that all would look alike, or the picture's camera
    or style cannot be told; ImageError.
    """
    settings = read_picture_settings(source)
    camera, _ = choose_camera(source, settings, recipe.cameras, recipe.source is not None)
    asked = parse_selector(recipe.source).style if recipe.source else AS_SHOT
    style = settings.style if asked == AS_SHOT else asked
    if style not in camera.styles:
        known = ", ".join(sorted(camera.styles))
        raise SettingsError(f'{source}: unknown style "{style}"; name it with --from STYLE/auto, of {known}')
    if recipe.keeps_white_balance:
        raise SettingsError(
            "--candidates needs one white balance to go to, not as-shot or auto: such as --to standard/daylight"
        )
    small, look = _small(read_image(source)), recipe.look_for(camera)
    pictures = []
    for given in candidates(camera, style):
        _, processor = recipe.chain(camera, given, look, recipe.wanted(camera, given, look))
        pictures.append((str(given), apply_to_pixels(processor, small)))
    page = _page(pictures)
    write_image(sheet, page, Image(page, oiio.ImageSpec(page.shape[1], page.shape[0], 3, "uint8")))
    return tuple(name for name, _ in pictures)


def _small(image: Image) -> Pixels:
    """The picture upright, no larger than a place on the sheet."""
    pixels = upright(image.pixels[..., :3], image.spec.get_int_attribute("Orientation", 1))
    step = SIDE / max(pixels.shape[:2])
    if step >= 1:
        return pixels
    buffer = oiio.ImageBuf(np.ascontiguousarray(pixels))
    height, width = (max(1, round(length * step)) for length in pixels.shape[:2])
    resized = oiio.ImageBufAlgo.resize(buffer, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
    small = np.asarray(resized.get_pixels(oiio.FLOAT), dtype=np.float32)
    return np.ascontiguousarray(np.clip(small, 0.0, 1.0))


def _page(pictures: Sequence[tuple[str, Pixels]]) -> Pixels:
    height, width = pictures[0][1].shape[:2]
    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    cell = (height + LABEL + GAP, width + GAP)
    shape = (rows * cell[0] + GAP, columns * cell[1] + GAP, 3)
    page = oiio.ImageBuf(np.full(shape, BACKGROUND, dtype=np.float32))
    for place, (name, picture) in enumerate(pictures):
        row, column = divmod(place, columns)
        left, top = GAP + column * cell[1], GAP + row * cell[0]
        oiio.ImageBufAlgo.paste(page, left, top + LABEL, 0, 0, oiio.ImageBuf(np.ascontiguousarray(picture)))
        oiio.ImageBufAlgo.render_text(page, left, top + LABEL - 12, name, 24, textcolor=INK)
    return np.ascontiguousarray(page.get_pixels(oiio.FLOAT), dtype=np.float32)
