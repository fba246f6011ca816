"""An OpenColorIO config whose colour spaces, views and looks are cameras."""

import shutil
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path, PurePosixPath
from threading import Lock

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.child_processes import OverrunError, guarded
from lutforge.errors import ConfigError, LutForgeError
from lutforge.inverse.linearization import SIZE
from lutforge.luts.formats import clf_text
from lutforge.luts.sequence import OCIO_ERRORS
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio import spaces
from lutforge.ocio.cameras import Camera, UniqueNames, config_names, name_cameras
from lutforge.ocio.check import file_names, make_processor
from lutforge.ocio.renderings import STEPS, Rendering, baked, renderings
from lutforge.progress import Progress, silent
from lutforge.threads import each, one_blas_thread

ARCHIVE_SUFFIX = ".ocioz"
CONFIG_NAME = "config.ocio"

NO_FOLDERS = (".ocio", ".zip", ".npz", ".clf", ".cube")
"""Suffixes of files, which a folder's name should not have."""


# --- Cameras added to a studio's own config, by OpenColorIO's ConfigMerger (2.5 and later) ----------------------------
# The base wins wherever both have something: its colour spaces, roles, rules and views stay bit for bit what they were.
# The cameras are named so that nothing clashes (`ocio.cameras`); where the base's scene reference is not ACES2065-1,
# the merger puts the change of reference between.


BUILTIN = "ocio://"
MOST_BYTES = 2 << 30
"""Most that is unpacked from an archive."""


@dataclass(frozen=True, eq=False)
class BaseConfig:
    """A config to add to. label: how the user named it; folder: where its files are, or none (built in)."""

    config: OCIO.Config
    label: str
    folder: Path | None

    @property
    def views(self) -> set[str]:
        """Its views and view transforms."""
        config = self.config
        names = [*config.getViewTransformNames(), *config.getSharedViews()]
        names += [view for display in config.getDisplaysAll() for view in config.getViews(display)]
        return {name.lower() for name in names}

    @property
    def files(self) -> list[Path]:
        """Its LUT files, relative to its folder."""
        if self.folder is None:
            return []
        found: set[Path] = set()
        for entry in [*self.config.getSearchPaths()] or [""]:
            if "$" in entry or Path(entry).is_absolute():
                continue
            place = self.folder / entry
            if not place.resolve().is_relative_to(self.folder.resolve()):
                raise ConfigError(
                    f'{self.label}: its search path "{entry}" leaves its folder; pack it first (ocioarchive), and '
                    "merge the archive"
                )
            files = place.rglob("*") if place.is_dir() else ()
            found |= {path for path in files if path.suffix.lower() in spaces.LUT_SUFFIXES and path.is_file()}
        return sorted(path.relative_to(self.folder) for path in found)


@contextmanager
def open_base(source: str | Path | None) -> Iterator[BaseConfig | None]:
    """The config to merge into: a file, an archive (unpacked while the block runs), a built-in one by name, or none."""
    if source is None:
        yield None
        return
    label = str(source)
    built_in = [entry[0] for entry in OCIO.BuiltinConfigRegistry().getBuiltinConfigs()]
    if label.startswith(BUILTIN) or label in built_in:
        yield _read(f"{BUILTIN}{label.removeprefix(BUILTIN)}", label, None)
        return
    path = Path(source)
    if not path.is_file():
        raise ConfigError(f"{path}: no such config; name a .ocio or .ocioz file, or one of {', '.join(built_in)}")
    if not zipfile.is_zipfile(path):
        yield _read(str(path), label, path.absolute().parent)
        return
    with scratch_folder() as folder:
        _unpack(path, folder)
        inside = folder / "config.ocio"
        if not inside.is_file():
            raise ConfigError(f"{path}: not an OpenColorIO archive, there is no config.ocio in it")
        yield _read(str(inside), label, folder)


def merged(base: BaseConfig, cameras: OCIO.Config, views: Sequence[str]) -> OCIO.Config:
    """The base with the cameras of another config of ours: spaces, looks and views. Raises ConfigError."""
    displays = []  # that a shared view can be shown on: named as a colour space of video or cinema
    for display in base.config.getDisplaysAll():
        space = base.config.getColorSpace(display)
        of_display = space is not None and space.getReferenceSpaceType() == OCIO.REFERENCE_SPACE_DISPLAY
        if of_display and space.getEncoding() in ("sdr-video", ""):
            displays.append(display)
    _strip(cameras, keep_displays=not displays)
    parameters = OCIO.ConfigMergingParameters.Create()
    parameters.setDefaultStrategy(OCIO.ConfigMergingParameters.STRATEGY_PREFER_BASE)
    parameters.setInputFirst(False)
    parameters.setAdjustInputReferenceSpace(True)
    parameters.setAvoidDuplicates(False)
    parameters.setErrorOnConflict(False)
    level = OCIO.GetLoggingLevel()
    OCIO.SetLoggingLevel(OCIO.LOGGING_LEVEL_NONE)  # it lists all that both have, which is what is wanted
    try:
        config = OCIO.ConfigMergingHelpers.MergeConfigs(parameters, base.config, cameras)
    except OCIO_ERRORS as error:
        raise ConfigError(f"{base.label}: OpenColorIO cannot merge it: {error}") from error
    finally:
        OCIO.SetLoggingLevel(level)
    paths = [path for path in base.config.getSearchPaths() if path != spaces.LUT_FOLDER]
    config.setSearchPath(":".join([*paths, spaces.LUT_FOLDER]))
    active = [*base.config.getActiveViews()]
    for view in views:
        for display in displays:
            config.addDisplaySharedView(display, view)
        if active:
            config.addActiveView(view)
    config.setVersion(2, max(base.config.getMinorVersion(), spaces.MINOR_VERSION))
    return config


