"""A contact sheet of a picture under presumed white balances, for one that tells none (thesis, chapter 6)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.profile_recipe import AS_SHOT, STEADY, ProfileRecipe, choose_camera
from lutforge.arrays import Pixels
from lutforge.errors import ImageError, SettingsError
from lutforge.images.icc import foreign_profile, pixels_to_srgb
from lutforge.images.read import Image, read_image
from lutforge.images.write import upright, write_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range
from lutforge.settings import Kelvin, Multipliers, Selector
from lutforge.shots.metadata import read_picture_settings

GAP, LABEL = 8, 40
"""Pixels between the pictures of a sheet, and for the line above each."""


def candidates(camera: CameraProfile, style: str) -> list[Selector]:
    """Return the settings that a picture of a camera may have been made with.

    They are twelve along the range of the camera's temperatures, evenly spaced in mired, then its lamps, which lie
    beside that; without two temperatures, its settings, and for one that it changes from shot to shot eleven from the
    bluest to the reddest of the shots that it was calibrated from.
    """
    balances = camera.white_balances
    presumed: list[Selector] = []
    try:
        low, high = temperature_range(balances)
    except SettingsError:
        for name, balance in balances.items():
            if balance.spread <= STEADY or camera.raw_camera:
                presumed.append(Selector(style, name))
                continue
            red, _, blue = balance.multipliers
            ratios = ((1 + balance.spread) ** np.linspace(-1.0, 1.0, 11)).tolist()
            presumed += [Selector(style, Multipliers((round(red * k, 3), 1.0, round(blue / k, 3)))) for k in ratios]
        return presumed
    kelvins = 1e6 / np.linspace(1e6 / low, 1e6 / high, 12)
    rounded = np.clip(np.rint(kelvins / 50), np.ceil(low / 50), np.floor(high / 50)) * 50
    lamps = [name for name in balances if "fluorescent" in name]
    return [Selector(style, Kelvin(float(kelvin))) for kelvin in rounded] + [Selector(style, name) for name in lamps]


def candidate_sheet(recipe: ProfileRecipe, source: Path, sheet: Path) -> tuple[str, ...]:
    """Write the sheet: the picture refinished from each presumed setting, which is named above; returns these.

    Where the recipe keeps the picture's white balance, with which all would look alike, the first one that the profile
    names is wanted instead. Raises SettingsError where the picture's camera or style cannot be told; ImageError.
    """
    settings = read_picture_settings(source)
    camera, _ = choose_camera(source, settings, recipe.cameras, recipe.source is not None)
    style = settings.style if recipe.asked.style == AS_SHOT else recipe.asked.style
    if style not in camera.styles:
        known = ", ".join(sorted(camera.styles))
        raise SettingsError(f'{source}: unknown style "{style}"; name it with --from STYLE/auto, of {known}')
    small, presumed = read_small(source, 480 * 360), candidates(camera, style)
    height, width = small.shape[:2]
    columns = min(4, len(presumed))
    rows = -(-len(presumed) // columns)
    cell = (height + LABEL + GAP, width + GAP)
    page = oiio.ImageBuf(np.full((rows * cell[0] + GAP, columns * cell[1] + GAP, 3), 0.18, dtype=np.float32))
    for place, given in enumerate(presumed):
        change = recipe.change(camera, given)
        if recipe.shift is not None:
            first = Selector(change.wanted.style, next(iter(change.look.white_balances)))
            change = replace(change, wanted=change.look.selector(first))
        picture = apply_to_pixels(recipe.baked_grades.refinish(change).processor(), small)
        row, column = divmod(place, columns)
        left, top = GAP + column * cell[1], GAP + row * cell[0]
        oiio.ImageBufAlgo.paste(page, left, top + LABEL, 0, 0, oiio.ImageBuf(np.ascontiguousarray(picture)))
        colour = (0.92, 0.92, 0.92)
        oiio.ImageBufAlgo.render_text(page, left, top + LABEL - 12, str(given), 24, textcolor=colour)
    pixels = np.ascontiguousarray(page.get_pixels(oiio.FLOAT), dtype=np.float32)
    write_image(sheet, pixels, Image(pixels, oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8")))
    return tuple(map(str, presumed))


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
