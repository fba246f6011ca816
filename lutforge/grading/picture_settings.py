"""Which of a profile's settings a picture was made with: by its metadata, or by what the user says of it."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.white_balance import temperatures_of
from lutforge.settings import KELVIN_RANGE, Kelvin, Multipliers, Selector
from lutforge.shots.metadata import ShotMetadata

AS_SHOT = "as-shot"
AS_IT_IS = Selector(AS_SHOT, AS_SHOT)
NAMED_BY_FILE = (AS_SHOT, "auto")
"""White balances that stand for the picture's own."""

STEADY = 0.02
"""A named setting whose multipliers vary by less from shot to shot is the same for all shots."""


def choose_camera(
    path: Path, settings: ShotMetadata, cameras: Mapping[str, CameraProfile], is_stated: bool
) -> tuple[CameraProfile, tuple[str, ...]]:
    """The profile of the camera that took a picture. cameras: by name in lower case.

    is_stated: the user names the settings; then a single profile applies to any picture, and the notes say so.
    """
    camera = cameras.get(settings.camera.lower())
    if camera is not None:
        return camera, ()
    named = f"is of {settings.camera}" if settings.camera else "does not name its camera"
    known = ", ".join(profile.camera for profile in cameras.values())
    if len(cameras) > 1 or not is_stated:
        raise SettingsError(
            f"{path}: the picture {named}, the profile{'s are' if len(cameras) > 1 else ' is'} of {known}; "
            f"name the settings with --from STYLE/WB to use a profile all the same"
        )
    return next(iter(cameras.values())), (f"the picture {named}; the profile is of {known}",)


def source_selector(
    path: Path, settings: ShotMetadata, camera: CameraProfile, stated: Selector = AS_IT_IS, needed: bool = True
) -> tuple[Selector, tuple[str, ...]]:
    """The settings of a picture: those that the user states, completed by its metadata; and notes.

    needed: False where the white balance stays as it is, so that any serves where it is not told.
    """
    style = stated.style if stated.style != AS_SHOT else settings.style
    if style not in camera.styles:
        if stated.style != AS_SHOT:
            camera.selector(stated)  # raises: this error lists the styles
        known = f"{camera.camera} has the styles {', '.join(sorted(camera.styles))}"
        reason = f'its picture style is "{style}"' if style != "unknown" else "the file does not tell its picture style"
        balances = ", ".join(sorted(camera.white_balances))
        raise SettingsError(f"{path}: {reason}; {known} and the white balances {balances}: name it with --from")
    balance = _balance_of_file(settings, camera)
    chosen = balance if stated.white_balance in NAMED_BY_FILE else stated.white_balance
    if chosen is not None:
        given = camera.selector(Selector(style, chosen))
        named_style = settings.style if settings.style != "unknown" else style
        named = settings.white_balance if settings.white_balance != "unknown" else str(given.white_balance)
        if balance is None:
            same = named in (str(given.white_balance), "auto")
        else:
            stated_multipliers = camera.multipliers(Selector(style, balance))
            same = bool(np.allclose(stated_multipliers, camera.multipliers(given), rtol=2 * STEADY))
        if named_style == style and same:
            return given, ()
        named = str(given.white_balance) if same else named
        return given, (f"the file says {named_style}/{named}; it is taken for {given}, as --from says",)
    middle = camera.white_balances.get("auto")
    if stated.white_balance == "auto" and middle is not None:
        r, g, b = middle.multipliers
        text = f"the file does not tell its white balance; that of the middle shot, {r:.3f},{g:g},{b:.3f}, is used"
        return Selector(style, "auto"), (text,)
    if not needed:
        return Selector(style, next(iter(camera.white_balances))), ()
    reason = "the file does not tell its white balance"
    if settings.white_balance != "unknown":
        reason = (
            f'its white balance is "{settings.white_balance}", and the file does not tell which multipliers that were'
        )
    known = ", ".join(sorted(camera.white_balances))
    raise SettingsError(
        f"{path}: {reason}; put its RAW file beside it, name it with --from {style}/WB, where WB is {known}"
        f"{temperatures_of(camera.white_balances)}; `lutforge studio` shows how each looks"
    )


def _balance_of_file(settings: ShotMetadata, camera: CameraProfile) -> str | Kelvin | Multipliers | None:
    """The white balance that the metadata tell: the named setting, the temperature dialled in, or the multipliers."""
    name = settings.white_balance
    known = camera.white_balances.get(name)
    steady = known is not None and known.spread <= STEADY
    if settings.multipliers is not None and not isinstance(camera.provenance, ReferenceRaw):
        r, g, b = (float(value) for value in settings.multipliers)
        deviation = 0.0 if known is None else float(np.max(np.abs(settings.multipliers / known.multipliers - 1)))
        if not steady or STEADY < deviation <= 0.3:  # multipliers that deviate further are not believed
            return Multipliers((r, g, b))
    if steady:
        return name
    if name.endswith("k") and name[:-1].replace(".", "", 1).isdigit():
        kelvin = float(name[:-1])
        return Kelvin(kelvin) if KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1] else None
    return None
