"""A contact sheet of a picture under presumed white balances, for one that tells none (thesis, chapter 6)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.profile_recipe import ProfileRecipe
from lutforge.apply.source_settings import AS_SHOT, STEADY, choose_camera
from lutforge.arrays import Pixels
from lutforge.errors import ImageError, SettingsError
from lutforge.images.icc import foreign_profile, pixels_to_srgb
from lutforge.images.read import Image, read_image
from lutforge.images.write import upright, write_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range
from lutforge.settings import Kelvin, Multipliers, Selector, parse_selector
from lutforge.shots.picture_settings import read_picture_settings

GAP, LABEL = 8, 40
"""Pixels between the pictures of a sheet, and for the line above each."""


def candidates(camera: CameraProfile, style: str) -> list[Selector]:
    """Return the settings that a picture of a camera may have been made with.

    They are twelve along the range of the camera's temperatures, evenly spaced in mired, then its lamps, which lie
    beside that; without two temperatures, its settings, and for one that it changes from shot to shot eleven from the
    bluest to the reddest of the shots that it was calibrated from.
    """
    balances = camera.white_balances
    try:
        low, high = temperature_range(balances)
    except SettingsError:
        return [candidate for name in balances for candidate in _around(camera, style, name)]
    kelvins = 1e6 / np.linspace(1e6 / low, 1e6 / high, 12)
    rounded = np.clip(np.rint(kelvins / 50), np.ceil(low / 50), np.floor(high / 50)) * 50
    lamps = [name for name in balances if "fluorescent" in name]
    return [Selector(style, Kelvin(float(kelvin))) for kelvin in rounded] + [Selector(style, name) for name in lamps]


def _around(camera: CameraProfile, style: str, name: str) -> list[Selector]:
    balance = camera.white_balances[name]
    if balance.spread <= STEADY or camera.raw_camera:
        return [Selector(style, name)]
    red, _, blue = balance.multipliers
    ratios = (1 + balance.spread) ** np.linspace(-1.0, 1.0, 11)
    return [Selector(style, Multipliers((round(red * k, 3), 1.0, round(blue / k, 3)))) for k in ratios.tolist()]


def candidate_sheet(recipe: ProfileRecipe, source: Path, sheet: Path) -> tuple[str, ...]:
    """Write the sheet: the picture refinished from each presumed setting, which is named above; returns these.

    Where the recipe keeps the picture's white balance, with which all would look alike, the first one that the profile
    names is wanted instead. Raises SettingsError where the picture's camera or style cannot be told; ImageError.
    """
    settings = read_picture_settings(source)
    camera, _ = choose_camera(source, settings, recipe.cameras, recipe.source is not None)
    asked = parse_selector(recipe.source).style if recipe.source else AS_SHOT
    style = settings.style if asked == AS_SHOT else asked
    if style not in camera.styles:
        known = ", ".join(sorted(camera.styles))
        raise SettingsError(f'{source}: unknown style "{style}"; name it with --from STYLE/auto, of {known}')
    small, pictures = read_small(source, 480 * 360), []
    for given in candidates(camera, style):
        change = recipe.change(camera, given)
        if recipe.keeps_white_balance:
            first = Selector(change.wanted.style, next(iter(change.look.white_balances)))
            change = replace(change, wanted=change.look.selector(first))
        processor = recipe.chain(change).processor()
        pictures.append((str(given), apply_to_pixels(processor, small)))
    page = _page(pictures)
    write_image(sheet, page, Image(page, oiio.ImageSpec(page.shape[1], page.shape[0], 3, "uint8")))
    return tuple(name for name, _ in pictures)


def read_small(path: Path, most: int) -> Pixels:
    """Read an image upright, RGB in [0, 1], averaged down to at most so many pixels. Raises ImageError.

    A picture of 8 bits in another space than sRGB is converted, as `apply_image` does.
    """
    image = read_image(path)
    pixels = image.pixels
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ImageError(f"{path.name}: it needs red, green and blue")
    if profile := foreign_profile(image.spec):
        pixels = pixels_to_srgb(pixels, profile)
    pixels = np.clip(upright(pixels[..., :3], image.spec.get_int_attribute("Orientation", 1)), 0.0, 1.0)
    height, width = pixels.shape[:2]
    factor = int(np.ceil(np.sqrt(height * width / most)))
    if factor > 1:
        pixels = pixels[: height // factor * factor, : width // factor * factor]
        pixels = pixels.reshape(height // factor, factor, width // factor, factor, 3).mean(axis=(1, 3))
    return np.ascontiguousarray(pixels, dtype=np.float32)


def _page(pictures: Sequence[tuple[str, Pixels]]) -> Pixels:
    height, width = pictures[0][1].shape[:2]
    columns = min(4, len(pictures))
    rows = -(-len(pictures) // columns)
    cell = (height + LABEL + GAP, width + GAP)
    shape = (rows * cell[0] + GAP, columns * cell[1] + GAP, 3)
    page = oiio.ImageBuf(np.full(shape, 0.18, dtype=np.float32))
    for place, (name, picture) in enumerate(pictures):
        row, column = divmod(place, columns)
        left, top = GAP + column * cell[1], GAP + row * cell[0]
        oiio.ImageBufAlgo.paste(page, left, top + LABEL, 0, 0, oiio.ImageBuf(np.ascontiguousarray(picture)))
        oiio.ImageBufAlgo.render_text(page, left, top + LABEL - 12, name, 24, textcolor=(0.92, 0.92, 0.92))
    return np.ascontiguousarray(page.get_pixels(oiio.FLOAT), dtype=np.float32)
