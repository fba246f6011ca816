"""What every kit is made of: the camera's look in the space that a program feeds to a LUT, and the files around it."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.model.camera_profile import CameraProfile

Source = Literal["raw", "developed", "any"]
"""What a kit can be made from: a profile of RAW files, one of developed pictures, or either."""


@dataclass(frozen=True, eq=False)
class Look:
    """A camera's look: from what the profile was calibrated on, RAW or developed pictures, to the camera's JPEG.

    render: that input, white-balanced, (…, 3) on [0, 1] → encoded sRGB. multipliers: (3,), the white balance of the
    setting, times its gain.
    """

    profile: CameraProfile
    style: str
    white_balance: str
    render: Callable[[Array], Array]
    multipliers: Array

    @property
    def camera(self) -> str:
        """The camera's name."""
        return self.profile.camera

    @property
    def to_srgb(self) -> Array:
        """(3, 3): white-balanced input → linear sRGB."""
        return self.profile.matrix

    @property
    def space(self) -> str:
        """What the input is in: "raw", or the linear space of the developed pictures."""
        return self.profile.raw_space

    @property
    def developer(self) -> str:
        """The program that developed the pictures, or ""."""
        return self.profile.developer

    @property
    def title(self) -> str:
        """The look's name, for menus."""
        return f"{self.camera} {self.style}"

    @property
    def file_name(self) -> str:
        """Camera and setting, for the name of a file that shares a folder with those of other looks; no suffix."""
        return re.sub(r"[^\w .+-]", "_", f"{self.title} {self.white_balance}")[:120]

    def within(self, space: str) -> Callable[[ArrayLike], Array]:
        """Give the look as a function of colours encoded in `space`, to colours encoded in the same space."""
        return self.between(space, space)

    def between(self, source: str, target: str) -> Callable[[ArrayLike], Array]:
        """Give the look as a function of colours encoded in `source`, to colours encoded in `target`.

        For a profile of developed pictures this is what was calibrated. For one of RAW files it is approximate: the
        program's light goes back to camera RGB by one matrix.
        """
        encoded, wanted, srgb = rgb_space(source), rgb_space(target), rgb_space("srgb")
        to_left = matrix_between(encoded.linear.name, "linear-srgb" if self.space == "raw" else self.space)
        if self.space == "raw":
            to_left = np.linalg.inv(self.to_srgb) @ to_left
        from_srgb = matrix_between("linear-srgb", wanted.linear.name)

        def look(x: ArrayLike) -> Array:
            left = np.clip(encoded.decode(x) @ to_left.T, 0.0, 1.0)
            light = srgb.decode(np.clip(self.render(left), 0.0, 1.0))
            return wanted.encode(np.maximum(light @ from_srgb.T, 0.0))

        return look


def look_of(profile: CameraProfile, to: str) -> Look:
    """Return the camera's look at a setting, STYLE/WB. Raises SettingsError, ProfileError on an unknown one."""
    selector = profile.selector(to)
    multipliers = profile.multipliers(selector)
    rendering = profile.render(selector)

    def render(balanced: Array) -> Array:
        return rendering(np.asarray(balanced) / multipliers)

    return Look(profile, selector.style, str(selector.white_balance), render, multipliers)


@dataclass(frozen=True)
class Kit(ABC):
    """How one program shows a look.

    program: the name that `--for` takes; title: for people; source: what the kit can be made from; tried: what it was
    tried with, or that it could not be run.
    """

    program: str
    title: str
    source: Source
    tried: str

    @abstractmethod
    def write(self, look: Look, folder: Path) -> list[str]:
        """Fill an empty folder; return the steps that lead to the look, for the README."""
