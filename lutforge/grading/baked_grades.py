"""The cache of baked grades: LUTs of refinishes and renders; steps that are slow to bake are shared by all pictures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.luts.bake import bake
from lutforge.luts.ops import Cube, Matrix, Range
from lutforge.luts.refinish import refinish_lut, steps_of
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile, match, raw_to_balanced
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.raw_transfer import RawTransfer
from lutforge.model.transform import Transform, through_stages
from lutforge.progress import Progress, silent
from lutforge.settings import Selector


@dataclass(frozen=True)
class SettingChange:
    """The change that a refinish makes: from settings of a camera to settings of a look, that of the same or another.

    source: of `camera`; target: of `look`. ev: exposure change in stops. transfer: RAW → RAW between the two cameras,
    where one was measured.
    """

    camera: CameraProfile
    source: Selector
    look: CameraProfile
    target: Selector
    ev: float = 0.0
    transfer: RawTransfer | None = None

    @property
    def transform(self) -> Transform:
        """The refinish (6.1), exact to the model."""
        return match(self.camera, self.source, self.look, self.target, self.ev, transfer=self.transfer)

    @property
    def is_none(self) -> bool:
        """True where both settings render in the same way."""
        if self.look is not self.camera or self.ev or self.source.style != self.target.style:
            return False
        before = self.camera.multipliers(self.source)
        after = self.camera.multipliers(self.target)
        return bool(np.allclose(before, after, rtol=1e-4))

    def history(self, picture: str) -> str:
        """The change in one line, for an image's history. picture: its settings before, or RAW."""
        exposure = f", {self.ev:+g} EV" if self.ev else ""
        return f"{self.camera.camera}: {picture} -> {self.look.camera}: {self.target}{exposure}"


class BakedGrades:
    """LUTs of refinishes and renders, each linearize and render step baked once for all white balances."""

    def __init__(self) -> None:
        self._luts: dict[object, Lut] = {}
        # Only the last LUTs are kept: every picture on automatic white balance has another.
        self.refinish: Callable[[SettingChange], Lut] = lru_cache(16)(
            lambda change: refinish_lut(change.transform, self.baked)
        )
        self.processor: Callable[..., OCIO.CPUProcessor] = lru_cache(32)(Lut.processor)

    def develop(self, change: SettingChange) -> OCIO.CPUProcessor:
        """The processor that renders RAW. Values are clipped before exposure is lowered: highlights stay neutral."""
        camera = change.camera
        look = change.look
        target = change.target
        before = camera.multipliers(change.source if look is not camera else target)
        k = 2.0**change.ev
        stages = raw_to_balanced(camera, change.source, look, target, transfer=change.transfer)
        balanced = through_stages(stages, grid(uniform_levels(2)) / before)
        brightened = Matrix(np.diag(before * max(k, 1.0)))
        darkened = Matrix(min(k, 1.0) * np.eye(3))
        exposed = (brightened, Range(), Cube(balanced, "trilinear"), darkened)
        return Lut((*exposed, *self.baked(look.render_balanced(target)).ops)).processor()

    def slow_steps(self, refinish: Transform) -> tuple[Transform, ...]:
        """The steps of a refinish that take seconds to bake, those with a gamut map, and that have not been baked."""
        steps = () if refinish.is_identity else (steps_of(refinish).linearize, steps_of(refinish).render)
        return tuple(step for step in steps if isinstance(_core(step), GamutMap) and _core(step) not in self._luts)

    def add(self, step: Transform, lut: Lut) -> None:
        """Add a step that was baked elsewhere."""
        self._luts[_core(step)] = lut

    def baked(self, step: Transform) -> Lut:
        """Return the LUT of a step that is the same under all white balances."""
        core = _core(step)
        if core not in self._luts:
            (self._luts[core],) = baked_steps([step])
        return self._luts[core]


def baked_steps(steps: Sequence[Transform], progress: Progress = silent) -> tuple[Lut, ...]:
    """Bake steps of a look that are the same under all white balances."""
    baked = []
    for number, step in enumerate(steps):
        progress("baking", number / len(steps))
        baked.append(bake(step))
    return tuple(baked)


def _core(step: Transform) -> Lattice | GamutMap:
    """The lattice or gamut map of a step, which identifies it in the cache."""
    return next(stage for stage in step.stages if isinstance(stage, Lattice | GamutMap))
