"""Transforms R³ → R³ that a calibrated camera offers: sequences of stages, evaluation only.

The stages are a closed set: what bakes a transform, or places it in a config, tells them apart by their types.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import RgbSpace
from lutforge.colour.srgb import checked_colours
from lutforge.errors import ImageError
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.neutral_highlights import NeutralHighlights
from lutforge.model.raw_transfer import RawTransfer
from lutforge.model.response import Response


@dataclass(frozen=True, eq=False)
class Gain:
    """A factor per channel, (3,): a white balance, or an exposure."""

    factors: Array

    def __call__(self, x: Array) -> Array:
        """Linear (…, 3) → linear."""
        return np.asarray(x * self.factors)


@dataclass(frozen=True, eq=False)
class MatrixStage:
    """A matrix (3, 3) between linear spaces."""

    matrix: Array

    def __call__(self, x: Array) -> Array:
        """Linear (…, 3) → linear."""
        return np.asarray(x @ self.matrix.T)


@dataclass(frozen=True)
class Clip:
    """The limits of a sensor or of an encoding: [0, 1]. NaN stays NaN."""

    def __call__(self, x: Array) -> Array:
        """(…, 3) → (…, 3)."""
        return np.clip(x, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Encode:
    """The camera response f, or the transfer function of an RGB space, such as a camera's log curve.

    What no code stands for is clipped: light below black, which strong colours have in a channel of a small gamut.
    """

    curve: Response | RgbSpace

    def __call__(self, x: Array) -> Array:
        """Linear (…, 3) → encoded in [0, 1]."""
        return np.clip(self.curve.encode(x), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Decode:
    """The inverse of `Encode`."""

    curve: Response | RgbSpace

    def __call__(self, x: Array) -> Array:
        """Encoded (…, 3) → linear."""
        return self.curve.linearize(x)


Stage = (
    Gain | MatrixStage | Clip | Encode | Decode | Lattice | GamutMap | SolvedInverse | NeutralHighlights | RawTransfer
)
"""Any stage: (…, 3) → (…, 3), float64. A lattice is h of the thesis, chapter 5; a gamut map h of chapter 4."""


def through_stages(stages: Sequence[Stage], x: Array) -> Array:
    """Colours (…, 3) through stages in their order."""
    for stage in stages:
        x = stage(x)
    return x


class PurposeKind(StrEnum):
    """The kinds of transforms: those that a profile offers, and any other function."""

    RENDER = "render"
    """RAW or a scene → JPEG."""
    LINEARIZE = "linearize"
    """JPEG → RAW or a scene."""
    REFINISH = "refinish"
    """JPEG → JPEG of the same camera."""
    MATCH = "match"
    """JPEG → JPEG of another camera."""
    OTHER = ""

    @property
    def is_between_jpegs(self) -> bool:
        """True where JPEG values come in and come out."""
        return self in (PurposeKind.REFINISH, PurposeKind.MATCH)

    @property
    def has_scene(self) -> bool:
        """True where RAW or a scene comes in or comes out."""
        return self in (PurposeKind.RENDER, PurposeKind.LINEARIZE)


@dataclass(frozen=True)
class Purpose:
    """The purpose of a transform of a profile.

    title: camera and settings in words. space: of the side that is not a JPEG, "raw" or a name of
    `lutforge.colour.rgb_spaces`; light: the same, but what replaces RAW by its name. source, target: STYLE/WB of the
    JPEG that comes in, and of the one that comes out. notes: for the user; comments: held-out errors, for files.
    """

    kind: PurposeKind = PurposeKind.OTHER
    title: str = ""
    space: str = "raw"
    light: str = "raw"
    source: str = ""
    target: str = ""
    notes: tuple[str, ...] = ()
    comments: tuple[str, ...] = ()

    @property
    def is_of_profile(self) -> bool:
        """True for a transform of a profile, False for any other function."""
        return self.kind is not PurposeKind.OTHER

    @property
    def takes_raw(self) -> bool:
        """True where camera RAW comes in."""
        return self.kind is PurposeKind.RENDER and self.space == "raw"

    @property
    def takes_footage(self) -> bool:
        """True where values of a colour space come in, linear or encoded, and no JPEG."""
        return self.kind is PurposeKind.RENDER and self.space != "raw"

    @property
    def gives_encoded(self) -> bool:
        """True where the output is encoded, so that ΔE00 has a meaning."""
        return self.kind is not PurposeKind.LINEARIZE


@dataclass(frozen=True, eq=False)
class Transform:
    """Stages in the order in which they are applied; none at all is the identity. purpose: what it is for."""

    stages: tuple[Stage, ...] = ()
    purpose: Purpose = Purpose()

    def __repr__(self) -> str:
        title = f"{self.purpose.kind} {self.purpose.title}: " if self.purpose.is_of_profile else ""
        return f"<Transform {title}{' → '.join(type(stage).__name__ for stage in self.stages) or 'identity'}>"

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at x (…, 3). NaN stays NaN. Raises ImageError on another shape or scale, and on integers."""
        values = checked_colours(x)
        clipped = any(isinstance(stage, Clip) for stage in self.without_gain().stages[:1])
        if clipped and np.count_nonzero(values > 2.0) > values.size / 2:  # so much is no overshoot
            raise ImageError(f"pixels up to {values.max():g}: scale them to [0, 1] first, such as pixels / 255.0")
        y = through_stages(self.stages, values)
        unknown = np.isnan(values).any(axis=-1, keepdims=True)
        return np.where(unknown, np.nan, y)

    @property
    def is_identity(self) -> bool:
        """True where there is nothing to change."""
        return not self.stages

    @property
    def gain(self) -> Array:
        """(3,), the white balance that comes first; 1 where none does."""
        first = self.stages[0] if self.stages else None
        return first.factors if isinstance(first, Gain) else np.ones(3)

    def without_gain(self) -> "Transform":
        """Return the transform behind its white balance."""
        return Transform(self.stages[1:]) if self.stages and isinstance(self.stages[0], Gain) else self

    def highest(self) -> float:
        """Return the largest value that an input channel can have in a colour that the first clip leaves alone."""
        front = np.eye(3)
        for stage in self.stages:
            if isinstance(stage, Gain | MatrixStage):
                front = stage(front.T).T
            else:
                break
        return float(np.maximum(np.linalg.inv(front), 0.0).sum(axis=1).max())
