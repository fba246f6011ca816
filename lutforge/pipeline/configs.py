"""Use case: profiles → an OpenColorIO config, checked."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import ConfigError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import Developed
from lutforge.ocio.cameras import as_profiles
from lutforge.ocio.check import check_config, load_config
from lutforge.ocio.common import OLDEST
from lutforge.ocio.config import ARCHIVE_SUFFIX, CONFIG_NAME
from lutforge.ocio.config import write_config as write
from lutforge.ocio.merging import open_base
from lutforge.pipeline.outputs import check_output
from lutforge.progress import Progress, silent, with_compilation


@dataclass(frozen=True)
class WrittenConfig:
    """A config that was written. spaces: the cameras' colour spaces; notes: on problems that the base had already."""

    path: Path
    config: OCIO.Config
    version: str
    spaces: tuple[str, ...]
    views: tuple[str, ...]
    looks: tuple[str, ...]
    notes: tuple[str, ...] = ()


def write_config(
    profiles: Sequence[CameraProfile | str | Path],
    output: str | Path,
    *,
    merge: str | Path | None = None,
    replace: bool = False,
    looks: Sequence[str] = (),
    profile_version: str = OLDEST,
    progress: Progress = silent,
) -> WrittenConfig:
    """Write an OpenColorIO config of profiles, and check it as `ociocheck` would.

    Args:
        profiles: profiles, or the paths of their files.
        output: a new folder, or an archive (.ocioz).
        merge: a config to add the cameras to: a file, or the name of a built-in one.
        replace: overwrite the config that the folder holds.
        looks: white balances; looks change all others to the first, and back. Without them: all to daylight.
        profile_version: "2.1", or "2.5" with interoperability IDs and viewing rules.
        progress: called with the name of the present step, and the share that is done.

    Returns:
        The path, the cameras' colour spaces, views and looks, `config`, as OpenColorIO reads it, and notes.

    Raises:
        ConfigError: profiles, folder and config to merge do not go together, or the check failed.
        ProfileError: a profile cannot be read.
        LutForgeError: nothing can be written there. All but the failed check is raised before the work.
    """
    output = Path(output)
    loaded = _checked_profiles(profiles, output, merge)
    with with_compilation(progress) as reporting:
        # The base is checked before anything is written, since it may be replaced.
        with open_base(merge) as base:
            known_problems = {} if base is None else {problem.where: problem for problem in check_config(base.config)}
        path = write(
            loaded, output, merge=merge, replace=replace, looks=looks, profile_version=profile_version,
            progress=reporting,
        )  # fmt: skip

    config = load_config(path)
    if problems := [problem for problem in check_config(config) if problem.where not in known_problems]:
        listed = "; ".join(map(str, problems))
        raise ConfigError(f"{path}: the config was written, but does not pass its check: {listed}")
    return WrittenConfig(
        path,
        config,
        f"{config.getMajorVersion()}.{config.getMinorVersion()}",
        tuple(space.getName() for space in config.getColorSpaces() if space.getFamily().startswith("Input/")),
        tuple(config.getViewTransformNames()),
        tuple(config.getLookNames()),
        tuple(f"{merge}: {problem}; it was so before, and stays" for problem in known_problems.values()),
    )


def _checked_profiles(
    profiles: Sequence[CameraProfile | str | Path], output: Path, merge: str | Path | None
) -> list[CameraProfile]:
    """The profiles, loaded. Raises LutForgeError where a config cannot be written of them, or to the output."""
    paths = profiles if isinstance(profiles, list | tuple) else ()
    inputs = [entry for entry in (*paths, merge) if isinstance(entry, str | Path)]
    is_archive = output.suffix.lower() == ARCHIVE_SUFFIX
    check_output(output if is_archive else output / CONFIG_NAME, inputs=inputs)
    loaded = as_profiles(profiles)
    for profile in loaded:
        if isinstance(profile.provenance, Developed):
            raise ConfigError(
                f"{profile.camera}: the profile is of {profile.provenance}; a config needs one of RAW files, "
                "lutforge calibrate SHOT… -o camera.npz"
            )
    return loaded
