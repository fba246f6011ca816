"""Use case: profiles → an OpenColorIO config, checked."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import ConfigError
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.ocio.check import Finding, check_config, load_config
from lutforge.ocio.config import ARCHIVE_SUFFIX, CONFIG_NAME
from lutforge.ocio.config import write_config as write
from lutforge.ocio.versions import losses, minor_version
from lutforge.pipeline.outputs import check_output
from lutforge.pipeline.sample_origin import is_of_chart
from lutforge.progress import Progress, silent, telling_of_compilation


@dataclass(frozen=True)
class WrittenConfig:
    """A config that was written. spaces: the cameras' colour spaces; losses: what its version cannot hold."""

    path: Path
    version: str
    spaces: tuple[str, ...]
    views: tuple[str, ...]
    looks: tuple[str, ...]
    findings: tuple[Finding, ...]
    losses: tuple[str, ...]


def write_checked_config(
    profiles: Sequence[CameraProfile | str | Path],
    output: str | Path,
    *,
    version: str | None = None,
    merge: str | Path | None = None,
    replace: bool = False,
    progress: Progress = silent,
) -> WrittenConfig:
    """Write a config of profiles to a folder or an archive (.ocioz), and check it as `ociocheck` would.

    version: of the config, "2.1" to "2.6". merge: a config to add the cameras to. replace: the config in the folder.
    Raises ConfigError, ProfileError, and LutForgeError where nothing can be written; that is asked before the work.
    """
    output = Path(output)
    lost = losses(minor_version(version)) if version is not None else ()
    archive = output.suffix.lower() == ARCHIVE_SUFFIX
    inputs = [entry for entry in (*profiles, merge) if isinstance(entry, str | Path)]
    check_output(output if archive else output / CONFIG_NAME, inputs=inputs)
    loaded = [as_profile(profile) for profile in profiles]
    for profile in loaded:
        if profile.developer and not is_of_chart(profile):
            raise ConfigError(
                f"{profile.camera}: the profile is of {profile.developer}; a config needs one of RAW files, "
                "lutforge calibrate SHOT… -o camera.npz"
            )
    with telling_of_compilation(progress) as telling:
        path = write(loaded, output, version=version, merge=merge, replace=replace, progress=telling)
    config = load_config(path)
    findings = tuple(check_config(config))
    if any(finding.severity == "error" for finding in findings):
        told = "; ".join(str(finding) for finding in findings if finding.severity == "error")
        raise ConfigError(f"{path}: the config was written, but does not pass its check: {told}")
    return WrittenConfig(
        path,
        f"{config.getMajorVersion()}.{config.getMinorVersion()}",
        tuple(space.getName() for space in config.getColorSpaces() if space.getFamily().startswith("Input/")),
        tuple(config.getViewTransformNames()),
        tuple(config.getLookNames()),
        findings,
        tuple(lost),
    )
