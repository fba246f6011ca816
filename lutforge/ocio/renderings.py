"""The LUT files of a config: one per style and direction, shared by all white balances that one model covers.

White balance is a matrix before or after the LUTs. Programs load a config whenever they start, so curves in its files
have only 4096 entries.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, ColourFunction
from lutforge.errors import ConfigError
from lutforge.inverse.baked_render import BakedRender
from lutforge.inverse.linearization import INVERSE_SIZE, inverse_of
from lutforge.inverse.round_trip import measure, raw_colours, rounded_up, searched_near
from lutforge.luts.bake import bake
from lutforge.luts.description import description
from lutforge.luts.highlight_ops import highlight_ops
from lutforge.luts.input_and_output import ENCODED, InputAndOutput
from lutforge.luts.ops import Curve
from lutforge.luts.refinish import steps_of
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import uncovered
from lutforge.model.lattice import SHORT_SHAPER_SIZE
from lutforge.model.profile import PictureStyle
from lutforge.model.transform import Gain, Transform
from lutforge.ocio.cameras import Camera, UniqueNames, file_stem
from lutforge.samples.clipping import HALF_CODE
from lutforge.settings import Selector


def with_short_curves(lut: Lut) -> Lut:
    """The LUT with at most SHORT_SHAPER_SIZE entries in each curve, at an error below 1e-5 of the encoded scale.

    A curve without a cube stays as it is, because the curve of the other direction is its exact inverse.
    """
    if lut.cube is None:
        return lut
    ops = list(lut.ops)
    for number, op in enumerate(ops):
        if isinstance(op, Curve) and len(op.outputs) > SHORT_SHAPER_SIZE:
            even = np.linspace(op.low, op.high, SHORT_SHAPER_SIZE)[:, None].repeat(3, axis=1)
            ops[number] = Curve(op(even), op.low, op.high)
    return replace(lut, ops=tuple(ops))


MOST_BELOW_WHITE = 2.0 / 255
"""Saturated RAW that a model renders as near to white as this becomes white; a style with a darker white keeps it."""


def with_white(lut: Lut) -> Lut:
    """The render's LUT with white where all RAW channels are saturated, if the model comes near to it.

    JPEGs have white there. Without this, white would come back from the scene one or two codes darker, and not quite
    neutral.
    """
    below_white = 1.0 - lut(np.ones((1, 3)))
    if lut.cube is None or below_white.max() > MOST_BELOW_WHITE:
        return lut
    values = lut.cube.values.copy()
    values[-1, -1, -1] = np.maximum(values[-1, -1, -1], 1.0)
    return replace(lut, ops=tuple(replace(op, values=values) if op is lut.cube else op for op in lut.ops))


@dataclass(frozen=True, eq=False)
class Rendering:
    """A style and the white balances that one model of it covers, which share their LUTs.

    render: white-balanced RAW → JPEG; linearize: JPEG → white-balanced RAW. stem: of its file names.
    """

    camera: Camera
    style: str
    white_balances: tuple[str, ...]
    stem: str
    render: Transform | None
    linearize: Transform | None

    def file(self, way: str) -> str:
        """The name of a file. way: "render", "linearize" (its exact inverse), or "calibrated", JPEG → RAW for looks."""
        return f"{self.stem}_{way}.clf"

    def balance_file(self, source: str, target: str) -> str:
        """Name of the file from RAW under one white balance to RAW under another, which keeps white neutral."""
        return self.file(file_stem(self.camera.balances[source], "to", self.camera.balances[target]))

    def refinishes(self) -> Iterator[tuple[str, str, Transform]]:
        """The pairs of white balances that looks change, both ways, with a refinish that is not the identity.

        Without a calibrated JPEG → RAW there are none.
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
    """The renderings of cameras. taken: file stems in use. Raises ConfigError on a style without a model."""
    unique_stem = UniqueNames(taken, "_")
    result = []
    for camera in cameras:
        profile = camera.profile
        for name, style in profile.styles.items():
            groups = _balances_by_model(profile, style)
            if not groups:
                raise ConfigError(f"{profile.camera}: style {name} holds no model; calibrate it first")
            for balances in groups:
                selector = Selector(name, balances[0])
                render = linearize = None
                if style.render or style.models:
                    render = profile.render_balanced(selector)
                if style.linearize or style.models:
                    balance = Gain(profile.multipliers(selector))
                    linearize = Transform((*profile.linearize_to_own_raw(selector).stages, balance))
                stem = unique_stem(file_stem(camera.name, camera.styles[name]))
                result.append(Rendering(camera, name, balances, stem, render, linearize))
    return tuple(result)


