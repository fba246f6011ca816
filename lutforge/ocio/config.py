"""An OpenColorIO config with the colour spaces, views and looks of cameras, in memory or as files."""

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from threading import Lock

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.errors import ConfigError
from lutforge.inverse.linearization import INVERSE_SIZE
from lutforge.luts.ocio_transforms import OCIO_ERRORS
from lutforge.luts.writers.process_list import clf_text
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.camera_spaces import EqualityGroups, add_jpegs, add_raw
from lutforge.ocio.cameras import Camera, UniqueNames, config_names, name_cameras
from lutforge.ocio.common import LUT_FOLDER, OLDEST, add_file_rules, common_config, minor_version
from lutforge.ocio.looks import add_looks
from lutforge.ocio.memory import in_memory
from lutforge.ocio.merging import BaseConfig, merged, open_base
from lutforge.ocio.renderings import BAKE_STEPS, Rendering, baked, renderings
from lutforge.ocio.views import add_views, arrange_views
from lutforge.progress import Progress, silent
from lutforge.threads import each, one_blas_thread

ARCHIVE_SUFFIX = ".ocioz"
CONFIG_NAME = "config.ocio"

NO_FOLDERS = (".ocio", ".zip", ".npz", ".clf", ".cube")
"""Suffixes of files, which a folder's name should not have."""


@dataclass(frozen=True, eq=False)
class Built:
    """A config and the contents of its LUT files, by their paths relative to it."""

    config: OCIO.Config
    files: dict[str, bytes]


def build_config(
    profiles: Sequence[CameraProfile | str | Path],
    *,
    merge: str | Path | None = None,
    looks: Sequence[str] = (),
    profile_version: str = OLDEST,
    inverse_size: int = INVERSE_SIZE,
    progress: Progress = silent,
) -> OCIO.Config:
    """Build an OpenColorIO config with the given cameras in memory, with its LUTs, so that it can convert at once.

    It takes as long as `write_config`, because the LUTs are baked; they stay in memory until Python ends, since copies
    of the config share them. `config.serialize()` is the text of config.ocio, without the LUTs.

    Args:
        profiles: profiles, or the paths of their files.
        merge: a config to add the cameras to, a file or the name of a built-in one; it keeps its own colour spaces.
        looks: white balances; looks change all others to the first, and back. Without them: all to daylight.
        profile_version: the least OpenColorIO that reads it, "2.1" or "2.5".
        inverse_size: nodes per axis of JPEG → scene, the inverse of each render.
        progress: called with what is being done, and the share that is done.

    Returns:
        The config (PyOpenColorIO.Config).

    Raises:
        ConfigError: profiles and config to merge do not go together.
        ProfileError: a profile cannot be read.
    """
    with open_base(merge) as base:
        built = _built(profiles, base, looks, profile_version, inverse_size, progress)
    progress("done", 1.0)
    return in_memory(built.config, built.files)


def write_config(
    profiles: Sequence[CameraProfile | str | Path],
    target: str | Path,
    *,
    merge: str | Path | None = None,
    replace: bool = False,
    looks: Sequence[str] = (),
    profile_version: str = OLDEST,
    inverse_size: int = INVERSE_SIZE,
    progress: Progress = silent,
) -> Path:
    """Write a config and its LUTs, to a folder (config.ocio, luts/) or to one archive (.ocioz).

    The same profiles give the same bytes. replace: overwrite the config of a folder; its other files stay. The other
    arguments: as for `build_config`. Returns the path of the config. Raises ConfigError, LutError, LutForgeError.
    """
    target = Path(target)
    archive = target.suffix.lower() == ARCHIVE_SUFFIX
    _require_usable(target, replace)
    with open_base(merge) as base:
        built = _built(profiles, base, looks, profile_version, inverse_size, progress)
    text = built.config.serialize().encode()

    if archive:
        _write_archive(target, {CONFIG_NAME: text, **built.files})  # readers look for the config first
        progress("done", 1.0)
        return target

    # All files are written to a scratch folder first, so that a full disk leaves none.
    with scratch_folder(next_to=target) as folder:
        for name, content in {**built.files, CONFIG_NAME: text}.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        for name in (*built.files, CONFIG_NAME):  # the config last
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).replace(target / name)
    for old in (target / LUT_FOLDER).glob("*.clf") if replace and merge is None else ():
        if f"{LUT_FOLDER}/{old.name}" not in built.files:
            old.unlink()
    progress("done", 1.0)
    return target / CONFIG_NAME


