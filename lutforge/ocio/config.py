"""An OpenColorIO config whose colour spaces, views and looks are cameras."""

import shutil
import zipfile
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from threading import Lock

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.errors import ConfigError
from lutforge.inverse.linearization import SIZE
from lutforge.luts.formats.text import write_text
from lutforge.luts.sequence import OCIO_ERRORS
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.base_config import DATA, DISPLAYS, LUT_FOLDER, UN_TONE_MAPPED, base_config
from lutforge.ocio.cameras import Camera, UniqueNames, config_names, name_cameras
from lutforge.ocio.merge import BaseConfig, merged, open_base
from lutforge.ocio.renderings import STEPS, Rendering, baked, compact_text, renderings
from lutforge.ocio.spaces import (
    REFINISH,
    add_contextual,
    add_jpegs,
    add_looks,
    add_raw,
    add_views,
    any_names,
    camera_rules,
    default_balances,
    put_first,
)
from lutforge.progress import Progress, silent
from lutforge.threads import each, one_blas_thread

ARCHIVE_SUFFIX = ".ocioz"
CONFIG_NAME = "config.ocio"

NO_FOLDERS = (".ocio", ".zip", ".npz", ".clf", ".cube")
"""Suffixes of files, which a folder's name should not have."""


def build_config(
    profiles: Sequence[CameraProfile | str | Path],
    folder: str | Path | None = None,
    *,
    merge: str | Path | None = None,
) -> OCIO.Config:
    """Build an OpenColorIO config with the given cameras in memory; `config.serialize()` is its text.

    Its JPEG colour spaces refer to files in `luts/`, relative to the config, which `write_config` makes.

    Args:
        profiles: profiles, or the paths of their files.
        folder: that of `luts/`, for use of the config from memory.
        merge: a config to add the cameras to, a file or the name of a built-in one; it keeps its own colour spaces.

    Returns:
        The config (PyOpenColorIO.Config).

    Raises:
        ConfigError: profiles and config to merge do not go together.
        ProfileError: a profile cannot be read.
    """
    with open_base(merge) as base:
        cameras, parts = _plan(profiles, base)
        config = _assembled(cameras, parts, base, {})
    if folder is not None:
        config.setWorkingDir(str(folder))
    return config