def _balances_by_model(profile: CameraProfile, style: PictureStyle) -> list[tuple[str, ...]]:
    """The white balances that each model of a style covers, in the profile's order; a lattice covers all of them."""
    balances = tuple(profile.white_balances)
    if style.render or style.linearize:
        return [balances] if balances else []
    by_model = [tuple(name for name in balances if name in model.white_balances) for model in style.models]
    return [names for names in by_model if names]


WHITE_LEVEL = 4.0
"""The linear value of burnt-out white in a config: two stops above saturation.

No two white balances of a camera differ by more than two stops in a channel.
"""

BALANCE_SIZE = 21
"""Nodes per axis of the LUT of a look."""

BALANCE_REACH = 2.0
"""Highest linear value, relative to white, in the LUT of a look."""

BAKE_STEPS = 4
"""The number of steps that `baked` reports, at most."""


def baked(
    rendering: Rendering, inverse_size: int = INVERSE_SIZE, report_step: Callable[[str], None] = lambda step: None
) -> tuple[dict[str, Lut], tuple[str, ...]]:
    """Bake the render, and the linearization as its exact inverse, so that JPEG → reference → JPEG changes nothing.

    Returned are the LUTs by file name, and their errors as lines "KEY: VALUE". Where a style has no render, its
    linearization is that of the profile. inverse_size: nodes per axis of an inverse. report_step: called with the name
    of each step as it begins.
    """
    luts: dict[str, Lut] = {}
    balanced = f"linear camera RAW behind white balance {' or '.join(rendering.white_balances)}, black 0, saturation 1"
    report_step("baking the render")
    render = None if rendering.render is None else _baked_render(rendering, rendering.render)
    if render is not None:
        luts[rendering.file("render")] = _described(render, rendering, InputAndOutput(balanced, ENCODED))

    linearize = None
    if rendering.linearize is not None:
        if render is None or render.cube is None:  # a response alone is its own exact inverse
            linearize = _baked_linearization(rendering, rendering.linearize, report_step)
        else:
            linearize = _inverted_render(rendering, render, rendering.linearize, inverse_size, report_step)
        to_balanced = InputAndOutput(ENCODED, balanced)
        luts[rendering.file("linearize")] = _described(linearize, rendering, to_balanced)
        luts |= _baked_looks(rendering, rendering.linearize, to_balanced)

    return luts, tuple(line for lut in (render, linearize) if lut is not None for line in lut.comments)


def _described(lut: Lut, rendering: Rendering, stated: InputAndOutput) -> Lut:
    """The LUT with comments that describe its file; those that it has are details of them."""
    setting = f"camera and settings: {rendering.camera.profile.camera}, {rendering.style}"
    return replace(lut, comments=description(stated, "an OpenColorIO config", (setting, *lut.comments)))


def _title(rendering: Rendering, way: str) -> str:
    """The title of a LUT of a rendering. way: the transform that it holds."""
    return f"{rendering.camera.name} {rendering.camera.styles[rendering.style]} {way}"


def _baked_render(rendering: Rendering, render: Transform) -> Lut:
    """The LUT of a render, with its error as its comment."""
    lut = with_white(with_short_curves(bake(render, title=_title(rendering, "render"))))
    return replace(lut, comments=(f"render LUT against the model: {_error(lut, render)}",))


def _baked_linearization(rendering: Rendering, linearize: Transform, report_step: Callable[[str], None]) -> Lut:
    """The LUT of a linearization as the profile has it, with its error as its comment."""
    lut = with_short_curves(bake(linearize, title=_title(rendering, "linearize")))
    report_step("comparing with the model")
    return replace(lut, comments=(_error_of_linearization(lut, linearize, rendering),))


