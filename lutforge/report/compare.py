"""Two cameras, or two styles of one, side by side: what each makes of the same light."""

import numpy as np
from scipy.optimize import brentq

from lutforge.arrays import Array
from lutforge.colour.colour_difference import delta_e_2000, srgb_to_lab
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.model.transform import Transform
from lutforge.report.drawing import Drawing, Line, Panel, Raster
from lutforge.report.page import Picture, Report, Section
from lutforge.report.tables import Table
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.scenes import still_life


def build_comparison(first: CameraProfile, one: str, second: CameraProfile, other: str) -> Report:
    """A page about two settings, STYLE/WB, of two profiles: a chart and a picture through both, and their ΔE00.

    Light is that of neutral white balance; the second is exposed so that both show 18 % grey equally light. Raises
    SettingsError on an unknown setting.
    """
    render = through_camera(first, one, "linear-srgb")
    ev = _level_exposure(render, second, other)
    beside = through_camera(second, other, "linear-srgb", ev)
    names = tuple(f"{profile.camera} {setting}" for profile, setting in ((first, one), (second, other)))
    patches, chart = _chart()
    a, b = render(chart), beside(chart)
    difference, (lab_a, lab_b) = delta_e_2000(a, b), (srgb_to_lab(a), srgb_to_lab(b))
    lightness = lab_b[:, 0] - lab_a[:, 0]
    chroma = np.hypot(*lab_b[:, 1:].T) - np.hypot(*lab_a[:, 1:].T)
    rows = tuple(
        (patch, _codes(a[n]), _codes(b[n]), f"{difference[n]:.1f}", f"{lightness[n]:+.1f}", f"{chroma[n]:+.1f}")
        for n, patch in enumerate(patches)
    )
    scene = _scene()
    pictures = render(scene), beside(scene)
    apart = delta_e_2000(*pictures)
    lead = (
        f"The chart's colours differ by ΔE00 {difference.mean():.1f} in the mean, most by {difference.max():.1f} "
        f"({patches[int(difference.argmax())]}); the picture's by {apart.mean():.1f}.",
    )
    caption = f"Left halves: {names[0]}; right halves: {names[1]}."
    seen = f"Left: {names[0]}; middle: {names[1]}; right: ΔE00, {apart.max():.0f} at the most."
    header = ("patch", names[0], names[1], "ΔE00", "ΔL*", "ΔC*")
    table = Table("JPEG codes, and the differences of the second from the first", header, rows)
    return Report(
        f"{names[0]} beside {names[1]}",
        f"the same light through both; the second at {ev:+.2f} EV, so that 18 % grey is equally light",
        lead,
        (
            Section("A chart", (Picture("chart", _chart_figure(a, b), caption), table)),
            Section("A picture", (Picture("picture", _picture_figure(*pictures, apart), seen),)),
        ),
    )


def _level_exposure(render: Transform, camera: CameraProfile, setting: str) -> float:
    """The exposure in stops at which a camera shows 18 % grey as light as a rendering does; 0 where there is none."""
    grey = np.full((1, 3), 0.18)
    wanted = srgb_to_lab(render(grey))[0, 0]

    def apart(ev: float) -> float:
        return float(srgb_to_lab(through_camera(camera, setting, "linear-srgb", ev)(grey))[0, 0] - wanted)

    return float(brentq(apart, -4.0, 4.0, xtol=1e-3)) if apart(-4.0) < 0 < apart(4.0) else 0.0


def _chart() -> tuple[list[str], Array]:
    """Names and linear sRGB (24, 3) of the ColorChecker Classic's patches, 2005 measurements, by colour-science."""
    import colour  # imported here: it takes a second

    chart = colour.CCS_COLOURCHECKERS["ColorChecker 2005"]
    xyz = colour.xyY_to_XYZ(np.array(list(chart.data.values())))
    linear = np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", chart.illuminant, apply_cctf_encoding=False), dtype=np.float64)
    return [name.partition(" (")[0] for name in chart.data], linear.clip(0.0, None)


def _scene() -> Array:
    """Linear sRGB (h, w, 3) of a still life."""
    camera = nikon_d5100()
    raw = still_life(300, 450).irradiance(camera, "daylight")
    return np.clip(raw * camera.multipliers("daylight") @ camera.matrix.T, 0.0, None)


def _codes(encoded: Array) -> str:
    return " ".join(f"{255 * value:.0f}" for value in np.clip(encoded, 0, 1))


def _chart_figure(a: Array, b: Array) -> Drawing:
    """Draw a patch of the chart as two halves, within dark lines."""
    halves = np.stack([a.reshape(4, 6, 3), b.reshape(4, 6, 3)], axis=2).reshape(4, 12, 3)
    dark = "#191919"
    lines = [Line(np.full(2, x), np.array([0.0, 4.0]), dark, width=6.0) for x in range(1, 6)]
    lines += [Line(np.array([0.0, 6.0]), np.full(2, y), dark, width=6.0) for y in range(1, 4)]
    return Drawing(((Panel("", (Raster(halves, (6, 4)), *lines), bare=True, equal=True),),), 6.1)


def _picture_figure(a: Array, b: Array, apart: Array) -> Drawing:
    """Draw a picture through both, and how far they are apart."""
    scale = (0.0, max(float(apart.max()), 1.0))
    panels = [Panel("", (Raster(picture),), bare=True, equal=True) for picture in (a, b)]
    panels.append(Panel("", (Raster(apart),), bare=True, equal=True, scale=scale, scale_name="ΔE00"))
    return Drawing((tuple(panels),), 3.2, 13.0)
