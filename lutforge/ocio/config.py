"""An OpenColorIO config whose colour spaces are cameras: their RAW, and their JPEGs per style and white balance.

The scene reference is ACES2065-1 under one white balance of each camera, its daylight (or what comes nearest): the
reference RAW of a scene does not change with the dial. So
- "<Camera> RAW" is the camera's RAW, and "<Camera> RAW <white balance>" the same after that white balance;
- "<Camera> <style> <white balance>" is its JPEG under those settings. RAW → JPEG is the render of the profile,
  JPEG → RAW its inverse, and from one JPEG space to another is a refinish (thesis, equation 6.1);
- the look "<Camera> as <white balance>" changes the white balance of scene-linear pixels, so that a view shows them as
  the camera would have under that setting.

White balance is a matrix in front of the LUTs or behind them: all white balances of a style share one file a direction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path
from lutforge.errors import ConfigError
from lutforge.luts.bake import bake
from lutforge.luts.lut import Lut
from lutforge.luts.processor import OCIO_ERRORS
from lutforge.luts.write import write_lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.scene_spaces import from_linear_srgb
from lutforge.model.transform import LatticeTransform, LinearizeChain, RenderChain, Transform
from lutforge.ocio.base_config import DISPLAY, LUT_FOLDER, REFERENCE, ROLES, base_config, matrix_transform
from lutforge.ocio.names import UniqueNames, file_stem, space_name
from lutforge.settings import Selector

DAYLIGHT_KELVIN = 5200.0


def build_config(profiles: Sequence[CameraProfile], folder: str | Path | None = None) -> OCIO.Config:
    """A config with the given cameras; `config.serialize()` is its text.

    Its JPEG colour spaces refer to files in `luts/`, relative to the config: `config_luts` are those,
    `write_config` writes both. folder: where they are, for use of the config from memory. Raises ConfigError.
    """
    if not profiles:
        raise ConfigError("a config needs at least one camera profile")
    config = base_config()
    if folder is not None:
        config.setWorkingDir(str(folder))
    spaces = UniqueNames((*config.getColorSpaceNames(), *ROLES, *_aliases(config)))
    cameras = _camera_names(profiles)
    for profile, camera in zip(profiles, cameras, strict=True):
        _add_raw(config, profile, camera, spaces)
        _add_looks(config, profile, camera)
    for rendering in _renderings(profiles, cameras):
        added = _add_jpegs(config, rendering, spaces)
        name = reference_white_balance(rendering.profile)
        if name in added and rendering.render is not None:
            config.addDisplayView(DISPLAY, space_name(rendering.camera, rendering.style), added[name], "")
    config.setActiveViews("")
    try:
        config.validate()
    except OCIO_ERRORS as error:
        raise ConfigError(f"the config is not valid: {' '.join(str(error).split())}") from error
    return config


def config_luts(profiles: Sequence[CameraProfile]) -> dict[str, Lut]:
    """The LUT files that the config of these profiles refers to: file name → LUT."""
    luts: dict[str, Lut] = {}
    for rendering in _renderings(profiles, _camera_names(profiles)):
        for direction, transform in (("render", rendering.render), ("linearize", rendering.linearize)):
            if transform is not None:
                title = f"{rendering.camera} {rendering.style} {direction}"
                luts[f"{rendering.stem}_{direction}.clf"] = bake(transform, title=title)
    return luts


@dataclass(frozen=True, eq=False)
class _Rendering:
    """What shares its LUTs: a style, and the white balances that one model of it covers.

    render: white-balanced RAW → JPEG; linearize: JPEG → white-balanced RAW.
    """

    profile: CameraProfile
    camera: str
    style: str
    white_balances: tuple[str, ...]
    stem: str
    render: Transform | None
    linearize: Transform | None


def _renderings(profiles: Sequence[CameraProfile], cameras: Sequence[str]) -> Iterator[_Rendering]:
    files = UniqueNames()
    for profile, camera in zip(profiles, cameras, strict=True):
        if profile.raw_camera:
            raise ConfigError(
                f"{profile.camera} was calibrated through the RAW of {profile.raw_camera}: it has no RAW of its own "
                "for a config; bake refinish LUTs of it instead"
            )
        for name, style in profile.styles.items():
            everywhere = tuple(profile.white_balances)
            groups = [everywhere] if style.render or style.linearize else []
            if not groups:
                groups = [tuple(b for b in everywhere if b in model.white_balances) for model in style.physical]
            if not any(groups):
                raise ConfigError(f"{profile.camera}: style {name} holds no model; calibrate it first")
            for balances in filter(None, groups):
                selector = Selector(name, balances[0])
                gain = profile.multipliers(selector)
                render = linearize = None
                if style.render or style.physical:
                    render = replace(_shaped(profile.render(selector)), gain=np.ones(3))
                if style.linearize or style.physical:
                    back = _shaped(profile.linearize(selector))
                    linearize = replace(back, matrix=np.diag(gain) @ back.matrix)
                stem = files(file_stem(camera, name)).replace(" ", "_")
                yield _Rendering(profile, camera, name, balances, stem, render, linearize)


def _shaped(transform: Transform) -> LatticeTransform | RenderChain | LinearizeChain:
    assert isinstance(transform, LatticeTransform | RenderChain | LinearizeChain)
    return transform


def write_config(profiles: Sequence[CameraProfile], target: str | Path) -> Path:
    """Write a config and its LUTs, to a folder (config.ocio, luts/) or to one archive (.ocioz).

    Returns the path of the config. Raises ConfigError, LutError, LutForgeError.
    """
    target = Path(target)
    if target.suffix.lower() == ".ocioz":
        with TemporaryDirectory() as folder:
            config = OCIO.Config.CreateFromFile(str(write_config(profiles, folder)))
            with atomic_path(target) as temporary:
                try:
                    config.archive(str(temporary))
                except OCIO_ERRORS as error:
                    raise ConfigError(f"{target}: {' '.join(str(error).split())}") from error
        return target
    if "$" in str(target.absolute()):
        raise ConfigError(f"{target}: OpenColorIO finds no LUTs in a folder with $ in its path; choose another")
    config = build_config(profiles, target)
    for name, lut in config_luts(profiles).items():
        write_lut(lut, target / LUT_FOLDER / name)
    path = target / "config.ocio"
    with atomic_path(path) as temporary:
        temporary.write_text(config.serialize(), encoding="utf-8", newline="\n")
    return path


def _camera_names(profiles: Sequence[CameraProfile]) -> list[str]:
    unique = UniqueNames()
    return [unique(space_name(profile.camera)) for profile in profiles]


def _aliases(config: OCIO.Config) -> list[str]:
    return [alias for space in config.getColorSpaces() for alias in space.getAliases()]


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def reference_white_balance(profile: CameraProfile) -> str:
    """The white balance under which this camera's neutral is the reference's: daylight, or what comes nearest."""

    def distance(name: str) -> tuple[bool, float]:
        kelvin = profile.white_balances[name].kelvin
        return (kelvin is None, abs(1e6 / (kelvin or DAYLIGHT_KELVIN) - 1e6 / DAYLIGHT_KELVIN))

    return "daylight" if "daylight" in profile.white_balances else min(profile.white_balances, key=distance)


def _gain(profile: CameraProfile, name: str) -> NDArray[np.float64]:
    return np.asarray(profile.white_balances[name].multipliers, dtype=np.float64)


def _to_reference(profile: CameraProfile, balance: str | None) -> NDArray[np.float64]:
    """Camera RGB after the named white balance, or before any (None) → ACES2065-1, (3, 3)."""
    gain = _gain(profile, reference_white_balance(profile))
    if balance is not None:
        gain = gain / _gain(profile, balance)
    return (from_linear_srgb("aces2065-1") @ profile.matrix) * gain


def _add_raw(config: OCIO.Config, profile: CameraProfile, camera: str, spaces: UniqueNames) -> None:
    """The camera's RAW before white balance, and after each."""
    reference = reference_white_balance(profile)
    for name in (None, *profile.white_balances):
        full = spaces(space_name(camera, "RAW", name or ""))
        what = f"Linear RAW of the {camera}, black 0, saturation 1, "
        if name is None:
            what += f"before white balance. Neutral in the reference under {reference}"
        else:
            balance = profile.white_balances[name]
            kelvin = f", about {balance.kelvin:.0f} K" if balance.kelvin is not None else ""
            r, g, b = balance.multipliers
            what += f"after white balance {name}{kelvin}: multipliers {r:.4f}, {g:.4f}, {b:.4f}"
        config.addColorSpace(
            OCIO.ColorSpace(
                name=full,
                aliases=[alias for alias in [spaces(file_stem(full))] if " " not in alias],
                family=f"Input/{camera}",
                encoding="scene-linear",
                categories=["file-io"],
                description=what,
                bitDepth=OCIO.BIT_DEPTH_F32,
                toReference=matrix_transform(_to_reference(profile, name)),
            )
        )


