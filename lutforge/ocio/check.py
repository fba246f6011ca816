"""Checks of configs of any origin: that they are valid and complete, and that each transform works both ways."""

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.boundary import opened_archive, read_entry, reading, require_file
from lutforge.errors import ConfigError, one_line
from lutforge.luts.ocio_transforms import OCIO_ERRORS

MOST_TEXT = 64 << 20
"""Most bytes of a config.ocio; the largest that studios use have half a megabyte."""
_PIXELS = np.array(
    [[0, 0, 0], [0.18, 0.18, 0.18], [1, 1, 1], [0.5, 0.2, 0.1], [0.1, 0.4, 0.7], [-0.01, 0.5, 1.2]],
    dtype=np.float32,
)


def load_config(path: str | Path) -> OCIO.Config:
    """Read config.ocio or an .ocioz archive. Raises ConfigError in one line."""
    path = Path(path)
    require_file(path, "an OpenColorIO config", ConfigError, 1 << 30)
    with reading(path, "an OpenColorIO config", ConfigError):
        _require_text(path)
        try:
            return OCIO.Config.CreateFromFile(str(path))
        except OCIO_ERRORS as error:
            raise ConfigError(f"{path}: OpenColorIO cannot read it: {error}") from error


def is_archive(path: Path) -> bool:
    """True of an .ocioz, False of a config that is text. Raises ConfigError on an .ocioz that is no whole archive."""
    if zipfile.is_zipfile(path):
        return True
    if path.suffix.lower() == ".ocioz":
        raise ConfigError(f"{path}: no whole archive, it is cut short or damaged: copy it again")
    return False


def _require_text(path: Path) -> None:
    """Raise UnicodeDecodeError or another error where a config is not text; OpenColorIO would fail only later."""
    if not is_archive(path):
        path.read_bytes().decode("utf-8")
        return
    with opened_archive(path, ConfigError) as archive:
        if "config.ocio" not in archive.namelist():
            raise ConfigError(f"{path}: not an OpenColorIO archive, there is no config.ocio in it")
        if archive.getinfo("config.ocio").file_size > MOST_TEXT:
            raise ConfigError(f"{path}: its config.ocio unpacks to more than any config has, refused")
        read_entry(archive, "config.ocio").decode("utf-8")


def try_file(path: str, name: str) -> None:
    """Make the processor of a file that a config names: for `guarded`."""
    OCIO.Config.CreateFromFile(path).getProcessor(OCIO.FileTransform(name)).getDefaultCPUProcessor()


def try_conversion(path: str, source: str, target: str) -> None:
    """Make the processor between two spaces of a config: for `guarded`."""
    OCIO.Config.CreateFromFile(path).getProcessor(source, target).getDefaultCPUProcessor()


def try_view(path: str, source: str, display: str, view: str) -> None:
    """Make the processor from a space of a config to a display and view: for `guarded`."""
    way = OCIO.TRANSFORM_DIR_FORWARD
    OCIO.Config.CreateFromFile(path).getProcessor(source, display, view, way).getDefaultCPUProcessor()


@dataclass(frozen=True)
class Problem:
    """A fault of a config with which an application will fail. where: a part of the config, such as a colour space."""

    where: str
    reason: str
    is_missing_file: bool = False

    def __str__(self) -> str:
        """One line."""
        return f"{self.where}: {self.reason}"


def check_config(config: OCIO.Config) -> list[Problem]:
    """The problems with which an application will fail: those that ociocheck finds, and more.

    Pixels go through each colour space, named transform, view and look, in both directions, and files must exist. A
    name that is given twice needs no check, since OpenColorIO does not load such a config.
    """
    problems: list[Problem] = []
    try:
        config.validate()
    except OCIO_ERRORS as error:
        problems.append(Problem("config", one_line(str(error), 400)))
    context = config.getCurrentContext()
    for source, where in sorted(file_names(config).items()):
        try:
            if "$" not in source:  # a name with $ depends on a context variable
                context.resolveFileLocation(source)
        except OCIO_ERRORS:
            problems.append(Problem(f"file {source}", f"missing; {where} needs it", is_missing_file=True))
    for where, make in _transforms(config):
        pixels = _PIXELS.copy()
        try:
            make().getDefaultCPUProcessor().applyRGB(pixels)
        except OCIO_ERRORS as error:
            problems.append(Problem(where, one_line(str(error), 400)))
            continue
        if not np.all(np.isfinite(pixels)):
            problems.append(Problem(where, "ordinary pixels come out as NaN or infinity"))
    return problems


