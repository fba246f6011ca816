"""`lutforge config`: profiles → an OpenColorIO config."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import note, say
from lutforge.errors import ConfigError


def config(
    profiles: Annotated[list[Path], typer.Argument(help="Profiles (.npz).", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder, or one archive (.ocioz).")] = Path("ocio"),
) -> None:
    """Write an OpenColorIO config with the cameras' RAW and JPEG colour spaces, views and white-balance looks."""
    from lutforge.model.profile_file import load_profile
    from lutforge.ocio.check import check_config, load_config
    from lutforge.ocio.config import write_config

    path = write_config([load_profile(profile) for profile in profiles], output)
    loaded = load_config(path)
    findings = check_config(loaded)
    for finding in findings:
        note(str(finding))
    if any(finding.severity == "error" for finding in findings):
        raise ConfigError(f"{path}: the config was written, but does not pass its check")
    names = list(loaded.getColorSpaceNames())
    say(f"{path}: {len(names)} colour spaces, checked")
    for name in names:
        say(f"  {name}")
