"""Linearize pictures by camera profiles: each from the settings that it was made with to linear values of a space."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lutforge.colour.rgb_spaces import CHROMATICITIES, INTEROP_IDS, from_linear_srgb, rgb_space
from lutforge.errors import ImageError, SettingsError
from lutforge.grading.grade import Grade
from lutforge.grading.picture_settings import AS_SHOT, NAMED_BY_FILE, choose_camera, source_selector
from lutforge.grading.profile_recipe import STALE, RecipeFromProfiles
from lutforge.luts.ops import Matrix
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.transform import Transform
from lutforge.settings import Selector, require_exposure
from lutforge.shots.discover import RAW_SUFFIXES
from lutforge.shots.metadata import read_picture_settings

UNIT_EXPOSURE = 2.0**-10
"""Time in seconds · ISO / 100 / f-number² of a picture whose values are not scaled: about 1/60 s at f/4 and ISO 100.

With this unit half floats hold a sunlit scene and a room lit by lamps without loss.
"""


@dataclass(frozen=True)
class SceneRecipe(RecipeFromProfiles):
    """Linearize each picture from the settings that it was made with to linear values of a colour space.

    target: "as-shot/WB", whose white balance is that of the illuminant that becomes neutral; by default a picture's
    own, or, with `by_exposure`, the same for all: daylight, or else the profile's first. by_exposure: divide by time,
    ISO and aperture, as the file states them, so that pictures of one scene agree.
    """

    space: str = field(kw_only=True)
    by_exposure: bool = False

    def check(self) -> None:
        """Raise SettingsError or ProfileError where the profiles or the settings are wrong."""
        if not rgb_space(self.space).is_linear:
            raise SettingsError(f"--space {self.space}: encoded; pictures become linear light, such as acescg")
        require_exposure(self.ev)
        if self.target_setting.style != AS_SHOT:
            advice = f"write --to {AS_SHOT}/{self.target_setting.white_balance}"
            raise SettingsError(f"--to {self.target}: light has no style, only a white balance; {advice}")
        super().check()
        for camera in self.cameras.values():
            self._neutral(camera, Selector(next(iter(camera.styles)), next(iter(camera.white_balances))))

    def grade(self, source: Path) -> Grade:
        """Return the grade of one picture by its own settings."""
        if source.suffix.lower() in RAW_SUFFIXES:
            raise SettingsError(f"{source}: a RAW file; --space takes finished pictures")
        settings = read_picture_settings(source)
        camera, notes = choose_camera(source, settings, self.cameras, self.source is not None)
        made_with, setting_notes = source_selector(source, settings, camera, self.stated_setting)
        scale = 2.0**self.ev
        if self.by_exposure:
            if not math.isfinite(settings.exposure):
                raise ImageError(f"{source}: the file does not state its exposure; leave out --exposure exif")
            scale *= UNIT_EXPOSURE / settings.exposure
            setting_notes += settings.exposure_notes

        # The LUT to linear values: the step to balanced RAW, baked once for each style, and a matrix.
        neutral = self._neutral(camera, made_with)
        space = rgb_space(self.space)
        stages = camera.linearize_to_own_raw(made_with).stages
        to_balanced = Transform(stages[:-1])
        to_raw = Transform(stages[-1:])(np.eye(3)).T
        from_raw = from_linear_srgb(self.space) @ camera.matrix @ np.diag(camera.multipliers(neutral))
        lut = Lut((*self.baked_grades.baked(to_balanced).ops, Matrix(scale * from_raw @ to_raw)))
        details = f", {self.ev:+g} EV" * bool(self.ev) + ", by exposure" * self.by_exposure
        return Grade(
            processor=self.baked_grades.processor(lut),
            history=f"{camera.camera}: {made_with} -> {self.space}, neutral {neutral.white_balance}{details}",
            attributes={
                **dict.fromkeys((*STALE, "ICCProfile", "Exif:ColorSpace", "oiio:ColorSpace", "oiio:Gamma")),
                "colorInteropID": INTEROP_IDS.get(space.name),
                "chromaticities": tuple(np.ravel(CHROMATICITIES[space.primaries]).tolist()),
            },
            notes=(*settings.notes, *notes, *setting_notes),
            gives_linear=True,
            lut=lut,
            for_srgb=made_with.colour_space == "srgb",
            marks_clipped=True,
        )

    def _neutral(self, camera: CameraProfile, source: Selector) -> Selector:
        """The setting whose illuminant becomes neutral. source: the settings of the picture."""
        if self.target_setting.white_balance not in NAMED_BY_FILE:
            return camera.selector(Selector(source.style, self.target_setting.white_balance))
        if self.target is not None or not self.by_exposure:
            return source
        balances = camera.white_balances
        name = "daylight" if "daylight" in balances else next(iter(balances))
        return camera.selector(Selector(source.style, name))
