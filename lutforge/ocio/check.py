"""Check a config: valid, and every colour space, view, look and role can be used on pixels."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import ConfigError
from lutforge.luts.processor import OCIO_ERRORS

Make = Callable[[], OCIO.Processor]

_WANTED_ROLES = (OCIO.ROLE_INTERCHANGE_SCENE, OCIO.ROLE_SCENE_LINEAR, OCIO.ROLE_INTERCHANGE_DISPLAY)

_PIXELS = np.array(
    [[0, 0, 0], [0.18, 0.18, 0.18], [1, 1, 1], [0.5, 0.2, 0.1], [0.1, 0.4, 0.7], [-0.01, 0.5, 1.2]],
    dtype=np.float32,
)


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong. severity: "error" (an application will fail) or "warning"."""

    severity: str
    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.what}"


def load_config(path: str | Path) -> OCIO.Config:
    """Read config.ocio or an .ocioz archive. Raises ConfigError in one line."""
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f"{path}: no such file")
    try:
        return OCIO.Config.CreateFromFile(str(path))
    except OCIO_ERRORS as error:
        raise ConfigError(f"{path}: OpenColorIO cannot read it: {_one_line(error)}") from error


def check_config(config: OCIO.Config) -> list[Finding]:
    """What ociocheck checks, and pixels pushed through each transform; an empty list is a sound config."""
    findings: list[Finding] = []
    try:
        config.validate()
    except OCIO_ERRORS as error:
        findings.append(Finding("error", "config", _one_line(error)))
    findings += [
        Finding("warning", f"role {role}", "missing; programs cannot relate this config to others")
        for role in _WANTED_ROLES
        if not config.hasRole(role)
    ]
    for where, make in _transforms(config):
        findings += _try(where, make)
    return findings


def _transforms(config: OCIO.Config) -> Iterator[tuple[str, Make]]:
    """Every transform of a config by name, and how to make its processor."""
    reference = next((role for role in _WANTED_ROLES if config.hasRole(role)), "")
    if not reference:
        return
    for space in config.getColorSpaces(OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL):
        if not space.isData():
            name = space.getName()
            yield f"colour space {name}, to the reference", partial(config.getProcessor, name, reference)
            yield f"colour space {name}, from the reference", partial(config.getProcessor, reference, name)
    forward = OCIO.TRANSFORM_DIR_FORWARD
    for display in config.getDisplays():
        for view in config.getViews(display):
            yield f"view {display} / {view}", partial(config.getProcessor, reference, display, view, forward)
    for name in config.getLookNames():
        for sign in "+-":
            look = OCIO.LookTransform(src=reference, dst=reference, looks=sign + name)
            yield f"look {sign}{name}", partial(config.getProcessor, look)


def _try(where: str, make: Make) -> list[Finding]:
    pixels = _PIXELS.copy()
    try:
        make().getDefaultCPUProcessor().applyRGB(pixels)
    except OCIO_ERRORS as error:
        return [Finding("error", where, _one_line(error))]
    if not np.all(np.isfinite(pixels)):
        return [Finding("error", where, "ordinary pixels come out as NaN or infinity")]
    return []


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:400]
