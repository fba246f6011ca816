"""`lutforge config`: profiles → an OpenColorIO config."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import note, progress_bar, say
from lutforge.errors import ConfigError


def config(
    profiles: Annotated[list[Path], typer.Argument(help="Profiles (.npz).", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder, or one archive (.ocioz).")] = Path("ocio"),
    merge: Annotated[
        str | None,
        typer.Option(
            help="A config (.ocio, .ocioz, or the name of a built-in one) to add the cameras to.", show_default=False
        ),
    ] = None,
    ocio_version: Annotated[
        str | None,
        typer.Option(
            help="Profile version, 2.1 to 2.6: the oldest that will read it.", show_default="2.1, or --merge's"
        ),
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace the config that the folder holds.")] = False,
) -> None:
    """Write an OpenColorIO config with the cameras' RAW and JPEG colour spaces, views and refinish looks."""
    from lutforge.model.profile_file import load_profile
    from lutforge.ocio.check import check_config, load_config
    from lutforge.ocio.config import write_config
    from lutforge.ocio.versions import losses, minor_version

    if ocio_version is not None:
        for loss in losses(minor_version(ocio_version)):
            note(f"version {ocio_version}: {loss}")
    loaded = [load_profile(profile) for profile in profiles]
    with progress_bar("config") as progress:
        path = write_config(loaded, output, version=ocio_version, merge=merge, replace=replace, progress=progress)
    written = load_config(path)
    findings = check_config(written)
    for finding in findings:
        note(str(finding))
    if any(finding.severity == "error" for finding in findings):
        raise ConfigError(f"{path}: the config was written, but does not pass its check")
    looks, views = list(written.getLookNames()), list(written.getViewTransformNames())
    names = [space.getName() for space in written.getColorSpaces() if space.getFamily().startswith("Input/")]
    say(f"{path}: profile version {written.getMajorVersion()}.{written.getMinorVersion()}, checked")
    for title, entries in (("input colour spaces", names), ("view transforms", views), ("looks", looks)):
        say(f"{len(entries)} {title}:")
        for name in entries:
            say(f"  {name}")
