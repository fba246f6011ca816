"""`lutforge config`: profiles → an OpenColorIO config."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import argument, option, progress_bar, say


def config(
    profiles: Annotated[list[Path], argument("Profiles (.npz).")],
    output: Annotated[Path, option("A folder, or one archive (.ocioz).", "-o", "--output")] = Path("ocio"),
    merge: Annotated[
        str | None, option("A config (.ocio, .ocioz, or the name of a built-in one) to add the cameras to.")
    ] = None,
    replace: Annotated[bool, option("Replace the config that the folder holds.", "--replace")] = False,
) -> None:
    """Write an OpenColorIO config with the cameras' RAW and JPEG colour spaces, views and refinish looks."""
    from lutforge.pipeline.configs import write_config

    with progress_bar("config") as progress:
        written = write_config(profiles, output, merge=merge, replace=replace, progress=progress)
    counts = ((written.spaces, "input colour spaces"), (written.views, "view transforms"), (written.looks, "looks"))
    held = ", ".join(f"{len(entries)} {title}" for entries, title in counts)
    say(f"{written.path}: profile version {written.version}, checked: {held}")