def _spaces(config: OCIO.Config) -> list[OCIO.ColorSpace]:
    """All colour spaces of a config, inactive and display-referred ones too."""
    return [*config.getColorSpaces(OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL)]


def _transforms(config: OCIO.Config) -> Iterator[tuple[str, Callable[[], OCIO.Processor]]]:
    """The name of every transform of a config, and a function that makes its processor."""
    all_roles = (OCIO.ROLE_INTERCHANGE_SCENE, OCIO.ROLE_SCENE_LINEAR, OCIO.ROLE_INTERCHANGE_DISPLAY)
    roles = [role for role in all_roles if config.hasRole(role)]

    # Each colour space with the reference that it is defined by, or another one where the config has no role for it.
    for space in _spaces(config):
        of_display = space.getReferenceSpaceType() == OCIO.REFERENCE_SPACE_DISPLAY
        role = OCIO.ROLE_INTERCHANGE_DISPLAY if of_display else OCIO.ROLE_INTERCHANGE_SCENE
        if roles and not space.isData():
            name = space.getName()
            reference = role if role in roles else roles[0]
            yield f"colour space {name}, to the reference", partial(config.getProcessor, name, reference)
            yield f"colour space {name}, from the reference", partial(config.getProcessor, reference, name)

    for direction, way in ((OCIO.TRANSFORM_DIR_FORWARD, "forward"), (OCIO.TRANSFORM_DIR_INVERSE, "backward")):
        for named in config.getNamedTransforms(OCIO.NAMEDTRANSFORM_ALL):
            if named.getTransform(direction):
                yield f"named transform {named.getName()}, {way}", partial(config.getProcessor, named, direction)
    if not roles:
        return

    reference = roles[0]
    forward = OCIO.TRANSFORM_DIR_FORWARD
    for display in config.getDisplaysAll():
        for kind in (OCIO.VIEW_SHARED, OCIO.VIEW_DISPLAY_DEFINED):
            for view in config.getViews(kind, display):
                yield f"view {display} / {view}", partial(config.getProcessor, reference, display, view, forward)
    for name in config.getLookNames():
        for sign in "+-":
            look = OCIO.LookTransform(src=reference, dst=reference, looks=sign + name)
            yield f"look {sign}{name}", partial(config.getProcessor, look)


def file_names(config: OCIO.Config) -> dict[str, str]:
    """File names in a config's transforms, some with context variables, and the first part that names each."""
    of_spaces = (OCIO.COLORSPACE_DIR_TO_REFERENCE, OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    of_named = (OCIO.TRANSFORM_DIR_FORWARD, OCIO.TRANSFORM_DIR_INVERSE)
    of_views = (OCIO.VIEWTRANSFORM_DIR_TO_REFERENCE, OCIO.VIEWTRANSFORM_DIR_FROM_REFERENCE)

    transforms = [(f"colour space {s.getName()}", s.getTransform(way)) for s in _spaces(config) for way in of_spaces]
    for named in config.getNamedTransforms(OCIO.NAMEDTRANSFORM_ALL):
        transforms += [(f"named transform {named.getName()}", named.getTransform(way)) for way in of_named]
    for view in config.getViewTransforms():
        transforms += [(f"view transform {view.getName()}", view.getTransform(way)) for way in of_views]
    for look in config.getLooks():
        transforms += [(f"look {look.getName()}", part) for part in (look.getTransform(), look.getInverseTransform())]

    sources: dict[str, str] = {}
    for where, transform in transforms:
        for part in _leaves(transform):
            if isinstance(part, OCIO.FileTransform):
                sources.setdefault(part.getSrc(), where)
    return sources


def _leaves(transform: OCIO.Transform | None) -> Iterator[OCIO.Transform]:
    """The transforms in a transform that are no groups."""
    if isinstance(transform, OCIO.GroupTransform):
        for part in transform:
            yield from _leaves(part)
    elif transform is not None:
        yield transform
