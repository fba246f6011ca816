"""The commands that read and write the thesis authors' model folders: import-nus and export-nus."""

from pathlib import Path
from typing import Annotated

import lutforge as lf
from lutforge.cli.console import Profile, ProfileOutput, argument, option, say
from lutforge.errors import ProfileError


def import_nus(
    folders: Annotated[list[Path], argument("Folders that hold raw2jpg_transform.txt.")],
    output: ProfileOutput = None,
    camera: Annotated[str, option("The camera's name; needed where their folder is not nus_MAKE_MODEL.")] = "",
    style: Annotated[str, option("The picture style that the folders are of.")] = "standard",
) -> None:
    """Read the thesis authors' model folders (response, matrix, white balances, gamut map) into a profile."""
    from lutforge.pipeline.file_kinds import PROFILE_SUFFIXES
    from lutforge.pipeline.outputs import check_output, named_or_new

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES)
    profile = lf.import_published(folders, camera, style.lower())
    profile.save(output)
    centres = sum(len(model.gamut_map.centres) for model in profile.styles[style.lower()].models)
    say(f"{output}: {profile.camera}, style {style.lower()}, {centres} control points")
    say(f"white balances: {', '.join(profile.white_balances)}")


def export_nus(
    profile: Profile,
    output: Annotated[Path, option("The folder to write.", "-o", "--output")],
    style: Annotated[str | None, option("The picture style, where there are several.")] = None,
) -> None:
    """Write a profile's camera models as the thesis authors' text files, a folder each, which import-nus reads."""
    from lutforge.model.published_model import export_published

    camera = lf.load_profile(profile)
    name = (style or (next(iter(camera.styles)) if len(camera.styles) == 1 else "")).lower()
    if name not in camera.styles:
        raise ProfileError(f"{camera.camera} has the styles {', '.join(camera.styles)}; name one with --style")
    for folder in export_published(camera, name, output):
        say(f"{folder}")
