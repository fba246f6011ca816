"""The page that compares two settings: one chart rendered by both, and the colour differences."""

import numpy as np
from scipy.optimize import brentq

from lutforge.colour.srgb import delta_e_2000, srgb_to_lab
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.reports.drawing import Drawing, Line, Panel, Raster
from lutforge.reports.page import Picture, Report
from lutforge.reports.tables import Table


def build_comparison(profile_a: CameraProfile, setting_a: str, profile_b: CameraProfile, setting_b: str) -> Report:
    """A page that compares two settings, STYLE/WB, of two profiles: a chart rendered by both, and their ΔE00.

    The chart is lit so that its greys are neutral; the exposure of b is such that both render 18 % grey with the same
    lightness. Raises SettingsError on an unknown setting.
    """
    import colour  # imported here: it takes a second

    # The exposure at which b renders 18 % grey as light as a.
    render_a = through_camera(profile_a, setting_a, "linear-srgb")
    grey = np.full((1, 3), 0.18)
    lightness_a = srgb_to_lab(render_a(grey))[0, 0]

    def lightness_difference(ev: float) -> float:
        render = through_camera(profile_b, setting_b, "linear-srgb", ev)
        return float(srgb_to_lab(render(grey))[0, 0] - lightness_a)

    has_root = lightness_difference(-4.0) < 0 < lightness_difference(4.0)
    ev = float(brentq(lightness_difference, -4.0, 4.0, xtol=1e-3)) if has_root else 0.0
    render_b = through_camera(profile_b, setting_b, "linear-srgb", ev)
    names = (f"{profile_a.camera} {setting_a}", f"{profile_b.camera} {setting_b}")

    # The ColorChecker Classic, 2005 measurements, by colour-science.
    checker = colour.CCS_COLOURCHECKERS["ColorChecker 2005"]
    xyz = colour.xyY_to_XYZ(np.array(list(checker.data.values())))
    chart = np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", checker.illuminant, apply_cctf_encoding=False)).clip(0.0, None)
    a = render_a(chart)
    b = render_b(chart)
    difference = delta_e_2000(a, b)
    lab_a = srgb_to_lab(a)
    lab_b = srgb_to_lab(b)
    lightness = lab_b[:, 0] - lab_a[:, 0]
    chroma = np.hypot(*lab_b[:, 1:].T) - np.hypot(*lab_a[:, 1:].T)
    patches = [name.partition(" (")[0] for name in checker.data]
    rows = []
    for n, patch in enumerate(patches):
        codes = (" ".join(f"{255 * value:.0f}" for value in np.clip(encoded[n], 0, 1)) for encoded in (a, b))
        rows.append((patch, *codes, f"{difference[n]:.1f}", f"{lightness[n]:+.1f}", f"{chroma[n]:+.1f}"))

    # Each patch is drawn as two halves, between dark lines.
    halves = np.stack([a.reshape(4, 6, 3), b.reshape(4, 6, 3)], axis=2).reshape(4, 12, 3)
    lines = [Line(np.full(2, x), np.array([0.0, 4.0]), "#191919", width=6.0) for x in range(1, 6)]
    lines += [Line(np.array([0.0, 6.0]), np.full(2, y), "#191919", width=6.0) for y in range(1, 4)]
    two_charts = Drawing(((Panel("", (Raster(halves, (6, 4)), *lines), bare=True, equal=True),),), 6.1)
    lead = (
        f"The chart's colours differ by ΔE00 {difference.mean():.1f} in the mean, most by {difference.max():.1f} "
        f"({patches[int(difference.argmax())]}).",
    )
    caption = f"Left halves: {names[0]}; right halves: {names[1]}."
    header = ("patch", names[0], names[1], "ΔE00", "ΔL*", "ΔC*")
    table = Table("JPEG codes, and the differences of the second from the first", header, rows)
    return Report(
        f"{names[0]} beside {names[1]}",
        f"the same light through both; the second at {ev:+.2f} EV, so that 18 % grey is equally light",
        lead,
        {"A chart": (Picture("chart", two_charts, caption), table)},
    )
