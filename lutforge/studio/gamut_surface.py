"""The gamut map as a surface in 3D: where it takes a slice of constant luminance of linear sRGB (thesis, Fig. A.11)."""

from pathlib import Path
from typing import Any

import numpy as np
import param
from panel.custom import JSComponent

from lutforge.arrays import Array
from lutforge.model.gamut_map import GamutMap
from lutforge.report.gamut_slices import LUMINANCE, centres_near
from lutforge.studio.colours_in_space import cube_edges


def slice_grid(luminance: float, rings: int = 17, points: int = 16) -> Array:
    """Cover the slice of the sRGB cube at a luminance 0 < Y < 1 with a grid (rings, n, 3) of linear colours.

    The first ring is the grey of this luminance, the last the slice's outline, closed, with `points` on each side.
    """
    first, second = cube_edges()
    low, high = first @ LUMINANCE - luminance, second @ LUMINANCE - luminance
    cut = (low < 0) != (high < 0)
    share = (low[cut] / (low[cut] - high[cut]))[:, None]
    corners = first[cut] + share * (second[cut] - first[cut])
    around = corners - luminance  # from the grey
    corners = corners[np.argsort(np.arctan2(around[:, 0] - around[:, 1], around[:, 2] - around[:, 1]))]
    along = np.arange(points)[:, None, None] / points
    sides = corners + along * (np.roll(corners, -1, axis=0) - corners)  # (points, corners, 3)
    outline = np.vstack([sides.transpose(1, 0, 2).reshape(-1, 3), corners[:1]])
    return luminance + np.linspace(0.0, 1.0, rings)[:, None, None] * (outline - luminance)


def surface_of(gamut_map: GamutMap, luminance: float, title: str) -> dict[str, Any]:
    """What `GamutSurface` draws of h at a luminance: plain lists, colours as (R, G, B), linear."""
    before = slice_grid(luminance)
    after = gamut_map(before)
    ends = np.stack(cube_edges(), axis=1)  # (12, 2, 3)
    return {
        "title": title,
        "after": np.moveaxis(after, 2, 0).round(5).tolist(),
        "change": np.linalg.norm(after - before, axis=2).round(5).tolist(),
        "outline": before[-1].T.round(5).tolist(),
        "centres": centres_near(gamut_map, luminance).T.round(5).tolist(),
        "cube": ends.tolist(),
    }


class GamutSurface(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """A surface that is turned and zoomed by mouse and keys, and saved as PNG or SVG; drawn by plotly.js with WebGL.

    surface: as of `surface_of`, or empty; missing: what stands in its place where there is none. The library is the
    copy that Panel holds, read when the first surface is drawn.
    """

    surface = param.Dict(default={})
    missing = param.String()
    library = param.String()

    _esm = (Path(__file__).parent / "gamut_surface.js").read_text(encoding="utf-8")
    _stylesheets = [(Path(__file__).parent / "gamut_surface.css").read_text(encoding="utf-8")]  # noqa: RUF012 - Panel's way

    def __init__(self, **options: Any) -> None:
        from panel.models.plotly import PlotlyPlot

        super().__init__(library=PlotlyPlot.__javascript__[0], **options)
