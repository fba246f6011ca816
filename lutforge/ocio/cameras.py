"""The names of cameras in a config: unique, valid in programs, file systems and archives, and new to a base config."""

import hashlib
import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.errors import ConfigError, alternatives
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import ReferenceRaw, ResponseOnly

_SIGNS = " ._()-"


def part_name(text: str, fallback: str = "unnamed") -> str:
    """One part of a name, of at most 64 characters.

    It holds letters and digits of any script, Latin letters without accents, and . _ ( ) -
    """
    return _cleaned(text)[:64].rstrip() or fallback


def _cleaned(text: str) -> str:
    """A text with the characters of `part_name`; others become spaces."""
    characters: list[str] = []
    for character in unicodedata.normalize("NFKD", text):
        if unicodedata.category(character).startswith("M"):  # an accent, which only Latin letters lose
            characters.append(character if characters and not characters[-1].isascii() else "")
        else:
            characters.append(character if character in _SIGNS or character.isalnum() else " ")
    words = unicodedata.normalize("NFC", "".join(characters)).split()
    return " ".join(words).lstrip("-. ")


def space_name(*parts: str) -> str:
    """The name of a colour space, look or view, joined from the names of its parts."""
    return " ".join(filter(None, parts))


def file_stem(*parts: str) -> str:
    """A file name without suffix: lower case ASCII letters, digits and single underscores.

    Letters of other scripts become their code points, so that different names stay different. Of a long name the end
    becomes a digest.
    """
    text = _cleaned(" ".join(parts)).lower()
    ascii_only = "".join(character if character.isascii() else f"u{ord(character):x}" for character in text)
    stem = re.sub(r"[^a-z0-9]+", "_", ascii_only).strip("_") or "lut"
    if len(stem) <= 100:
        return stem
    digest = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{stem[:91].rstrip('_')}_{digest}"


class UniqueNames:
    """A source of unique names: a name that was returned before, in upper or lower case, gets a number."""

    def __init__(self, taken: Iterable[str] = (), separator: str = " ") -> None:
        self._taken = {name.lower() for name in taken}
        self._separator = separator

    def __contains__(self, name: str) -> bool:
        return name.lower() in self._taken

    def __call__(self, name: str) -> str:
        """The name, or the name with the first number that makes it new."""
        candidate = name
        number = 2
        while candidate in self:
            candidate = f"{name}{self._separator}{number}"
            number += 1
        self._taken.add(candidate.lower())
        return candidate


def config_names(config: OCIO.Config) -> set[str]:
    """Every name of a config that a colour space may not take, in lower case: spaces, named transforms, roles."""
    spaces = [*config.getColorSpaces(OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL)]
    spaces += [*config.getNamedTransforms(OCIO.NAMEDTRANSFORM_ALL)]
    names = [name for space in spaces for name in (space.getName(), *space.getAliases())]
    return {name.lower() for name in (*names, *config.getRoleNames())}


JPEG, RAW_KIND, LINEAR = "JPEG", "RAW", "linear"
"""Kinds of colour spaces: of finished pictures, of RAW values, of the linear values of a camera without RAW."""
UNBALANCED = "unbalanced"
"""The word for RAW before white balance, in place of the name of one."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A profile, and the names in the config of its camera, styles and white balances, by their names in the profile.

    look_pairs: the white balances (from, to) that looks change, by the profile's names.
    """

    profile: CameraProfile
    name: str
    styles: dict[str, str]
    balances: dict[str, str]
    look_pairs: tuple[tuple[str, str], ...] = ()

    @property
    def family(self) -> str:
        """The family of its colour spaces."""
        return f"Input/{self.name}"

    @property
    def reference_balance(self) -> str:
        """The white balance under which a neutral of this camera is neutral in the reference space.

        It is daylight, or the white balance that comes nearest to it.
        """
        return _daylight(self.profile)

    def raw(self, balance: str | None = None) -> str:
        """The colour space of its RAW, or of its JPEGs' linear values, before white balance or after one."""
        kind = LINEAR if isinstance(self.profile.provenance, ReferenceRaw | ResponseOnly) else RAW_KIND
        return space_name(self.name, kind, self.balances[balance] if balance is not None else UNBALANCED)

    def jpeg(self, style: str, balance: str) -> str:
        """The colour space of its JPEGs in a style and white balance."""
        return space_name(self.name, JPEG, self.styles[style], self.balances[balance])

    def spaces(self) -> Iterator[str]:
        """Every colour space name that it takes."""
        yield self.raw()
        for balance in self.profile.white_balances:
            yield self.raw(balance)
            for style in self.profile.styles:
                yield self.jpeg(style, balance)

    def gain(self, balance: str) -> Array:
        """The multipliers (3,) of a white balance as the camera applies them, a factor common to all included."""
        return self.profile.white_balances[balance].factors

    def to_reference(self, balance: str | None) -> Array:
        """Camera RGB after a white balance, or before any (None) → ACES2065-1, (3, 3)."""
        gain = self.gain(self.reference_balance)
        if balance is not None:
            gain = gain / self.gain(balance)
        return np.asarray((from_linear_srgb("aces2065-1") @ self.profile.matrix) * gain)


