"""Cameras added to a studio's config, the base, by OpenColorIO's ConfigMerger (2.5 and later).

What both configs have is taken from the base: its colour spaces, roles, rules and views stay unchanged bit for bit. The
names of the cameras are new to it (`ocio.cameras`). Where the base's scene reference is not ACES2065-1, the merger adds
the conversion.
"""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import opened_archive, reading
from lutforge.child_processes import OverrunError, guarded
from lutforge.errors import ConfigError, LutForgeError
from lutforge.luts.ocio_transforms import OCIO_ERRORS
from lutforge.ocio.blender import blender_config
from lutforge.ocio.check import file_names, is_archive, try_file
from lutforge.ocio.common import (
    DATA,
    DISPLAY_REFERENCE,
    LUT_FOLDER,
    LUT_SUFFIXES,
    REFERENCE,
    TEXTURE,
    UN_TONE_MAPPED,
    common_config,
)
from lutforge.ocio.views import View

BUILTIN = "ocio://"
BLENDER = "blender"
MOST_UNPACKED = 2 << 30
"""Most bytes that are unpacked from an archive."""


@dataclass(frozen=True, eq=False)
class BaseConfig:
    """A config that cameras are added to. label: the user's name for it; folder: of its files, None if built in."""

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

    def contents(self) -> dict[str, bytes]:
        """The contents of its LUT files, by their paths relative to its folder."""
        return {file.as_posix(): (self.folder / file).read_bytes() for file in self.files} if self.folder else {}

    @property
    def files(self) -> list[Path]:
        """Its LUT files, relative to its folder."""
        if self.folder is None:
            return []
        lut_files: set[Path] = set()
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
            lut_files |= {path for path in files if path.suffix.lower() in LUT_SUFFIXES and path.is_file()}
        return sorted(path.relative_to(self.folder) for path in lut_files)


@contextmanager
def open_base(source: str | Path | None) -> Iterator[BaseConfig | None]:
    """The config to merge into: a file, an archive (unpacked while the block runs), one by name, or none.

    Names are those of built-in configs, and "blender", the config of the Blender that is installed.
    """
    if source is None:
        yield None
        return
    label = str(source)
    built_in = [entry[0] for entry in OCIO.BuiltinConfigRegistry().getBuiltinConfigs()]
    if label.startswith(BUILTIN) or label in built_in:
        yield _read(f"{BUILTIN}{label.removeprefix(BUILTIN)}", label, None)
        return
    path = Path(source)
    if label == BLENDER and not path.exists():
        installed = blender_config()
        if installed is None:
            raise ConfigError("no Blender is found here; name its datafiles/colormanagement/config.ocio")
        path = installed
    if not path.is_file():
        names = ", ".join([BLENDER, *built_in])
        raise ConfigError(f"{path}: no such config; name a .ocio or .ocioz file, or one of {names}")
    if not is_archive(path):
        yield _read(str(path), label, path.absolute().parent)
        return
    with scratch_folder() as folder:
        _unpack(path, folder)
        inside = folder / "config.ocio"
        if not inside.is_file():
            raise ConfigError(f"{path}: not an OpenColorIO archive, there is no config.ocio in it")
        yield _read(str(inside), label, folder)


def merged(base: BaseConfig, cameras: OCIO.Config, views: Sequence[View]) -> OCIO.Config:
    """The base, with the colour spaces, looks and views of the cameras added to it. Raises ConfigError.

    cameras: the cameras' own config, as LutForge builds it, which is stripped for the merge; views: those in it.
    """
    displays = list(_displays_for_shared_views(base.config))
    srgb_displays = [] if displays else list(_srgb_displays(base.config))
    minor = cameras.getMinorVersion()
    _strip(cameras, keep_displays=not (displays or srgb_displays))

    parameters = OCIO.ConfigMergingParameters.Create()
    parameters.setDefaultStrategy(OCIO.ConfigMergingParameters.STRATEGY_PREFER_BASE)
    parameters.setInputFirst(False)
    parameters.setAdjustInputReferenceSpace(True)
    parameters.setAvoidDuplicates(False)
    parameters.setErrorOnConflict(False)
    # OpenColorIO would warn of each name that both configs have, which is intended.
    level = OCIO.GetLoggingLevel()
    OCIO.SetLoggingLevel(OCIO.LOGGING_LEVEL_NONE)
    try:
        config = OCIO.ConfigMergingHelpers.MergeConfigs(parameters, base.config, cameras)
    except OCIO_ERRORS as error:
        raise ConfigError(f"{base.label}: OpenColorIO cannot merge it: {error}") from error
    finally:
        OCIO.SetLoggingLevel(level)

    paths = [path for path in base.config.getSearchPaths() if path != LUT_FOLDER]
    config.setSearchPath(":".join([*paths, LUT_FOLDER]))
    active = [*base.config.getActiveViews()]
    for view in views:
        for display in displays:
            config.addDisplaySharedView(display, view.name)
        for display in srgb_displays:
            config.addDisplayView(display, view.name, view.jpeg, "")
        if active:
            config.addActiveView(view.name)
    config.setVersion(2, max(base.config.getMinorVersion(), minor))
    return config


