"""What a refinish changes: the settings that a picture was made with, and those that are wanted of it."""

from dataclasses import dataclass

import numpy as np

from lutforge.model.camera_profile import CameraProfile, match
from lutforge.model.raw_transfer import RawTransfer
from lutforge.model.transform import Transform
from lutforge.settings import Selector


@dataclass(frozen=True)
class SettingChange:
    """From settings of one camera to others of its own, or of another camera.

    given: what `camera` made the picture with; wanted: of `look`, the camera whose look is wanted. ev: exposure change
    in stops. transfer: RAW → RAW between the two cameras, where one was measured.
    """

    camera: CameraProfile
    given: Selector
    look: CameraProfile
    wanted: Selector
    ev: float = 0.0
    transfer: RawTransfer | None = None

    @property
    def transform(self) -> Transform:
        """The refinish (6.1), exact to the model."""
        return match(self.camera, self.given, self.look, self.wanted, self.ev, transfer=self.transfer)

    @property
    def is_none(self) -> bool:
        """True where both settings render alike."""
        if self.look is not self.camera or self.ev or self.given.style != self.wanted.style:
            return False
        before, after = self.camera.multipliers(self.given), self.camera.multipliers(self.wanted)
        return bool(np.allclose(before, after, rtol=1e-4))

    def history(self, source: str) -> str:
        """What was done, in one line for an image's history. source: what the picture was, settings or RAW."""
        exposure = f", {self.ev:+g} EV" if self.ev else ""
        return f"{self.camera.camera}: {source} -> {self.look.camera}: {self.wanted}{exposure}"
