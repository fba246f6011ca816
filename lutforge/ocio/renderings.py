"""The LUT files behind a config: one per style and direction, shared by all white balances that one model covers.

White balance is a matrix in front of the LUTs or behind them.

A config is loaded by every program at every start, so curves in its files hold 4096 entries.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, ColourFunction
from lutforge.errors import ConfigError
from lutforge.inverse.linearization import SIZE, BakedRender, inverse_of
from lutforge.inverse.round_trip import climbed, measure, raw_colours, rounded_up
from lutforge.luts.bake import bake
from lutforge.luts.highlights import raised
from lutforge.luts.ops import Curve
from lutforge.luts.refinish import steps_of
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import FEW
from lutforge.model.coverage import uncovered
from lutforge.model.transform import Gain, Transform
from lutforge.ocio.cameras import Camera, UniqueNames, file_stem
from lutforge.samples.clipping import HALF_CODE
from lutforge.settings import Selector


def with_short_curves(lut: Lut) -> Lut:
    """The LUT with FEW entries in each curve of more, an error below 1e-5 of the encoded scale.

    A curve without a cube stays: the one of the other direction is its exact inverse.
    """
    if lut.cube is None:
        return lut
    ops = list(lut.ops)
    for number, op in enumerate(ops):
        if isinstance(op, Curve) and len(op.outputs) > FEW:
            even = np.linspace(op.low, op.high, FEW)[:, None].repeat(3, axis=1)
            ops[number] = Curve(op(even), op.low, op.high)
    return replace(lut, ops=tuple(ops))


NEAR_WHITE = 2.0 / 255
"""A model that renders saturated RAW this near to white means white; a style whose white is darker keeps its own."""


def with_white(lut: Lut) -> Lut:
    """The render's LUT with white where all RAW channels are saturated, if the model comes near to it.

    JPEGs have white there, which else comes back from the scene one or two codes darker, and not quite neutral.
    """
    lacking = 1.0 - lut(np.ones((1, 3)))
    if lut.cube is None or lacking.max() > NEAR_WHITE:
        return lut
    values = lut.cube.values.copy()
    values[-1, -1, -1] = np.maximum(values[-1, -1, -1], 1.0)
    return replace(lut, ops=tuple(replace(op, values=values) if op is lut.cube else op for op in lut.ops))


@dataclass(frozen=True, eq=False)
class Rendering:
    """What shares its LUTs: a style, and the white balances that one model of it covers.

    render: white-balanced RAW → JPEG; linearize: JPEG → white-balanced RAW. stem: of its file names.
    """

    camera: Camera
    style: str
    white_balances: tuple[str, ...]
    stem: str
    render: Transform | None
    linearize: Transform | None

    def file(self, way: str) -> str:
        """Name of a file: "render", "linearize" (its exact inverse), or "calibrated", JPEG → RAW for looks."""
        return f"{self.stem}_{way}.clf"

    def balance_file(self, source: str, target: str) -> str:
        """Name of the file from RAW under one white balance to RAW under another, which keeps white neutral."""
        return self.file(file_stem(self.camera.balances[source], "to", self.camera.balances[target]))

    def refinishes(self) -> Iterator[tuple[str, str, Transform]]:
        """Pairs of white balances that looks change, both ways, and the refinish, where it changes anything.

        None without a calibrated JPEG → RAW.
        """
        if self.render is None or self.camera.profile.styles[self.style].linearize is None:
            return
        pairs = self.camera.look_pairs
        for source, target in dict.fromkeys([*pairs, *(pair[::-1] for pair in pairs)]):
            if not {source, target} <= set(self.white_balances):
                continue
            refinish = self.camera.profile.refinish(Selector(self.style, source), Selector(self.style, target))
            if not refinish.is_identity:
                yield source, target, refinish


def renderings(cameras: Iterable[Camera], taken: Iterable[str] = ()) -> tuple[Rendering, ...]:
    """The renderings of cameras; taken: file stems that others use. Raises ConfigError on a style without a model."""
    files, made = UniqueNames(taken, "_"), []
    for camera in cameras:
        profile = camera.profile
        everywhere = tuple(profile.white_balances)
        for name, style in profile.styles.items():
            groups = [everywhere] if style.render or style.linearize else []
            if not groups:
                groups = [tuple(b for b in everywhere if b in model.white_balances) for model in style.models]
            if not any(groups):
                raise ConfigError(f"{profile.camera}: style {name} holds no model; calibrate it first")
            for balances in filter(None, groups):
                selector = Selector(name, balances[0])
                render = linearize = None
                if style.render or style.models:
                    render = profile.render_balanced(selector)
                if style.linearize or style.models:
                    balance = Gain(profile.multipliers(selector))
                    linearize = Transform((*profile.linearize_to_own_raw(selector).stages, balance))
                stem = files(file_stem(camera.name, camera.styles[name]))
                made.append(Rendering(camera, name, balances, stem, render, linearize))
    return tuple(made)


BEYOND = 4.0
"""Light of white in a config, two stops above saturation: no two white balances of a camera part a channel by more."""

BALANCE_SIZE, BALANCE_REACH = 21, 2.0
"""Nodes per axis of the LUT of a look, and up to which light, relative to white, it tells levels apart."""

STEPS = 4
"""How often `baked` tells what it does, at most."""


def baked(
    rendering: Rendering, inverse_size: int = SIZE, tell: Callable[[str], None] = lambda what: None
) -> tuple[dict[str, Lut], tuple[str, ...]]:
    """Bake the render as it is, and the linearization as its inverse, so that JPEG → reference → JPEG comes back.

    Returned are the LUTs by file name and their errors, lines of a key and a value. The
    linearization of a style without a render is that of its profile. inverse_size: nodes per axis of an inverse. tell:
    called with each step as it begins.
    """
    title = f"{rendering.camera.name} {rendering.camera.styles[rendering.style]}"
    tell("baking the render")
    luts: dict[str, Lut] = {}
    errors: list[str] = []
    if rendering.render is not None:
        render = with_white(with_short_curves(bake(rendering.render, title=f"{title} render")))
        errors.append(f"render LUT against the model: {_error(render, rendering.render)}")
        luts[rendering.file("render")] = replace(render, comments=tuple(errors))
    if rendering.linearize is not None:
        model: ColourFunction = rendering.linearize
        trip: list[str] = []
        if rendering.render is None or render.cube is None:  # a response alone is its own exact inverse
            linearize = with_short_curves(bake(rendering.linearize, title=f"{title} linearize"))
        else:
            tell("inverting it")
            inverse = inverse_of(BakedRender.of(render), rendering.linearize, inverse_size)
            inverse.values[-1, -1, -1] = BEYOND
            calibrated = model

            def with_burnt_white(x: ArrayLike) -> Array:
                """Light of encoded colours, with burnt-out white `BEYOND` saturation, as the last half code rises."""
                least = np.min(np.asarray(x), axis=-1, keepdims=True)
                burnt = np.clip((least - (1.0 - HALF_CODE)) / HALF_CODE, 0.0, 1.0)
                light = calibrated(x)
                return np.asarray(light + burnt * (BEYOND - light))

            model = with_burnt_white
            linearize = inverse.as_lut(f"{title} linearize")
            style = rendering.camera.profile.styles[rendering.style]
            tell("measuring what comes back")
            trip = str(measure(render, linearize, shown=lambda jpeg: ~uncovered(style, jpeg))).splitlines()
        tell("comparing with the model")
        lines = [f"linearize LUT against the model: {_error(linearize, model, rendering.render)}", *trip]
        luts[rendering.file("linearize")] = replace(linearize, comments=tuple(lines))
        errors += lines
        for source, target, refinish in rendering.refinishes():
            if rendering.file("calibrated") not in luts:  # the same for all pairs
                lut = bake(rendering.linearize, title=f"{title} linearize, as calibrated")
                luts[rendering.file("calibrated")] = with_short_curves(lut)
            # A look changes the white balance between linearization and render, and keeps white white.
            highlights = steps_of(refinish).highlights
            gain = rendering.camera.gain(target) / rendering.camera.gain(source)
            names = rendering.camera.balances
            title = f"{rendering.camera.name} {names[source]} to {names[target]}"
            step = raised(highlights, gain, BALANCE_REACH, BALANCE_SIZE)
            luts[rendering.balance_file(source, target)] = Lut(step, title)
    return luts, tuple(errors)


def _error(lut: Lut, transform: ColourFunction, made_by: Transform | None = None) -> str:
    """Measure a LUT against its transform: RGB norm, rounded up.

    max: over its whole input, the rim and the darks, and over the colours that another transform makes of these; mean:
    the largest of those over each, over what is evenly spread of it, and over what is not clipped of that.
    """

    def error(x: Array) -> Array:
        return np.asarray(np.linalg.norm(lut(x) - transform(x), axis=1))

    count, half_a_code = 1 << 15, 0.5 / 255
    x = raw_colours(count, seed=7)
    made = x if made_by is None else np.clip(made_by(x), 0.0, 1.0)
    means, largest = [], 0.0
    for colours in (x,) if made_by is None else (x, made):
        wanted = transform(colours)
        errors = np.asarray(np.linalg.norm(lut(colours) - wanted, axis=1))
        jpeg = np.clip(wanted, 0.0, 1.0) if made_by is None else colours
        unclipped = np.all((jpeg > half_a_code) & (jpeg < 1 - half_a_code), axis=1)[:count]
        parts = (errors, errors[:count], errors[:count][unclipped])
        means += [float(part.mean()) for part in parts if len(part)]
        largest = max(largest, float(errors.max()), float(error(climbed(error, colours, errors, seed=7)).max()))
    return f"mean {rounded_up(max(means))}, max {rounded_up(largest)}"
