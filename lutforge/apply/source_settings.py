"""Which of a profile's settings a picture was made with: by its metadata, or by what the user says of it."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperatures_of
from lutforge.settings import KELVIN_RANGE, Kelvin, Multipliers, Selector, parse_selector
from lutforge.shots.picture_settings import PictureSettings

AS_SHOT = "as-shot"
NAMED_BY_FILE = (AS_SHOT, "auto")
"""White balances that stand for the picture's own."""

STEADY = 0.02
"""A named setting whose multipliers vary by less from shot to shot is the same for all shots."""


def choose_camera(
    path: Path, settings: PictureSettings, cameras: Mapping[str, CameraProfile], asked: bool
) -> tuple[CameraProfile, tuple[str, ...]]:
    """Return the profile of the camera that took a picture.

    cameras: by name in lower case; asked: the user names the settings; then a single profile applies to any picture,
    and the notes say so. Raises SettingsError.
    """
    found = cameras.get(settings.camera.lower())
    if found is not None:
        return found, ()
    named = f"is of {settings.camera}" if settings.camera else "does not name its camera"
    known = ", ".join(camera.camera for camera in cameras.values())
    if len(cameras) > 1 or not asked:
        raise SettingsError(
            f"{path}: the picture {named}, the profile{'s are' if len(cameras) > 1 else ' is'} of {known}; "
            f"name the settings with --from STYLE/WB to use a profile all the same"
        )
    return next(iter(cameras.values())), (f"the picture {named}; the profile is of {known}",)


def source_selector(
    path: Path, settings: PictureSettings, camera: CameraProfile, asked: str | None, needed: bool = True
) -> tuple[Selector, tuple[str, ...]]:
    """The settings of a picture: those asked for, completed by its metadata; and notes.

    needed: False where the white balance stays as it is, so that any serves where it is not told. Raises SettingsError
    with the profile's known settings where they cannot be told.
    """
    wanted = parse_selector(asked) if asked else Selector(AS_SHOT, AS_SHOT)
    style = wanted.style if wanted.style != AS_SHOT else settings.style
    if style not in camera.styles:
        if wanted.style != AS_SHOT:
            camera.selector(wanted)  # raises: this error lists the styles
        known = f"{camera.camera} has the styles {', '.join(sorted(camera.styles))}"
        told = f'its picture style is "{style}"' if style != "unknown" else "the file does not tell its picture style"
        balances = ", ".join(sorted(camera.white_balances))
        raise SettingsError(f"{path}: {told}; {known} and the white balances {balances}: name it with --from")
    balance = _balance_of_file(settings, camera)
    if wanted.white_balance not in NAMED_BY_FILE:
        given = camera.selector(Selector(style, wanted.white_balance))
        return given, _contradictions(settings, camera, given, balance)
    if balance is not None:
        given = camera.selector(Selector(style, balance))
        return given, _contradictions(settings, camera, given, balance)
    middle = camera.white_balances.get("auto")
    if wanted.white_balance == "auto" and middle is not None:
        r, g, b = middle.multipliers
        text = f"the file does not tell its white balance; that of the middle shot, {r:.3f},{g:g},{b:.3f}, is used"
        return Selector(style, "auto"), (text,)
    if not needed:
        return Selector(style, next(iter(camera.white_balances))), ()
    told = "the file does not tell its white balance"
    if settings.white_balance != "unknown":
        told = (
            f'its white balance is "{settings.white_balance}", and the file does not tell which multipliers that were'
        )
    known = ", ".join(sorted(camera.white_balances))
    raise SettingsError(
        f"{path}: {told}; put its RAW file beside it, name it with --from {style}/WB, where WB is {known}"
        f"{temperatures_of(camera.white_balances)}, or find it with --candidates sheet.jpg"
    )


def _contradictions(
    settings: PictureSettings, camera: CameraProfile, given: Selector, told: str | Kelvin | Multipliers | None
) -> tuple[str, ...]:
    """Return a note where the settings that are used are not those that the file names."""
    style = settings.style if settings.style != "unknown" else given.style
    balance = settings.white_balance if settings.white_balance != "unknown" else str(given.white_balance)
    if told is None:
        same = balance in (str(given.white_balance), "auto")
    else:
        of_file = camera.multipliers(Selector(given.style, told))
        same = bool(np.allclose(of_file, camera.multipliers(given), rtol=2 * STEADY))
    if style == given.style and same:
        return ()
    named = balance if not same else str(given.white_balance)
    return (f"the file says {style}/{named}; it is taken for {given}, as --from says",)


def _balance_of_file(settings: PictureSettings, camera: CameraProfile) -> str | Kelvin | Multipliers | None:
    """Return the white balance that the metadata tell.

    It is the named setting, the temperature that was dialled in, or the multipliers.
    """
    name = settings.white_balance
    known = camera.white_balances.get(name)
    steady = known is not None and known.spread <= STEADY
    if settings.multipliers is not None and not camera.raw_camera:
        r, g, b = (float(value) for value in settings.multipliers)
        departure = 0.0 if known is None else float(np.max(np.abs(settings.multipliers / known.multipliers - 1)))
        if not steady or STEADY < departure <= 0.3:  # multipliers that depart further are not believed
            return Multipliers((r, g, b))
    if steady:
        return name
    if name.endswith("k") and name[:-1].replace(".", "", 1).isdigit():
        kelvin = float(name[:-1])
        return Kelvin(kelvin) if KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1] else None
    return None