def _inverted_render(
    rendering: Rendering,
    render: Lut,
    linearize: Transform,
    inverse_size: int,
    report_step: Callable[[str], None],
) -> Lut:
    """The LUT of the exact inverse of a baked render, with its errors as its comments."""
    report_step("inverting it")
    inverse = inverse_of(BakedRender.of(render), linearize, inverse_size)
    inverse.values[-1, -1, -1] = WHITE_LEVEL
    lut = inverse.as_lut(_title(rendering, "linearize"))

    report_step("measuring what comes back")
    style = rendering.camera.profile.styles[rendering.style]
    round_trip = measure(render, lut, shown=lambda jpeg: ~uncovered(style, jpeg))
    report_step("comparing with the model")
    error = _error_of_linearization(lut, _with_burnt_white(linearize), rendering)
    return replace(lut, comments=(error, *str(round_trip).splitlines()))


def _error_of_linearization(lut: Lut, exact: ColourFunction, rendering: Rendering) -> str:
    """The line that states the error of a linearization's LUT."""
    return f"linearize LUT against the model: {_error(lut, exact, rendering.render)}"


def _with_burnt_white(linearize: ColourFunction) -> ColourFunction:
    """A linearization whose values rise to WHITE_LEVEL in the last half code below white."""

    def linearized(x: ArrayLike) -> Array:
        least = np.min(np.asarray(x), axis=-1, keepdims=True)
        burnt = np.clip((least - (1.0 - HALF_CODE)) / HALF_CODE, 0.0, 1.0)
        linear = linearize(x)
        return np.asarray(linear + burnt * (WHITE_LEVEL - linear))

    return linearized


def _baked_looks(rendering: Rendering, linearize: Transform, to_balanced: InputAndOutput) -> dict[str, Lut]:
    """The LUTs of the looks from one white balance to another, by file name: the calibrated JPEG → RAW, and each step.

    A look changes the white balance between linearization and render; white stays white. to_balanced: input and output
    of the linearization.
    """
    camera = rendering.camera
    refinishes = tuple(rendering.refinishes())
    if not refinishes:
        return {}
    calibrated = bake(linearize, title=_title(rendering, "linearize, as calibrated"))
    luts = {rendering.file("calibrated"): _described(with_short_curves(calibrated), rendering, to_balanced)}
    for source, target, refinish in refinishes:
        gain = camera.gain(target) / camera.gain(source)
        step = highlight_ops(steps_of(refinish).highlights, gain, BALANCE_REACH, BALANCE_SIZE)
        title = f"{camera.name} {camera.balances[source]} to {camera.balances[target]}"
        stated = InputAndOutput(*(f"linear camera RAW behind white balance {name}" for name in (source, target)))
        luts[rendering.balance_file(source, target)] = _described(Lut(step, title), rendering, stated)
    return luts


def _error(lut: Lut, transform: ColourFunction, rendered_by: Transform | None = None) -> str:
    """The mean and the maximum error of a LUT against its transform: RGB norms, rounded up, in words.

    They are measured over inputs that include the rim of the cube and dark colours, and over the JPEG colours that the
    transform `rendered_by` makes from these inputs. mean: the largest of the means over each of the two sets, over its
    evenly spread part, and over the unclipped colours of that part.
    """

    def error(x: Array) -> Array:
        return np.asarray(np.linalg.norm(lut(x) - transform(x), axis=1))

    count = 1 << 15
    x = raw_colours(count, seed=7)
    sets = [x] if rendered_by is None else [x, np.clip(rendered_by(x), 0.0, 1.0)]
    means = []
    largest = 0.0
    for colours in sets:
        exact = transform(colours)
        errors = np.asarray(np.linalg.norm(lut(colours) - exact, axis=1))
        jpeg = np.clip(exact, 0.0, 1.0) if rendered_by is None else colours
        unclipped = np.all((jpeg > HALF_CODE) & (jpeg < 1 - HALF_CODE), axis=1)[:count]
        parts = (errors, errors[:count], errors[:count][unclipped])
        means += [float(part.mean()) for part in parts if len(part)]
        largest = max(largest, float(errors.max()), float(error(searched_near(error, colours, errors, seed=7)).max()))
    return f"mean {rounded_up(max(means))}, max {rounded_up(largest)}"
