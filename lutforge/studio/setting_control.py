"""The controls of one setting, STYLE/WB: how a photograph was taken, or what is wanted of it."""

import re
from contextlib import suppress

from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import ReferenceRaw
from lutforge.pipeline.looks import usual_setting
from lutforge.settings import Selector, Shift
from lutforge.studio import ui
from lutforge.studio.workspace import WorkspaceError

LABEL_AS_SHOT = "as shot"
BY_TEMPERATURE = "by temperature"
BY_MULTIPLIERS = "by multipliers"
NOT_CHOSEN = "not known: choose"


class SettingControl:
    """STYLE/WB by a preset, a temperature and tint, multipliers, or as the photograph was shot.

    asks: nothing is chosen before the visitor, or the photograph's metadata, say so.
    """

    def __init__(self, title: str, asks: bool = False) -> None:
        self.title = title
        self.profile: CameraProfile
        self.unknown = {NOT_CHOSEN: ""} if asks else {}
        self.style = ui.select(f"{title}: style", self.unknown or ui.NOTHING)
        self.balance = ui.select(f"{title}: white balance", self.unknown or ui.NOTHING)
        self.kelvin = ui.slider(f"{title}: temperature, K", 5200, 2000, 10000, 50)
        self.tint = ui.slider(f"{title}: tint", 0, -50, 50, 1)
        self.multipliers = ui.entry(f"{title}: multipliers r,g,b", placeholder="2.10,1,1.43")
        self.numbers = (self.kelvin, self.tint, self.multipliers)
        self.widgets = (self.style, self.balance, *self.numbers)

    def offer(self, profile: CameraProfile) -> None:
        """Offer the settings of a profile; what is chosen stays where it has that, else it is the usual setting."""
        self.profile = profile
        kelvins = None
        through_reference = isinstance(profile.provenance, ReferenceRaw)
        with suppress(SettingsError):
            kelvins = None if through_reference else profile.white_balance_model.temperature_range
        self.tint.disabled = self.kelvin.disabled = kelvins is None
        self.multipliers.disabled = through_reference
        other_ways = [
            LABEL_AS_SHOT,
            *([BY_TEMPERATURE] if kelvins else []),
            *([] if through_reference else [BY_MULTIPLIERS]),
        ]
        styles = sorted(profile.styles, key=lambda name: name.lower() != "standard")
        usual = usual_setting(profile)
        offered = {self.style: styles, self.balance: [*profile.white_balances, *other_ways]}
        for (widget, values), usual_value in zip(offered.items(), usual.rsplit("/", 1), strict=True):
            chosen = widget.value if widget.value in values else "" if self.unknown else usual_value
            widget.options = {**self.unknown, **{value: value for value in values}}
            widget.value = chosen
        if kelvins is not None:
            low, high = round(kelvins[0] + 50, -2), round(kelvins[1] - 50, -2)
            self.kelvin.param.update(start=low, end=high, value=min(max(self.kelvin.value, low), high))
        self.follow()

    def follow(self) -> None:
        """Let the temperature be that of the chosen white balance, and multipliers begin with the usual ones."""
        preset = self.profile.white_balances.get(self.balance.value)
        if preset is not None and preset.kelvin is not None:
            ui.set_possible(self.kelvin, preset.kelvin)
        if self.balance.value == BY_MULTIPLIERS and not ui.written(self.multipliers):
            gains = self.profile.multipliers(usual_setting(self.profile))
            begin = ",".join(f"{gain:.4g}" for gain in gains / gains[1])
            self.multipliers.param.update(value=begin, value_input=begin)

    def set(self, selector: Selector) -> None:
        """Set the settings of a photograph: by its preset, where it has one of those offered, else as it was shot."""
        preset = selector.white_balance in self.balance.options.values()
        self.style.value = selector.style
        self.tint.value = 0
        self.balance.value = selector.white_balance if preset else LABEL_AS_SHOT

    def text(self, taken: Selector | None) -> str:
        """The selector that is set, STYLE/WB. Raises WorkspaceError where it is not complete, SettingsError.

        taken: the settings of the photograph, which "as shot" means; None where they are not known.
        """
        style = self.style.value
        tint = 0.0 if self.tint.disabled else self.tint.value
        balance = self._white_balance(taken)
        if not tint:
            return f"{style}/{balance}"
        # A name or a temperature takes its tint in words; multipliers, and the temperature of a file, are shifted.
        if "," not in balance and not (self.balance.value == LABEL_AS_SHOT and balance.lower().endswith("k")):
            return f"{style}/{balance}{tint:+g}"
        shifted = self.profile.shifted(self.profile.multipliers(f"{style}/{balance}"), Shift(tint=tint))
        return f"{style}/" + ",".join(f"{value:.6g}" for value in shifted.rgb)

    def _white_balance(self, taken: Selector | None) -> str:
        """The white balance without its tint, as a selector names it. Raises WorkspaceError where it is not known."""
        chosen = str(self.balance.value)
        if chosen == BY_TEMPERATURE:
            return f"{self.kelvin.value:g}K"
        if chosen == BY_MULTIPLIERS:
            return ui.written(self.multipliers)
        if chosen != LABEL_AS_SHOT:
            return chosen
        if taken is None:
            raise WorkspaceError("the photograph does not tell its white balance: choose one")
        return str(taken.white_balance)


def in_short(setting: Selector | str) -> str:
    """STYLE/WB as people read it: multipliers with four digits."""
    return re.sub(r"\d+\.\d{4,}", lambda number: f"{float(number[0]):.4g}", str(setting))
