"""Use case: a look, that is a style, a white balance and an exposure → the LUT that grades photographs to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from lutforge.grading.baked_grades import BakedGrades, SettingChange, baked_steps
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.transform import Transform
from lutforge.model.white_balance import NAMED_KELVIN
from lutforge.progress import Progress


@dataclass(frozen=True)
class ChosenLook:
    """A look that a user chose. source, target: STYLE/WB, "" where not chosen; ev: exposure change in stops."""

    source: str = ""
    target: str = ""
    ev: float = 0.0


def usual_setting(profile: CameraProfile) -> str:
    """The default STYLE/WB of a camera: the style "standard", and a white balance that shots of it were taken with.

    Of several white balances it is the one nearest to daylight; those without a temperature, such as auto, come last.
    """
    style = min(profile.styles, key=lambda name: name.lower() != "standard")
    of_shots = {name for model in profile.styles[style].models for name in model.white_balances}
    balances = {name: balance for name, balance in profile.white_balances.items() if name in of_shots}
    balances = balances or dict(profile.white_balances)

    def distance(name: str) -> float:
        kelvin = balances[name].kelvin or NAMED_KELVIN.get(name, 0.0)
        return abs(kelvin - NAMED_KELVIN["daylight"])

    return f"{style}/{min(balances, key=distance)}"


@lru_cache(4)
def grades_of(profile: CameraProfile) -> BakedGrades:
    """The baked steps of a profile, kept between changes of the look."""
    return BakedGrades()


def change_of(profile: CameraProfile, look: ChosenLook) -> SettingChange:
    """The change of settings that a look makes. Raises SettingsError."""
    return SettingChange(profile, profile.selector(look.source), profile, profile.selector(look.target), look.ev)


def slow_steps(profile: CameraProfile, look: ChosenLook) -> tuple[Transform, ...]:
    """The steps of a look that take seconds to bake, and are not baked yet. Raises SettingsError."""
    return grades_of(profile).slow_steps(change_of(profile, look).transform)


def changes_nothing(profile: CameraProfile, look: ChosenLook) -> bool:
    """Whether a look leaves photographs as they are. Raises SettingsError."""
    change = change_of(profile, look)
    return not look.ev and str(change.source) == str(change.target)


def look_lut(profile: CameraProfile, look: ChosenLook) -> Lut | None:
    """The LUT by which `apply` grades; None where the look changes nothing. Raises SettingsError."""
    return None if changes_nothing(profile, look) else grades_of(profile).refinish(change_of(profile, look))


def bake_steps(steps: Sequence[Transform], progress: Progress) -> Sequence[Lut]:
    """Bake the steps that `slow_steps` names, for `add_baked`; this takes seconds."""
    return baked_steps(steps, progress)


def add_baked(profile: CameraProfile, steps: Sequence[Transform], luts: Sequence[Lut]) -> None:
    """Keep the LUTs of `bake_steps` for all looks of a profile."""
    for step, lut in zip(steps, luts, strict=True):
        grades_of(profile).add(step, lut)