def _displays_for_shared_views(config: OCIO.Config) -> Iterator[str]:
    """The displays that can show a shared view.

    OpenColorIO converts such a view to the display colour space that has the name of the display, so there must be one,
    and it must be of standard dynamic range, as the cameras' JPEGs are.
    """
    for display in config.getDisplaysAll():
        space = config.getColorSpace(display)
        is_display_space = space is not None and space.getReferenceSpaceType() == OCIO.REFERENCE_SPACE_DISPLAY
        if is_display_space and space.getEncoding() in ("sdr-video", ""):
            yield display


def _srgb_displays(config: OCIO.Config) -> Iterator[str]:
    """The displays with the name of a scene-referred colour space that is sRGB, such as Blender's.

    They show the colour space of a JPEG as it is.
    """
    srgb = common_config().getProcessor(TEXTURE, REFERENCE).getDefaultCPUProcessor()
    for display in config.getDisplaysAll():
        space = config.getColorSpace(display)
        if space is None or space.isData() or space.getReferenceSpaceType() != OCIO.REFERENCE_SPACE_SCENE:
            continue
        to_reference = config.getProcessor(space.getName(), OCIO.ROLE_INTERCHANGE_SCENE).getDefaultCPUProcessor()
        by_space = np.array([[0.02, 0.5, 0.9], [0.8, 0.1, 0.3], [0.4, 0.7, 0.05]], dtype=np.float32)
        by_srgb = by_space.copy()
        to_reference.applyRGB(by_space)
        srgb.applyRGB(by_srgb)
        if np.allclose(by_space, by_srgb, atol=2e-3):
            yield display


def _strip(cameras: OCIO.Config, keep_displays: bool) -> None:
    """Remove everything but the cameras from their config: its common spaces would clash with those of the base."""
    roles = (OCIO.ROLE_INTERCHANGE_SCENE, OCIO.ROLE_INTERCHANGE_DISPLAY)
    for role in [name for name in cameras.getRoleNames() if name not in roles]:
        cameras.setRole(role, None)
    searched = OCIO.SEARCH_REFERENCE_SPACE_SCENE if keep_displays else OCIO.SEARCH_REFERENCE_SPACE_ALL
    references = (REFERENCE, DISPLAY_REFERENCE)
    for space in [*cameras.getColorSpaces(searched, OCIO.COLORSPACE_ALL)]:
        if space.getName() not in references and not space.getFamily().startswith("Input/"):
            cameras.removeColorSpace(space.getName())
    for entry in cameras.getDisplaysAll():
        cameras.removeDisplayView(entry, DATA)
    if not keep_displays:
        cameras.clearDisplays()
        cameras.clearActiveDisplays()
        cameras.removeSharedView(UN_TONE_MAPPED)
    cameras.setInactiveColorSpaces("")
    cameras.setFileRules(OCIO.FileRules())


def _read(source: str, label: str, folder: Path | None) -> BaseConfig:
    """An untrusted config, whose files are first read in a separate process. Raises ConfigError."""
    with reading(label, "an OpenColorIO config", ConfigError):
        if folder is not None:
            Path(source).read_bytes().decode("utf-8")  # OpenColorIO would fail on names that are not text only later
        try:
            config = OCIO.Config.CreateFromFile(source)
        except OCIO_ERRORS as error:
            raise ConfigError(f"{label}: OpenColorIO cannot read it: {error}") from error
        return _merged_into(config, source, label, folder)


def _merged_into(config: OCIO.Config, source: str, label: str, folder: Path | None) -> BaseConfig:
    """A config that cameras can be merged into. Raises ConfigError where they cannot."""
    for name in file_names(config):
        try:
            guarded(try_file, source, name)
        except OverrunError as error:
            raise ConfigError(f"{label}: {name}: {error}") from error
        except LutForgeError:
            continue  # the check of the whole config reports it
    if config.getMajorVersion() < 2:
        raise ConfigError(f"{label}: is of OpenColorIO 1; bring it to profile version 2 first")
    if not config.hasRole(OCIO.ROLE_INTERCHANGE_SCENE):
        raise ConfigError(
            f"{label}: has no role {OCIO.ROLE_INTERCHANGE_SCENE}, so nobody knows what its reference is; give that "
            "role to its ACES2065-1 first"
        )
    return BaseConfig(config, label, folder)


def _unpack(path: Path, folder: Path) -> None:
    """Unpack an untrusted archive: no entry outside of the folder, no more than MOST_UNPACKED. Raises ConfigError."""
    with reading(path, "an OpenColorIO archive", ConfigError), opened_archive(path, ConfigError) as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        if sum(entry.file_size for entry in entries) > MOST_UNPACKED:
            raise ConfigError(f"{path}: unpacks to more than {MOST_UNPACKED >> 30} GB, refused")
        for entry in entries:
            name = PurePosixPath(entry.filename.replace("\\", "/"))
            if name.is_absolute() or ".." in name.parts or ":" in entry.filename:
                raise ConfigError(f'{path}: holds an entry outside of itself, "{entry.filename[:80]}", refused')
            place = folder / name
            place.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(entry) as source, place.open("wb") as target:
                shutil.copyfileobj(source, target)
