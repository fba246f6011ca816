"""Maps: slices of the gamut map, where a plane of the lattice goes, its node levels, what the samples cover."""

from typing import Any

import panel as pn
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, Range1d

from lutforge.evaluation.next_shots import colour_gaps
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import PictureStyle
from lutforge.report.gamut_slices import gamut_slice
from lutforge.report.lattice_figures import error_density, nodes_with_samples, plane_net
from lutforge.studio.elements import CHANNELS, FILL, LINE, NOTHING, extent, frame, offer, plot, select, slider, text
from lutforge.studio.gamut_surface import GamutSurface, surface_of
from lutforge.studio.session import Session

PALETTE = "Cividis256"
DIRECTIONS = {"RAW → JPEG": "render", "JPEG → RAW": "linearize"}
MISSING = "no gamut map: compute the model “Gamut map”"
NARROW: dict[str, Any] = {"sizing_mode": "fixed", "width": 230}


class _Slice:
    """One style's gamut map at one luminance."""

    def __init__(self) -> None:
        self.mapper = LinearColorMapper(palette=PALETTE, low=0.0, high=0.1)
        self.figure = plot("", x_axis_label="R − Y", y_axis_label="B − Y")
        frame(self.figure, (-0.8, 0.9), (-0.8, 0.95))
        self.arrows = ColumnDataSource({name: [] for name in ("x0", "y0", "x1", "y1", "change")})
        self.controls = ColumnDataSource({"x": [], "y": []})
        colour = {"field": "change", "transform": self.mapper}
        self.figure.segment("x0", "y0", "x1", "y1", source=self.arrows, color=colour, line_width=1.8)
        self.figure.scatter("x1", "y1", source=self.arrows, color=colour, size=3)
        self.figure.scatter("x", "y", source=self.controls, color="#e0503c", size=3, legend_label="control points")
        self.figure.legend.update(location="bottom_left", padding=2, margin=4)
        self.figure.add_layout(ColorBar(color_mapper=self.mapper, width=8), "right")

    def show(self, title: str, one: Any) -> None:
        self.figure.title.text = title
        if one is None:
            self.arrows.data = {name: [] for name in ("x0", "y0", "x1", "y1", "change")}
            self.controls.data = {"x": [], "y": []}
            return
        self.mapper.high = max(0.02, float(one.change.max(initial=0.0)))
        self.arrows.data = {
            "x0": one.before[:, 0], "y0": one.before[:, 1], "x1": one.after[:, 0], "y1": one.after[:, 1],
            "change": one.change,
        }  # fmt: skip
        self.controls.data = {"x": one.control_points[:, 0], "y": one.control_points[:, 1]}


class GamutView:
    """Slices of the gamut map of constant luminance: arrows, one a style, or the surface of one in 3D."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.direction = select("Direction", DIRECTIONS, **NARROW)
        self.luminance = slider("Luminance Y of the slices", 0.25, 0.02, 0.9, **NARROW)
        self.drawn = select("Drawn as", ["arrows", "surface in 3D"], **NARROW)
        self.style = select("Style", NOTHING, visible=False, **NARROW)
        session.watch(self.refresh, self.direction, self.luminance, self.drawn, self.style)
        self.slices = [_Slice() for _ in range(3)]
        self.figures = pn.Row(*(one.figure for one in self.slices), **FILL)
        self.surface = GamutSurface(missing=MISSING, **FILL)
        controls = pn.Row(self.direction, self.luminance, self.drawn, self.style)
        self.layout = pn.Column(controls, self.figures, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's profile."""
        profile, direction = _mapped_profile(self.session), self.direction.value
        styles = {} if profile is None else profile.styles
        maps = {name: _map_of(style, direction) for name, style in styles.items()}
        shown = [(name, one) for name, one in maps.items() if one is not None]
        solid = self.drawn.value != "arrows"
        self.style.visible, self.layout[1] = solid, self.surface if solid else self.figures
        if solid:
            self._draw_surface(dict(shown))
            return
        for place, drawing in enumerate(self.slices):
            drawing.figure.visible = place < max(1, len(shown))
            if place < len(shown):
                name, one = shown[place]
                drawing.show(f"{name}, Y = {self.luminance.value:.2f}", gamut_slice(one, self.luminance.value))
            else:
                drawing.show("" if shown else MISSING, None)

    def _draw_surface(self, maps: dict[str, GamutMap]) -> None:
        offer(self.style, maps)
        name, level = self.style.value, self.luminance.value
        title = f"{name}, Y = {level:.2f}: where the gamut map takes this slice"
        self.surface.surface = surface_of(maps[name], level, title) if maps else {}