def _strip(cameras: OCIO.Config, keep_displays: bool) -> None:
    """Leave what the base cannot have: the cameras. Their own common spaces would only clash with its."""
    roles = (OCIO.ROLE_INTERCHANGE_SCENE, OCIO.ROLE_INTERCHANGE_DISPLAY)
    for role in [name for name in cameras.getRoleNames() if name not in roles]:
        cameras.setRole(role, None)
    searched = OCIO.SEARCH_REFERENCE_SPACE_SCENE if keep_displays else OCIO.SEARCH_REFERENCE_SPACE_ALL
    kept = (spaces.REFERENCE, spaces.DISPLAY_REFERENCE)
    for space in [*cameras.getColorSpaces(searched, OCIO.COLORSPACE_ALL)]:
        if space.getName() not in kept and not space.getFamily().startswith("Input/"):
            cameras.removeColorSpace(space.getName())
    for entry in cameras.getDisplaysAll():
        cameras.removeDisplayView(entry, spaces.DATA)
    if not keep_displays:
        cameras.clearDisplays()
        cameras.clearActiveDisplays()
        cameras.removeSharedView(spaces.UN_TONE_MAPPED)
    cameras.setInactiveColorSpaces("")
    cameras.setFileRules(OCIO.FileRules())


def _read(source: str, label: str, folder: Path | None) -> BaseConfig:
    """A config of a stranger, whose files are read in a process of their own first. Raises ConfigError."""
    with reading(label, "an OpenColorIO config", ConfigError):
        if folder is not None:
            Path(source).read_bytes().decode("utf-8")  # names that are no text fail only where they are asked for
        try:
            config = OCIO.Config.CreateFromFile(source)
        except OCIO_ERRORS as error:
            raise ConfigError(f"{label}: OpenColorIO cannot read it: {error}") from error
        return _merged_into(config, source, label, folder)


def _merged_into(config: OCIO.Config, source: str, label: str, folder: Path | None) -> BaseConfig:
    """A config that cameras can be merged into. Raises ConfigError where they cannot."""
    for name in file_names(config):
        try:
            guarded(make_processor, source, name)
        except OverrunError as error:
            raise ConfigError(f"{label}: {name}: {error}") from error
        except LutForgeError:
            continue  # the check of the whole tells what is wrong with it, and where
    if config.getMajorVersion() < 2:
        raise ConfigError(f"{label}: is of OpenColorIO 1; bring it to profile version 2 first")
    if not config.hasRole(OCIO.ROLE_INTERCHANGE_SCENE):
        raise ConfigError(
            f"{label}: has no role {OCIO.ROLE_INTERCHANGE_SCENE}, so nobody knows what its reference is; give that "
            "role to its ACES2065-1 first"
        )
    return BaseConfig(config, label, folder)


def _unpack(path: Path, folder: Path) -> None:
    """Unpack an archive of a stranger: no entry outside of the folder, no more than MOST_BYTES."""
    with reading(path, "an OpenColorIO archive", ConfigError), zipfile.ZipFile(path) as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        if sum(entry.file_size for entry in entries) > MOST_BYTES:
            raise ConfigError(f"{path}: unpacks to more than {MOST_BYTES >> 30} GB, refused")
        for entry in entries:
            name = PurePosixPath(entry.filename.replace("\\", "/"))
            if name.is_absolute() or ".." in name.parts or ":" in entry.filename:
                raise ConfigError(f'{path}: holds an entry outside of itself, "{entry.filename[:80]}", refused')
            place = folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(entry) as source, place.open("wb") as target:
                shutil.copyfileobj(source, target)


# --- The config -------------------------------------------------------------------------------------------------------


