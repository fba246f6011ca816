"""Use case: calibrate on pictures instead of RAW: what a program exported, or any rendering of the frames."""

from pathlib import Path

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import SettingsError, ShotError
from lutforge.images.development import Development, read_developed
from lutforge.pipeline.sampling import RawSubstitute, SampledShots, sample_each
from lutforge.progress import Progress, silent
from lutforge.shots.pair import read_pair
from lutforge.shots.shot import Shot
from lutforge.threads import cores

PAIRED_SUFFIXES = (".tif", ".tiff", ".exr", ".png", ".jpg", ".jpeg")
"""Kinds of pictures that are paired, the best first."""


def raw_substitute(developed: str | Path | None, developed_space: str | None) -> RawSubstitute | None:
    """Return the function that gives the picture to use instead of a RAW file; None where the RAW itself is used.

    developed: a folder of pictures, one a shot with its stem, encoded in developed_space. Raises SettingsError where
    one is given without the other.
    """
    if developed is None and developed_space is None:
        return None
    if developed is None:
        raise SettingsError("--developed-space names the space of the pictures in --developed: give both")
    if developed_space is None:
        raise SettingsError("--developed needs --developed-space, the space that its pictures are encoded in")
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

    from_space: the space that the pictures of the first folder are encoded in; those of the second are sRGB. Raises
    ShotError where no pair is usable, SettingsError on an unknown space.
    """
    space = rgb_space(from_space).name
    first, second = _pictures(Path(from_folder)), _pictures(Path(to_folder))
    stems = sorted(first.keys() & second.keys())
    if not stems:
        raise ShotError(f"{from_folder}, {to_folder}: no picture of one has the name of a picture of the other")
    files = {stem: first[stem] for stem in stems}

    def read(stem: str, file: Path) -> Shot:
        return read_pair(second[stem], read_developed(file, space))

    return sample_each(files, read, progress, cores())


def _pictures(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise ShotError(f"{folder}: no such folder")
    # Of several of one stem the best kind comes last, and stays.
    found = [path for kind in reversed(PAIRED_SUFFIXES) for path in folder.iterdir() if path.suffix.lower() == kind]
    return {path.stem.lower(): path for path in found}