def write_config(
    profiles: Sequence[CameraProfile | str | Path],
    target: str | Path,
    *,
    merge: str | Path | None = None,
    replace: bool = False,
    inverse_size: int = SIZE,
    progress: Progress = silent,
) -> Path:
    """Write a config and its LUTs, to a folder (config.ocio, luts/) or to one archive (.ocioz).

    The same profiles make the same bytes. replace: a folder that holds a config already gets this one in its place; its
    other files stay. inverse_size: nodes per axis of JPEG → scene, the inverse of each render. Returns the path
    of the config. Raises ConfigError, LutError, LutForgeError.
    """
    target = Path(target)
    if target.suffix.lower() == ARCHIVE_SUFFIX:
        if target.is_dir():
            raise ConfigError(f"{target}: is a folder; name a file that ends in {ARCHIVE_SUFFIX}")
        with scratch_folder(beside=None if "$" in str(target.absolute()) else target) as folder:
            write_config(profiles, folder, merge=merge, inverse_size=inverse_size, progress=progress)
            files = sorted(path for path in folder.rglob("*") if path.is_file())
            files.sort(key=lambda path: path.name != CONFIG_NAME)  # readers look for it first
            with (
                atomic_path(target) as temporary,
                zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
            ):
                for path in files:
                    entry = zipfile.ZipInfo(path.relative_to(folder).as_posix())  # without a clock time
                    entry.compress_type = zipfile.ZIP_DEFLATED
                    entry.external_attr = 0o644 << 16
                    archive.writestr(entry, path.read_bytes(), compresslevel=9)
        return target
    _require_usable(target, replace)
    with open_base(merge) as base:
        cameras, parts = _plan(profiles, base)
        texts, errors = _all_baked(parts, inverse_size, progress)
        config = _assembled(cameras, parts, base, errors)
        if base is not None and base.folder is not None:
            for file in base.files:
                (target / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(base.folder / file, target / file)
    for old in (target / LUT_FOLDER).glob("*.clf") if replace and base is None else ():
        if old.name not in texts:
            old.unlink()
    for name, text in texts.items():
        write_text(target / LUT_FOLDER / name, text, "utf-8")
    path = target / CONFIG_NAME
    with atomic_path(path) as temporary:
        temporary.write_text(config.serialize(), encoding="utf-8", newline="\n")
    progress("done", 1.0)
    return path


@one_blas_thread
def _all_baked(
    parts: Sequence[Rendering], inverse_size: int, progress: Progress
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """Bake renderings, as many beside each other as there are cores; a single one has all cores for itself.

    Returned are the texts of their files by name, and what is known of their error by stem.
    """
    begun, telling, texts, errors = count(), Lock(), dict[str, str](), dict[str, tuple[str, ...]]()

    def bake_one(rendering: Rendering) -> tuple[dict[str, str], tuple[str, ...]]:
        def tell(what: str) -> None:
            with telling:
                progress(f"{rendering.camera.name} {rendering.style}: {what}", next(begun) / (STEPS * len(parts)))

        luts, errors = baked(rendering, inverse_size, tell)
        return {name: compact_text(lut) for name, lut in luts.items()}, errors

    made = each(bake_one, parts) if len(parts) > 1 else map(bake_one, parts)
    for rendering, (files, lines) in zip(parts, made, strict=True):
        texts |= files
        errors[rendering.stem] = lines
    return texts, errors


def _require_usable(target: Path, replace: bool) -> None:
    """Raise ConfigError where OpenColorIO could not read the folder, or other things are in it."""
    if "$" in str(target.absolute()):
        raise ConfigError(f"{target}: OpenColorIO finds no LUTs in a folder with $ in its path; choose another")
    if target.suffix.lower() in NO_FOLDERS:
        raise ConfigError(f"{target}: a config is a folder that holds {CONFIG_NAME}, or an archive ({ARCHIVE_SUFFIX})")
    if target.exists() and not target.is_dir():
        raise ConfigError(f"{target}: is a file; name a folder, or an archive that ends in {ARCHIVE_SUFFIX}")
    if target.is_dir() and any(target.iterdir()):
        known = (target / CONFIG_NAME).is_file()
        if not known:
            raise ConfigError(f"{target}: the folder is not empty; choose another, or an archive ({ARCHIVE_SUFFIX})")
        if not replace:
            raise ConfigError(f"{target}: there is a config already; choose another folder, or replace it (--replace)")


def _plan(
    profiles: Sequence[CameraProfile | str | Path], base: BaseConfig | None
) -> tuple[tuple[Camera, ...], tuple[Rendering, ...]]:
    """Name the cameras and list their renderings, without clashes with a base config and its files."""
    cameras = name_cameras(profiles, config_names(base_config() if base is None else base.config))
    stems = [] if base is None else [file.stem.lower() for file in base.files]
    return cameras, renderings(cameras, [stem.removesuffix("_render").removesuffix("_linearize") for stem in stems])


def _assembled(
    cameras: Sequence[Camera],
    parts: Sequence[Rendering],
    base: BaseConfig | None,
    errors: Mapping[str, tuple[str, ...]],
) -> OCIO.Config:
    """The whole config, valid. errors: what is known of the LUTs of a rendering, by its stem."""
    config = base_config()
    defaults = default_balances(parts)
    groups: dict[object, str] = {}
    for camera in cameras:
        add_raw(config, camera, groups)
    for rendering in parts:
        default = defaults[rendering.camera.name, rendering.style]
        add_jpegs(config, rendering, default, groups, errors.get(rendering.stem, ()))
    any_camera = any_names(None if base is None else base.config)
    add_contextual(config, cameras, any_camera)
    looks = set() if base is None else {name.lower() for name in base.config.getLookNames()}
    refinish = None if base is None else base.config.getLook(REFINISH)
    if refinish is not None and refinish.getProcessSpace() == any_camera[0]:
        looks.remove(REFINISH.lower())  # of an earlier merge: it is used again
    add_looks(config, cameras, parts, UniqueNames(looks), any_camera[0])
    views = add_views(config, parts, defaults, UniqueNames(base.views if base is not None else ()))
    for display in DISPLAYS:  # the shared views in this order, the one without a tone scale, and the values as such
        for view in (*views, UN_TONE_MAPPED):
            config.addDisplaySharedView(display, view)
        config.addDisplayView(display, DATA, DATA, "")
        config.addActiveDisplay(display)
    for view in (*views, UN_TONE_MAPPED, DATA):  # the order of the menus; the first is the default
        config.addActiveView(view)
    rules = camera_rules(cameras, parts)
    if base is not None:
        config = merged(base, config, views, rules)
    else:
        put_first(config, rules)
    try:
        config.validate()
    except OCIO_ERRORS as error:
        raise ConfigError(f"the config is not valid: {error}") from error
    return config