def build_config(profiles: Sequence[CameraProfile | str | Path], *, merge: str | Path | None = None) -> OCIO.Config:
    """Build an OpenColorIO config with the given cameras in memory; `config.serialize()` is its text.

    Its JPEG colour spaces refer to files in `luts/`, relative to the config, which `write_config` makes.

    Args:
        profiles: profiles, or the paths of their files.
        merge: a config to add the cameras to, a file or the name of a built-in one; it keeps its own colour spaces.

    Returns:
        The config (PyOpenColorIO.Config).

    Raises:
        ConfigError: profiles and config to merge do not go together.
        ProfileError: a profile cannot be read.
    """
    with open_base(merge) as base:
        cameras, parts = _plan(profiles, base)
        return _assembled(cameras, parts, base, {})


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
            packed = folder / target.name
            with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
                for path in files:
                    entry = zipfile.ZipInfo(path.relative_to(folder).as_posix())  # without a clock time
                    entry.compress_type = zipfile.ZIP_DEFLATED
                    entry.external_attr = 0o644 << 16
                    archive.writestr(entry, path.read_bytes(), compresslevel=9)
            shutil.move(packed, target)
        return target
    _require_usable(target, replace)
    with open_base(merge) as base:
        cameras, parts = _plan(profiles, base)
        texts, errors = _all_baked(parts, inverse_size, progress)
        config = _assembled(cameras, parts, base, errors)
        with scratch_folder(beside=target) as folder:  # so that a full disk leaves nothing
            if base is not None and base.folder is not None:
                for file in base.files:
                    (folder / file).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(base.folder / file, folder / file)
            (folder / spaces.LUT_FOLDER).mkdir(exist_ok=True)
            for name, text in texts.items():
                (folder / spaces.LUT_FOLDER / name).write_text(text, encoding="utf-8", newline="\n")
            (folder / CONFIG_NAME).write_text(config.serialize(), encoding="utf-8", newline="\n")
            files = sorted(file.relative_to(folder) for file in folder.rglob("*") if file.is_file())
            for file in sorted(files, key=lambda file: file.name == CONFIG_NAME):  # the config last
                (target / file).parent.mkdir(parents=True, exist_ok=True)
                (folder / file).replace(target / file)
    for old in (target / spaces.LUT_FOLDER).glob("*.clf") if replace and base is None else ():
        if old.name not in texts:
            old.unlink()
    path = target / CONFIG_NAME
    progress("done", 1.0)
    return path


@one_blas_thread
def _all_baked(
    parts: Sequence[Rendering], inverse_size: int, progress: Progress
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """The texts of the renderings' files by name, and what is known of their error by stem; baked on all cores."""
    begun, telling, texts, errors = count(), Lock(), dict[str, str](), dict[str, tuple[str, ...]]()

    def bake_one(rendering: Rendering) -> tuple[dict[str, str], tuple[str, ...]]:
        def tell(what: str) -> None:
            with telling:
                progress(f"{rendering.camera.name} {rendering.style}: {what}", next(begun) / (STEPS * len(parts)))

        luts, errors = baked(rendering, inverse_size, tell)
        return {name: clf_text(lut) for name, lut in luts.items()}, errors

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
        if not (target / CONFIG_NAME).is_file():
            raise ConfigError(f"{target}: the folder is not empty; choose another, or an archive ({ARCHIVE_SUFFIX})")
        if not replace:
            raise ConfigError(f"{target}: there is a config already; choose another folder, or replace it (--replace)")


def _plan(
    profiles: Sequence[CameraProfile | str | Path], base: BaseConfig | None
) -> tuple[tuple[Camera, ...], tuple[Rendering, ...]]:
    """Name the cameras and list their renderings, without clashes with a base config and its files."""
    cameras = name_cameras(profiles, config_names(spaces.base_config() if base is None else base.config))
    stems = [] if base is None else [file.stem.lower() for file in base.files]
    return cameras, renderings(cameras, [stem.removesuffix("_render").removesuffix("_linearize") for stem in stems])


def _assembled(
    cameras: Sequence[Camera],
    parts: Sequence[Rendering],
    base: BaseConfig | None,
    errors: Mapping[str, tuple[str, ...]],
) -> OCIO.Config:
    """The whole config, valid. errors: what is known of the LUTs of a rendering, by its stem."""
    config = spaces.base_config()
    groups: dict[object, str] = {}
    for camera in cameras:
        spaces.add_raw(config, camera, groups)
    for rendering in parts:
        spaces.add_jpegs(config, rendering, groups, errors.get(rendering.stem, ()))
    looks = UniqueNames(() if base is None else base.config.getLookNames())
    for camera in cameras:
        spaces.add_looks(config, camera, [part for part in parts if part.camera is camera], looks)
    views = spaces.add_views(config, parts, UniqueNames(base.views if base is not None else ()))
    for display in spaces.DISPLAYS:  # the views in this order, the one without a tone scale, and the values as such
        for view in (*views, spaces.UN_TONE_MAPPED):
            config.addDisplaySharedView(display, view)
        config.addDisplayView(display, spaces.DATA, spaces.DATA, "")
        config.addActiveDisplay(display)
    for view in (*views, spaces.UN_TONE_MAPPED, spaces.DATA):  # the order of the menus; the first is the default
        config.addActiveView(view)
    if base is not None:
        config = merged(base, config, views)
    try:
        config.validate()
    except OCIO_ERRORS as error:
        raise ConfigError(f"the config is not valid: {error}") from error
    return config