def _add_jpegs(config: OCIO.Config, rendering: _Rendering, spaces: UniqueNames) -> dict[str, str]:
    """The colour space of each white balance of a rendering: white balance → its name."""
    profile, style = rendering.profile, rendering.profile.styles[rendering.style]
    errors = "; ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in sorted(style.errors.items()))
    added = {}
    for balance in rendering.white_balances:
        full = spaces(space_name(rendering.camera, rendering.style, balance))
        space = OCIO.ColorSpace(
            name=full,
            aliases=[alias for alias in [spaces(file_stem(full))] if " " not in alias],
            family=f"Input/{rendering.camera}",
            encoding="sdr-video",
            categories=["file-io"],
            description=(
                f"JPEG of the {rendering.camera}, picture style {rendering.style}, white balance {balance}. "
                + (f"Held-out error: {errors}" if errors else "Held-out error: not measured")
            ),
            bitDepth=OCIO.BIT_DEPTH_F32,
        )
        matrix = _to_reference(profile, balance)
        if rendering.linearize is not None:
            group = OCIO.GroupTransform([_file(f"{rendering.stem}_linearize.clf"), matrix_transform(matrix)])
            space.setTransform(group, OCIO.COLORSPACE_DIR_TO_REFERENCE)
        if rendering.render is not None:
            group = OCIO.GroupTransform([matrix_transform(_inverse(matrix)), _file(f"{rendering.stem}_render.clf")])
            space.setTransform(group, OCIO.COLORSPACE_DIR_FROM_REFERENCE)
        config.addColorSpace(space)
        added[balance] = full
    return added


def _file(name: str) -> OCIO.FileTransform:
    return OCIO.FileTransform(src=name, interpolation=OCIO.INTERP_BEST)


def _add_looks(config: OCIO.Config, profile: CameraProfile, camera: str) -> None:
    """One look per white balance: from the reference's own to that one."""
    looks = UniqueNames(tuple(config.getLookNames()))
    own = reference_white_balance(profile)
    to_reference = from_linear_srgb("aces2065-1") @ profile.matrix
    for name in profile.white_balances:
        change = np.eye(3)
        if name != own:
            change = (to_reference * (_gain(profile, name) / _gain(profile, own))) @ _inverse(to_reference)
        config.addLook(
            OCIO.Look(
                name=looks(space_name(camera, "as", name)),
                processSpace=REFERENCE,
                transform=matrix_transform(change),
                inverseTransform=matrix_transform(_inverse(change)),
                description=f"Scene-linear pixels white balanced for {name} instead of {own}",
            )
        )
