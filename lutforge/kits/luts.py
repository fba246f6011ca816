"""The LUTs of kits: a look from one space to another, as exact as its format allows, described and measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lutforge.arrays import ColourFunction
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.kits.kit import Look
from lutforge.kits.measure import error_of_lut
from lutforge.luts.bake import bake_to
from lutforge.luts.description import description
from lutforge.luts.input_and_output import ENCODED, InputAndOutput, input_and_output_of
from lutforge.luts.ops import Curve, Matrix
from lutforge.luts.sequence import Lut
from lutforge.luts.target import Target, target_of
from lutforge.luts.verification import FileError
from lutforge.model.lattice import SHORT_SHAPER_SIZE


def write_lut(look: Look, path: Path, source: str, target: str, size: int | None = None, place: str = "") -> FileError:
    """Write the look from one space to another, and measure the file. place: where its program takes the file."""
    jpeg = look.seen_from(source)
    if path.suffix == ".clf":
        # The operations to the JPEG, then its decoding: one cube of both would clip scene-linear inputs.
        lut = bake_to(jpeg, Target(size=size))
        even = np.repeat(np.linspace(0.0, 1.0, SHORT_SHAPER_SIZE)[:, None], 3, axis=1)
        decoding = Curve(rgb_space("srgb").linearize(even))
        lut = Lut((*lut.ops, decoding, Matrix(matrix_between("linear-srgb", rgb_space(target).name))))
    else:
        lut = bake_to(look.between(source, target), target_of(path, size=size))
    output = ENCODED if target == "srgb" else input_and_output_of("render", target).input
    described(look, lut, InputAndOutput(input_and_output_of("render", source).input, output), place).write(path)
    return error_of_lut(path, jpeg, source, target, lut.interpolation)


def described(look: Look, lut: Lut, stated: InputAndOutput, place: str = "") -> Lut:
    """Return a LUT with the look's title, and comments that describe it."""
    return replace(lut, title=look.title, comments=description(stated, place, look.details))


def baked(function: ColourFunction, path: Path, size: int) -> Lut:
    """Bake a function from and to encoded sRGB to the form of a file."""
    return bake_to(function, target_of(path, size=size))