def _daylight(profile: CameraProfile) -> str:
    """The white balance of a profile that is daylight, or comes nearest to it in mired."""
    balances = profile.white_balances

    def distance(name: str) -> tuple[bool, float]:
        kelvin = balances[name].kelvin
        daylight = 5200.0
        return (kelvin is None, abs(1e6 / (kelvin or daylight) - 1e6 / daylight))

    return "daylight" if "daylight" in balances else min(balances, key=distance)


def as_profiles(profiles: Sequence[CameraProfile | str | Path]) -> list[CameraProfile]:
    """Profiles, read from files where paths are given. Raises ConfigError on no list or an empty one, ProfileError."""
    if isinstance(profiles, CameraProfile | str | Path) or not isinstance(profiles, Sequence):
        raise ConfigError("a config is of a list of profiles: [profile]")
    if not profiles:
        raise ConfigError("a config needs at least one camera profile")
    return [as_profile(profile) for profile in profiles]


def name_cameras(
    profiles: Sequence[CameraProfile | str | Path], taken: Iterable[str] = (), looks: Sequence[str] = ()
) -> tuple[Camera, ...]:
    """The cameras of profiles, with names; a camera gets a number where a name of it is taken. Raises ConfigError.

    taken: names of colour spaces and aliases; looks: white balances, as in `_look_pairs`.
    """
    used = {name.lower() for name in taken}
    cameras: list[Camera] = []
    loaded = as_profiles(profiles)
    _require_balances(loaded, looks)
    for profile in loaded:
        if any(profile.is_same_calibration(camera.profile) for camera in cameras):
            raise ConfigError(f"the profile of {profile.camera} is given twice; name each profile once")
        styles = UniqueNames()
        balances = UniqueNames((UNBALANCED,))
        first = camera = Camera(
            profile,
            part_name(profile.camera, "camera"),
            {name: styles(part_name(name)) for name in profile.styles},
            {name: balances(part_name(name)) for name in profile.white_balances},
            _look_pairs(profile, looks),
        )
        for number in count(2):
            names = {name.lower() for name in (camera.name, *camera.spaces())}
            names |= {file_stem(name) for name in camera.spaces()}
            if used.isdisjoint(names):
                break
            camera = replace(first, name=f"{first.name} {number}")
        used |= names
        cameras.append(camera)
    return tuple(cameras)


def _require_balances(profiles: Sequence[CameraProfile], looks: Sequence[str]) -> None:
    """Raise ConfigError where a white balance for looks is in no profile, or there is only one."""
    balances = dict.fromkeys(name for profile in profiles for name in profile.white_balances)
    for name in looks:
        if name.lower() not in map(str.lower, balances):
            raise ConfigError(f'looks: no white balance "{name}"; {alternatives(name, balances)}')
    if looks and len({name.lower() for name in looks}) < 2:
        raise ConfigError(f"looks: name two white balances or more, such as {','.join([*looks[:1], *balances][:2])}")


def _look_pairs(profile: CameraProfile, looks: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """The white balances (from, to) that looks change.

    looks: white balances: each of the others to the first, and back. Without them: from every white balance to
    daylight, so that the number of looks grows with the number of white balances, not with its square.
    """
    if not looks:
        hub = _daylight(profile)
        return tuple((name, hub) for name in profile.white_balances if name != hub)
    by_lower = {name.lower(): name for name in profile.white_balances}
    balances = [by_lower[name] for name in dict.fromkeys(map(str.lower, looks)) if name in by_lower]
    return tuple(pair for name in balances[1:] for pair in ((name, balances[0]), (balances[0], name)))
