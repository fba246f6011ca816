"""The settings of a profile that a picture was made with: by its metadata, or as the user states them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import ReferenceRaw
from lutforge.settings import KELVIN_RANGE, Kelvin, Multipliers, Selector
from lutforge.shots.metadata import ShotMetadata

AS_SHOT = "as-shot"
AS_IT_IS = Selector(AS_SHOT, AS_SHOT)
NAMED_BY_FILE = (AS_SHOT, "auto")
"""The words for a picture's own white balance."""

STEADY = 0.02
"""A named setting is fixed where its multipliers vary by less than this share from shot to shot."""


def choose_camera(
    path: Path, settings: ShotMetadata, cameras: Mapping[str, CameraProfile], is_stated: bool
) -> tuple[CameraProfile, tuple[str, ...]]:
    """The profile of the camera that took a picture, and notes. cameras: by name in lower case.

    is_stated: the user states the settings; then a single profile applies to any picture, and a note says so.
    """
    camera = cameras.get(settings.camera.lower())
    if camera is not None:
        return camera, ()
    is_of = f"is of {settings.camera}" if settings.camera else "does not name its camera"
    names = ", ".join(profile.camera for profile in cameras.values())
    if len(cameras) > 1 or not is_stated:
        raise SettingsError(
            f"{path}: the picture {is_of}, the profile{'s are' if len(cameras) > 1 else ' is'} of {names}; "
            f"name the settings with --from STYLE/WB to use a profile all the same"
        )
    return next(iter(cameras.values())), (f"the picture {is_of}; the profile is of {names}",)


def source_selector(
    path: Path, settings: ShotMetadata, camera: CameraProfile, stated: Selector = AS_IT_IS, needs_balance: bool = True
) -> tuple[Selector, tuple[str, ...]]:
    """The settings of a picture, as the user states them, completed by its metadata; and notes.

    needs_balance: False where the white balance stays as it is; then any will do where the file states none.
    """
    style = stated.style if stated.style != AS_SHOT else settings.style
    if style not in camera.styles:
        if stated.style != AS_SHOT:
            camera.selector(stated)  # raises an error that lists the styles
        styles = f"{camera.camera} has the styles {', '.join(sorted(camera.styles))}"
        reason = "the file does not state its picture style"
        if style != "unknown":
            reason = f'its picture style is "{style}"'
        balances = ", ".join(sorted(camera.white_balances))
        raise SettingsError(f"{path}: {reason}; {styles} and the white balances {balances}: name it with --from")

    by_file = _balance_of_file(settings, camera)
    balance = by_file if stated.white_balance in NAMED_BY_FILE else stated.white_balance
    if balance is not None:
        selector = camera.selector(Selector(style, balance))
        return selector, _notes_on_difference(settings, camera, by_file, selector)

    # The file states no white balance, and neither does the user.
    middle = camera.white_balances.get("auto")
    if stated.white_balance == "auto" and middle is not None:
        r, g, b = middle.multipliers
        text = f"the file does not state its white balance; that of the middle shot, {r:.3f},{g:g},{b:.3f}, is used"
        return Selector(style, "auto"), (text,)
    if not needs_balance:
        name = next(iter(camera.white_balances))
        of_shot = ", the white balance of the middle shot" if name == "auto" else ""
        text = (
            f"the file does not state its white balance, which stays as it is; it is graded as {style}/{name}{of_shot}"
        )
        return Selector(style, name), (text,)
    reason = "the file does not state its white balance"
    if settings.white_balance != "unknown":
        reason = (
            f'its white balance is "{settings.white_balance}", and the file does not state which multipliers that were'
        )
    balances = ", ".join(sorted(camera.white_balances))
    raise SettingsError(
        f"{path}: {reason}; put its RAW file beside it, name it with --from {style}/WB, where WB is {balances}"
        f"{camera.white_balance_model.temperatures_in_words}; `lutforge studio` shows how each looks"
    )


def _notes_on_difference(
    settings: ShotMetadata, camera: CameraProfile, by_file: str | Kelvin | Multipliers | None, selector: Selector
) -> tuple[str, ...]:
    """A note where the settings in a file differ from a selector that is used. by_file: the file's white balance."""
    style = settings.style if settings.style != "unknown" else selector.style
    balance = settings.white_balance if settings.white_balance != "unknown" else str(selector.white_balance)
    if by_file is None:
        same_balance = balance in (str(selector.white_balance), "auto")
    else:
        multipliers = camera.multipliers(Selector(selector.style, by_file))
        same_balance = bool(np.allclose(multipliers, camera.multipliers(selector), rtol=2 * STEADY))
    if style == selector.style and same_balance:
        return ()
    balance = str(selector.white_balance) if same_balance else balance
    return (f"the file says {style}/{balance}; it is taken for {selector}, as --from says",)


def _balance_of_file(settings: ShotMetadata, camera: CameraProfile) -> str | Kelvin | Multipliers | None:
    """The white balance in a picture's metadata: a setting by name, a temperature, or multipliers; else None."""
    name = settings.white_balance
    setting = camera.white_balances.get(name)
    steady = setting is not None and setting.spread <= STEADY
    if settings.multipliers is not None and not isinstance(camera.provenance, ReferenceRaw):
        r, g, b = (float(value) for value in settings.multipliers)
        deviation = 0.0 if setting is None else float(np.max(np.abs(settings.multipliers / setting.multipliers - 1)))
        if not steady or STEADY < deviation <= 0.3:  # multipliers that deviate further are implausible
            return Multipliers((r, g, b))
    if steady:
        return name
    if name.endswith("k") and name[:-1].replace(".", "", 1).isdigit():
        kelvin = float(name[:-1])
        return Kelvin(kelvin) if KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1] else None
    return None
