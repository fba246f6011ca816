"""What a profile holds, for a report: white balances, matrix, and per style its curves and lattices."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.base import fit_base
from lutforge.calibration.lattice.node_levels import error_histogram
from lutforge.calibration.options import options_from_json
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.style_fit import fit_direction
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.report.gamut_slices import gamut_figure
from lutforge.report.lattice_figures import lattice_figure, levels_on_errors, plane_destinations
from lutforge.report.page import Block, Picture, Table
from lutforge.report.response_figure import response_figure
from lutforge.report.sheets import DIRECTIONS


def setting_tables(profile: CameraProfile) -> Iterator[Block]:
    rows = []
    for name, balance in profile.white_balances.items():
        r, _, b = balance.multipliers
        kelvin = "–" if balance.kelvin is None else f"{balance.kelvin:.0f} K"
        rows.append((name, f"{r:.4f}", "1", f"{b:.4f}", kelvin, f"{100 * balance.spread:.1f} %"))
    header = ("name", "red", "green", "blue", "temperature", "spread over shots")
    yield Table("White balances: what the RAW channels are multiplied by", header, tuple(rows))
    matrix = tuple(
        (f"linear {channel}", *(f"{value:+.4f}".replace("-", "−").replace("+", "") for value in row))
        for channel, row in zip("RGB", profile.matrix, strict=True)
    )
    yield Table("Matrix: white-balanced camera RGB → linear sRGB", ("", "camera R", "camera G", "camera B"), matrix)


def style_pictures(profile: CameraProfile, name: str, style: PictureStyle, data: StyleData | None) -> Iterator[Block]:
    what = "the tone response" if style.physical else "the grey axis of the lattice"
    yield Picture(f"response_{name}", response_figure(style), f"{name}: {what}, per channel.")
    maps = {f"{name}, rendering": model.gamut_map for model in style.physical[:1]}
    if maps:
        maps[f"{name}, linearizing"] = style.physical[0].inverse_gamut_map
        text = (
            "The gamut map at constant luminance Y in linear sRGB: arrows lead from the colour before it to the colour "
            "after; dots are control points."
        )
        yield Picture(f"gamut_map_{name}", gamut_figure(maps), text)
    for direction, (source, target) in DIRECTIONS.items():
        lattice = getattr(style, direction)
        if lattice is None:
            continue
        caption = f"{direction}: nodes lie densely where the function bends; those without samples continue the model."
        yield Picture(
            f"lattice_{direction}_{name}",
            lattice_figure(lattice, style.coverage.get(direction), source, target),
            caption,
        )
        if data is not None:
            histograms = _uniform_errors(profile, data, direction)
            caption = f"{direction}: node levels (ticks) follow the error that a uniform lattice makes."
            yield Picture(f"levels_{direction}_{name}", levels_on_errors(lattice, histograms, source), caption)
        yield Picture(
            f"planes_{direction}_{name}",
            plane_destinations(lattice, target),
            f"{direction}: where three planes of nodes go.",
        )


def _uniform_errors(profile: CameraProfile, data: StyleData, direction: str) -> tuple[Array, Array, Array]:
    """Per axis the histogram of a uniform lattice's squared errors on the samples."""
    options = replace(options_from_json(profile.options), nonuniform=False)
    base = fit_base(data.balanced, data.encoded)
    inverse = direction == "linearize"
    x, y = (data.encoded, data.balanced) if inverse else (data.balanced, data.encoded)
    lattice = fit_direction(data, options, base, inverse=inverse).lattice
    return error_histogram(x, np.sum((lattice(x) - y) ** 2, axis=1))
