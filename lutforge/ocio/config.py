"""An OpenColorIO config whose colour spaces are cameras: their RAW, and their JPEGs per picture style.

The scene reference is ACES2065-1, white balanced: what the camera's setting makes neutral is neutral. So
- "<Camera> RAW <white balance>" is the camera's RAW; each white balance develops it to its own neutral;
- "<Camera> <style>" is the camera's JPEG. Its linearization ends at white-balanced camera RGB, hence one LUT
  per direction serves all white balances. RAW <wb> → <style> is the render of the profile, <style> → RAW <wb>
  its inverse;
- the look "<Camera> as <white balance>" changes the white balance as a refinish does (thesis, equation 6.1):
  the looks "-<Camera> as tungsten, +<Camera> as shade" between two styles turn a tungsten JPEG into a shade
  JPEG.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path
from lutforge.errors import ConfigError
from lutforge.luts.lut import Lut, lut_from_lattice
from lutforge.luts.processor import OCIO_ERRORS
from lutforge.luts.write import write_lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.scene_spaces import from_linear_srgb
from lutforge.ocio.base_config import DISPLAY, LUT_FOLDER, REFERENCE, ROLES, base_config, matrix_transform
from lutforge.ocio.names import UniqueNames, file_stem, space_name


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
    files = UniqueNames()
    views: list[str] = []
    for profile, camera in zip(profiles, _camera_names(profiles), strict=True):
        _add_raw(config, profile, camera, spaces)
        views += [_add_style(config, profile, camera, style, spaces, files) for style in profile.styles]
        _add_looks(config, profile, camera)
    for name in views:
        config.addDisplayView(DISPLAY, name, name, "")
    config.setActiveViews("")
    try:
        config.validate()
    except OCIO_ERRORS as error:
        raise ConfigError(f"the config is not valid: {' '.join(str(error).split())}") from error
    return config


def config_luts(profiles: Sequence[CameraProfile]) -> dict[str, Lut]:
    """The LUT files that the config of these profiles refers to: file name → LUT."""
    files, luts = UniqueNames(), {}
    for profile, camera in zip(profiles, _camera_names(profiles), strict=True):
        for name, style in profile.styles.items():
            stem = files(file_stem(camera, name)).replace(" ", "_")
            for direction in ("render", "linearize"):
                lattice = getattr(style, direction)
                if lattice is not None:
                    luts[f"{stem}_{direction}.clf"] = lut_from_lattice(lattice, title=f"{camera} {name} {direction}")
    return luts


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


def _to_reference(profile: CameraProfile) -> NDArray[np.float64]:
    """White-balanced camera RGB → ACES2065-1, (3, 3)."""
    return from_linear_srgb("aces2065-1") @ profile.matrix


def _add_raw(config: OCIO.Config, profile: CameraProfile, camera: str, spaces: UniqueNames) -> None:
    for name, balance in profile.white_balances.items():
        gain = np.asarray(balance.multipliers, dtype=np.float64)
        kelvin = f", about {balance.kelvin:.0f} K" if balance.kelvin is not None else ""
        full = spaces(space_name(camera, "RAW", name))
        config.addColorSpace(
            OCIO.ColorSpace(
                name=full,
                aliases=[alias for alias in [spaces(file_stem(full))] if " " not in alias],
                family=f"Input/{camera}",
                encoding="scene-linear",
                categories=["file-io"],
                description=(
                    f"Linear RAW of the {camera}, black 0, saturation 1, before white balance; developed "
                    f"with {name}{kelvin}: multipliers {gain[0]:.4f}, {gain[1]:.4f}, {gain[2]:.4f}"
                ),
                bitDepth=OCIO.BIT_DEPTH_F32,
                toReference=matrix_transform(_to_reference(profile) * gain),
            )
        )


def _add_style(
    config: OCIO.Config,
    profile: CameraProfile,
    camera: str,
    style: str,
    spaces: UniqueNames,
    files: UniqueNames,
) -> str:
    """Add the colour space of a picture style; returns its name."""
    known = profile.styles[style]
    if known.render is None and known.linearize is None:
        raise ConfigError(
            f"{profile.camera}: style {style} holds no lattice; calibrate with --model lattice for a config"
        )
    stem = files(file_stem(camera, style)).replace(" ", "_")
    to_reference = _to_reference(profile)
    full = spaces(space_name(camera, style))
    errors = "; ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in sorted(known.errors.items()))
    space = OCIO.ColorSpace(
        name=full,
        aliases=[alias for alias in [spaces(file_stem(full))] if " " not in alias],
        family=f"Input/{camera}",
        encoding="sdr-video",
        categories=["file-io"],
        description=(
            f"JPEG of the {camera}, picture style {style}, any white balance. "
            + (f"Held-out error: {errors}" if errors else "Held-out error: not measured")
        ),
        bitDepth=OCIO.BIT_DEPTH_F32,
    )
    if known.linearize is not None:
        group = OCIO.GroupTransform([_file(f"{stem}_linearize.clf"), matrix_transform(to_reference)])
        space.setTransform(group, OCIO.COLORSPACE_DIR_TO_REFERENCE)
    if known.render is not None:
        inverse = matrix_transform(_inverse(to_reference))
        group = OCIO.GroupTransform([inverse, _file(f"{stem}_render.clf")])
        space.setTransform(group, OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    config.addColorSpace(space)
    return full


def _file(name: str) -> OCIO.FileTransform:
    return OCIO.FileTransform(src=name, interpolation=OCIO.INTERP_BEST)


def _add_looks(config: OCIO.Config, profile: CameraProfile, camera: str) -> None:
    """One look per white balance, from the first one's neutral; two, one of them inverted, change it."""
    looks = UniqueNames(tuple(config.getLookNames()))
    to_reference = _to_reference(profile)
    inverse = _inverse(to_reference)
    balances = {name: np.asarray(balance.multipliers) for name, balance in profile.white_balances.items()}
    first = next(iter(balances))
    for name, gain in balances.items():
        change = np.eye(3) if name == first else (to_reference * (gain / balances[first])) @ inverse
        config.addLook(
            OCIO.Look(
                name=looks(space_name(camera, "as", name)),
                processSpace=REFERENCE,
                transform=matrix_transform(change),
                inverseTransform=matrix_transform(_inverse(change)),
                description=(
                    f"From a {first} to a {name} white balance. From A to B: "
                    f"-{space_name(camera, 'as', 'A')}, +{space_name(camera, 'as', 'B')}"
                ),
            )
        )
