"""The command that writes OpenColorIO configs."""

from pathlib import Path
from typing import Annotated

import lutforge as lf
from lutforge.cli.console import argument, note, option, progress_bar, say


def config(
    profiles: Annotated[list[Path], argument("Profiles (.npz).")],
    output: Annotated[Path, option("A folder, or one archive (.ocioz).", "-o", "--output")] = Path("ocio"),
    merge: Annotated[
        str | None,
        option("A config to add the cameras to: a file, the name of a built-in one, or blender, for its own."),
    ] = None,
    replace: Annotated[bool, option("Replace the config that the folder holds.", "--replace")] = False,
    looks: Annotated[
        str | None,
        option("White balances, such as daylight,tungsten: looks change the others to the first, and back."),
    ] = None,
    profile_version: Annotated[str, option("2.1, or 2.5 with interoperability IDs and rules of views.")] = "2.1",
) -> None:
    """Write an OpenColorIO config with the cameras' RAW and JPEG colour spaces, views and refinish looks."""
    balances = [] if looks is None else [name.strip() for name in looks.split(",")]
    with progress_bar("config") as progress:
        written = lf.write_config(
            profiles, output, merge=merge, replace=replace, looks=balances, profile_version=profile_version,
            progress=progress,
        )  # fmt: skip
    note(*written.notes)
    counts = ((written.spaces, "input colour spaces"), (written.views, "view transforms"), (written.looks, "looks"))
    contents = ", ".join(f"{len(entries)} {title}" for entries, title in counts)
    say(f"{written.path}: profile version {written.version}, checked: {contents}")
