"""Use case: pictures in place of RAW: those that a program developed, or any two renderings of the same frames."""

from __future__ import annotations  # so that help() shows the names of types

from pathlib import Path
from typing import TYPE_CHECKING

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import SettingsError, ShotError
from lutforge.pipeline.file_kinds import PAIRED_SUFFIXES
from lutforge.pipeline.sampling import RawSubstitute, SampledShots, sample_each
from lutforge.progress import Progress, silent
from lutforge.threads import cores

if TYPE_CHECKING:  # imported in functions: tables are read without the decoders of RAW files
    from lutforge.images.developed import Development
    from lutforge.shots.read import Shot


def raw_substitute(developed: str | Path | None, developed_space: str | None) -> RawSubstitute | None:
    """The function that returns the picture to use in place of a RAW file; None where RAW itself is used.

    developed: a folder of pictures, one for each shot, of the same stem; developed_space: their encoding. Raises
    SettingsError where only one of the two is given.
    """
    if developed is None:
        if developed_space is not None:
            raise SettingsError("--developed-space names the space of the pictures in --developed: give both")
        return None
    if developed_space is None:
        raise SettingsError("--developed needs --developed-space, the space that its pictures are encoded in")
    from lutforge.images.developed import read_developed

    space = rgb_space(developed_space).name
    pictures = _pictures(Path(developed))

    def read(raw: Path) -> Development:
        picture = pictures.get(raw.stem.lower())
        if picture is None:
            raise ShotError(f"{raw}: {developed} holds no picture of that name ({', '.join(PAIRED_SUFFIXES[:3])})")
        return read_developed(picture, space)

    return read


def sample_pairs(
    from_folder: str | Path, to_folder: str | Path, from_space: str, progress: Progress = silent
) -> SampledShots:
    """Sample two renderings of the same frames: pictures of the same stem in two folders.

    from_space: the encoding of the pictures in the first folder; those in the second are sRGB.
    """
    from lutforge.images.developed import read_developed
    from lutforge.shots.read import read_pair

    space = rgb_space(from_space).name
    first, second = _pictures(Path(from_folder)), _pictures(Path(to_folder))
    stems = sorted(first.keys() & second.keys())
    if not stems:
        raise ShotError(f"{from_folder}, {to_folder}: no picture of one has the name of a picture of the other")

    def read(stem: str, file: Path) -> Shot:
        return read_pair(second[stem], read_developed(file, space))

    return sample_each({stem: first[stem] for stem in stems}, read, progress, cores())


def _pictures(folder: Path) -> dict[str, Path]:
    """The pictures of a folder by stem, in lower case."""
    if not folder.is_dir():
        raise ShotError(f"{folder}: no such folder")
    # Several pictures may have one stem. The preferred kind is sorted last, so that it replaces the others.
    pictures = [path for kind in reversed(PAIRED_SUFFIXES) for path in folder.iterdir() if path.suffix.lower() == kind]
    return {path.stem.lower(): path for path in pictures}
