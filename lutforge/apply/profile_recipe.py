"""Refinish images with a camera profile: the picture style, white balance and exposure that they should have had."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

from lutforge.apply.grade import Grade, fingerprint
from lutforge.errors import SettingsError
from lutforge.luts.bake import bake
from lutforge.luts.processor import file_processor
from lutforge.luts.write import write_lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_file import load_profile


@dataclass(frozen=True)
class ProfileRecipe:
    """From one setting of a camera to another. source, target: STYLE/WB; ev: exposure change in stops."""

    path: Path
    source: str | None
    target: str | None
    ev: float = 0.0

    @cached_property
    def key(self) -> str:
        return fingerprint("profile", self.path, self.source, self.target, self.ev)

    def check(self) -> None:
        _ = self._grade

    def grade(self, source: Path) -> Grade:
        return self._grade

    @cached_property
    def _grade(self) -> Grade:
        profile = load_profile(self.path)
        if self.source is None:
            raise SettingsError(
                f"refinish needs --from STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
                f"and the white balances {', '.join(profile.white_balances)}"
            )
        target = self.target or self.source
        transform = profile.refinish(self.source, target, self.ev)
        with TemporaryDirectory() as folder:  # baked, as OpenColorIO evaluates it
            lut = bake(transform, interpolation="tetrahedral")
            written = write_lut(lut, Path(folder) / "refinish.clf")
            processor = file_processor(written.path, "tetrahedral")
        exposure = f", {self.ev:+g} EV" if self.ev else ""
        history = f"{profile.camera} {self.source} to {target}{exposure}"
        return Grade(processor, history, notes=_median_notes(profile, self.source, target), lut=lut)

    def __reduce__(self) -> tuple[object, ...]:
        return ProfileRecipe, (self.path, self.source, self.target, self.ev)


def _median_notes(profile: CameraProfile, *selectors: str) -> tuple[str, ...]:
    """Which white balances the camera sets anew for each shot, so that a name stands for their median."""
    names = dict.fromkeys(str(profile.selector(selector).white_balance) for selector in selectors)
    notes = []
    for name in names:
        known = profile.white_balances.get(name)
        if known is not None and known.spread > 0.02:
            r, g, b = known.multipliers
            notes.append(
                f"{profile.camera} sets {name} anew for each shot (by up to {known.spread:.0%}); its median is used, "
                f"{r:.3f},{g:g},{b:.3f}; name a shot's own multipliers for an exact grade"
            )
    return tuple(notes)