def _write_archive(target: Path, files: Mapping[str, bytes]) -> None:
    """Write an .ocioz, without clock times."""
    with (
        atomic_path(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
    ):
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, compresslevel=9)


def _require_usable(target: Path, replace: bool) -> None:
    """Raise ConfigError where OpenColorIO could not read the folder, or it holds other files."""
    if target.suffix.lower() == ARCHIVE_SUFFIX:
        if target.is_dir():
            raise ConfigError(f"{target}: is a folder; name a file that ends in {ARCHIVE_SUFFIX}")
        return
    if "$" in str(target.absolute()):
        raise ConfigError(f"{target}: OpenColorIO finds no LUTs in a folder with $ in its path; choose another")
    if target.suffix.lower() in NO_FOLDERS:
        raise ConfigError(f"{target}: a config is a folder that holds {CONFIG_NAME}, or an archive ({ARCHIVE_SUFFIX})")
    if target.exists() and not target.is_dir():
        raise ConfigError(f"{target}: is a file; name a folder, or an archive that ends in {ARCHIVE_SUFFIX}")
    if target.is_dir() and any(target.iterdir()):
        if not (target / CONFIG_NAME).is_file():
            raise ConfigError(f"{target}: the folder is not empty; choose another, or an archive ({ARCHIVE_SUFFIX})")
        if not replace:
            raise ConfigError(f"{target}: there is a config already; choose another folder, or replace it (--replace)")


def _built(
    profiles: Sequence[CameraProfile | str | Path],
    base: BaseConfig | None,
    looks: Sequence[str],
    profile_version: str,
    inverse_size: int,
    progress: Progress,
) -> Built:
    """Name the cameras, bake their LUTs, and put the config together, merged with a base where there is one."""
    minor = minor_version(profile_version)
    cameras = name_cameras(profiles, config_names(common_config(minor) if base is None else base.config), looks)
    taken = [] if base is None else [file.stem.lower() for file in base.files]
    all_renderings = renderings(cameras, [stem.removesuffix("_render").removesuffix("_linearize") for stem in taken])
    texts, errors = _all_baked(all_renderings, inverse_size, progress)
    files = {f"{LUT_FOLDER}/{name}": text.encode() for name, text in texts.items()}
    files |= {} if base is None else base.contents()
    return Built(_assembled(cameras, all_renderings, base, errors, minor), dict(sorted(files.items())))


@one_blas_thread
def _all_baked(
    all_renderings: Sequence[Rendering], inverse_size: int, progress: Progress
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """The texts of the renderings' files by name, and the lines on their errors by stem; baked on all cores."""
    steps_begun = count()
    reporting = Lock()

    def bake_one(rendering: Rendering) -> tuple[dict[str, str], tuple[str, ...]]:
        def report_step(step: str) -> None:
            with reporting:
                share = next(steps_begun) / (BAKE_STEPS * len(all_renderings))
                progress(f"{rendering.camera.name} {rendering.style}: {step}", share)

        luts, errors = baked(rendering, inverse_size, report_step)
        return {name: clf_text(lut) for name, lut in luts.items()}, errors

    texts = dict[str, str]()
    errors = dict[str, tuple[str, ...]]()
    results = each(bake_one, all_renderings) if len(all_renderings) > 1 else map(bake_one, all_renderings)
    for rendering, (files, lines) in zip(all_renderings, results, strict=True):
        texts |= files
        errors[rendering.stem] = lines
    return texts, errors


def _assembled(
    cameras: Sequence[Camera],
    all_renderings: Sequence[Rendering],
    base: BaseConfig | None,
    errors: Mapping[str, tuple[str, ...]],
    minor: int,
) -> OCIO.Config:
    """The whole config, validated. errors: lines on the errors of a rendering's LUTs, by its stem."""
    config = common_config(minor)
    groups = EqualityGroups()
    for camera in cameras:
        add_raw(config, camera, groups)
    for rendering in all_renderings:
        add_jpegs(config, rendering, groups, errors.get(rendering.stem, ()))
    unique_look_name = UniqueNames(() if base is None else base.config.getLookNames())
    for camera in cameras:
        of_camera = [rendering for rendering in all_renderings if rendering.camera is camera]
        add_looks(config, camera, of_camera, unique_look_name)
    views = add_views(config, all_renderings, UniqueNames(() if base is None else base.views))
    arrange_views(config, [view.name for view in views])
    add_file_rules(config, [name for camera in cameras for name in camera.spaces()])
    if base is not None:
        config = merged(base, config, views)

    try:
        config.validate()
    except OCIO_ERRORS as error:
        raise ConfigError(f"the config is not valid: {error}") from error
    return config