class LatticeView:
    """Plots of a lattice: where a plane is taken, its node levels over the error, and the samples' coverage."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.direction = select("Direction", DIRECTIONS, **NARROW)
        self.style = select("Style", NOTHING, **NARROW)
        self.channel = select("Plane of", {"Red": 0, "Green": 1, "Blue": 2}, value=2, **NARROW)
        self.level = slider("at its level", 0.4, 0.0, 1.0, **NARROW)
        session.watch(self._draw, self.level, self.direction, self.style, self.channel)
        self.plane = plot("")
        self.net = [ColumnDataSource({"xs": [], "ys": []}) for _ in range(2)]
        self.net_lines = [self.plane.multi_line("xs", "ys", source=net, line_width=0.9, alpha=0.8) for net in self.net]
        self.levels = plot("", y_range=Range1d(-0.25, 1.05), x_axis_label="input value")
        self.levels.yaxis.visible = False
        self.error = ColumnDataSource({"x": [], "y": []})
        self.levels.varea("x", 0, "y", source=self.error, fill_color="#4f83e0", fill_alpha=0.5)
        self.ticks = ColumnDataSource({"x": []})
        self.levels.segment("x", -0.2, "x", -0.03, source=self.ticks, color=LINE)
        self.coverage = plot("", x_axis_label="red node, share", y_axis_label="green node, share")
        self.seen = ColumnDataSource({"image": []})
        self.seen_mapper = LinearColorMapper(palette=PALETTE, low=0.0, high=1.0)
        self.coverage.image(image="image", x=0, y=0, dw=1, dh=1, source=self.seen, color_mapper=self.seen_mapper)
        self.gaps = text()
        self.layout = pn.Column(
            pn.Row(self.direction, self.style, self.channel, self.level), self.gaps,
            pn.Row(self.plane, self.levels, self.coverage, **FILL), **FILL,
        )  # fmt: skip

    def refresh(self) -> None:
        """Everything, from the session's profile."""
        if not self.session.has_profile:
            self.gaps.object = "<p>Compute a model, or open a profile.</p>"
            return
        profile = self.session.profile
        offer(self.style, profile.styles)
        if self.session.history is not None:
            workspace = self.session.workspace
            gaps = colour_gaps(workspace.samples.srgb[workspace.fitting_rows("lattice")])
            names = "; ".join(f"{gap.colour} ({gap.unknown:.0%} unseen)" for gap in gaps)
            self.gaps.object = (
                f"<p>Colours to shoot next: {names or 'none, the samples come near most real colours'}.</p>"
            )
        self._draw()

    def _draw(self) -> None:
        if self.session.has_profile and self.style.value in self.session.profile.styles:
            style = self.session.profile.styles[self.style.value]
            self._draw_lattice(style, style.lattices.get(self.direction.value))

    def _draw_lattice(self, style: PictureStyle, lattice: Lattice | None) -> None:
        if lattice is None:
            self.plane.title.text = "this model has no lattice: compute one"
            self.levels.title.text = self.coverage.title.text = ""
            for net in self.net:
                net.data = {"xs": [], "ys": []}
            self.ticks.data, self.error.data, self.seen.data = {"x": []}, {"x": [], "y": []}, {"image": []}
            return
        channel = int(self.channel.value)
        self._draw_plane(lattice, channel)
        self.ticks.data = {"x": lattice.levels[channel]}
        name = CHANNELS[channel][0]
        fitted = None if self.session.history is None else self.session.workspace.fitted
        histogram = None
        if fitted is not None:
            histogram = fitted.uniform_error.get((self.style.value, self.direction.value))
        if histogram is None:
            self.levels.title.text = f"Node levels, {name}"
            self.error.data = {"x": [], "y": []}
        else:
            self.levels.title.text = f"Node levels, {name}, over the error"
            self.error.data = dict(zip("xy", error_density(histogram[channel]), strict=True))
        covered = style.coverage.get(self.direction.value)
        if covered is None:
            self.coverage.title.text, self.seen.data = "no coverage in this profile", {"image": []}
            return
        seen = nodes_with_samples(covered)
        self.coverage.title.text = f"Nodes with samples, {float((covered > 0).mean()):.0%} of all"
        self.seen_mapper.high = max(float(seen.max()), 1e-6)
        self.seen.data = {"image": [seen]}

    def _draw_plane(self, lattice: Lattice, channel: int) -> None:
        level, net = plane_net(lattice, channel, self.level.value)
        axes = (self.plane.yaxis, self.plane.xaxis)
        for source, drawn, axis, (along, lines) in zip(self.net, self.net_lines, axes, net, strict=True):
            source.data = {"xs": [one[:, 0] for one in lines], "ys": [one[:, 1] for one in lines]}
            drawn.glyph.line_color = CHANNELS[along][1]
            axis.axis_label = f"{CHANNELS[along][0]} of the output"
        plane = net[0][1]
        frame(self.plane, extent(plane[..., 0].ravel()), extent(plane[..., 1].ravel()))
        self.plane.title.text = f"Where the nodes at {CHANNELS[channel][0]} = {level:.3f} go"


def _mapped_profile(session: Session) -> CameraProfile | None:
    """The profile in use, or the last one with a gamut map; None where there is none."""
    if session.history is not None and "rbf" in session.workspace.models:
        return session.workspace.models["rbf"].profile
    return session.profile if session.has_profile else None


def _map_of(style: PictureStyle, direction: str) -> GamutMap | None:
    """h or h⁻¹ where it maps anything."""
    if not style.physical:
        return None
    model = style.physical[0]
    gamut_map = model.gamut_map if direction == "render" else model.inverse_gamut_map
    return gamut_map if len(gamut_map.centres) > 1 else None  # one centre: it changes nothing
