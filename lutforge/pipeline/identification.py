"""Use case: pictures that do not tell their camera, and profiles → which of these rendered them, with a probability."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import ImageError, ProfileError
from lutforge.identification.evidence import read_evidence
from lutforge.identification.judgement import Judgement, judge
from lutforge.identification.rendering import Rendering, renderings
from lutforge.model.camera_profile import load_profile
from lutforge.pipeline.outputs import PROFILE_SUFFIXES, Paths, several


@dataclass(frozen=True, eq=False)
class KnownCameras:
    """The renderings that pictures are compared with, and one line for each profile that cannot take part."""

    renderings: tuple[Rendering, ...]
    left_out: tuple[str, ...] = ()


def known_cameras(profiles: Paths) -> KnownCameras:
    """Read profiles, or folders of them. Raises ProfileError where none of them can be compared with a picture."""
    files: list[Path] = []
    for path in map(Path, several(profiles)):
        found = (
            sorted(file for file in path.iterdir() if file.suffix.lower() in PROFILE_SUFFIXES)
            if path.is_dir()
            else [path]
        )
        if not found:
            raise ProfileError(f"{path}: no camera profile (.npz) in this folder")
        files += found
    known: list[Rendering] = []
    left_out = []
    for file in files:
        try:
            known += renderings(load_profile(file))
        except ProfileError as error:
            left_out.append(str(error))
    if not known:
        raise ProfileError("no profile to compare with: " + "; ".join(left_out))
    return KnownCameras(tuple(known), tuple(left_out))


def identify(image: str | Path, cameras: KnownCameras | Paths) -> Judgement:
    """Say which camera, picture style and white balance rendered a picture, by its pixels alone.

    cameras: profiles (.npz) or folders of them, or `known_cameras` of these where many pictures are asked for.
    Raises ImageError for what is no picture or shows too little, ProfileError where no profile can be used.
    """
    known = cameras if isinstance(cameras, KnownCameras) else known_cameras(cameras)
    if Path(image).is_dir():
        raise ImageError(f"{image}: is a folder; name pictures in it")
    return judge(read_evidence(image), known.renderings)
