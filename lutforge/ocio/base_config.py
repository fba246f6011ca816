"""What every config of cameras starts from: reference spaces, roles, displays, the default of the file rules.

Names, aliases, IDs and views are those of OpenColorIO's own studio config, so that both merge and scripts know them.
"""

from dataclasses import dataclass

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import from_linear_srgb, to_xyz
from lutforge.errors import ConfigError

OLDEST, NEWEST = 1, 6
DEFAULT_VERSION = "2.1"
"""Read by every OpenColorIO since 2021; newer ones add names, not colours."""
INTEROP_IDS = 5
"""First minor version with interop IDs."""
MIRRORED_DISPLAYS = 5
"""First minor version whose displays mirror negative values."""

_LOSSES = (
    (INTEROP_IDS, "no interop IDs (2.5): programs match the common spaces by their names and aliases"),
    (MIRRORED_DISPLAYS, "displays clamp negative values (mirrored from 2.5 on)"),
)


def minor_version(text: str) -> int:
    """Return the minor version: "2.4" → 4. Raises ConfigError on a version that is not 2.1 … 2.6."""
    major, dot, minor = text.strip().partition(".")
    if major != "2" or not dot or not minor.isdigit() or not OLDEST <= int(minor) <= NEWEST:
        raise ConfigError(f'OpenColorIO profile version "{text}": choose 2.{OLDEST} to 2.{NEWEST}')
    return int(minor)


def losses(minor: int) -> tuple[str, ...]:
    """What a config of this version lacks beside one of the newest, a line each."""
    return tuple(what for since, what in _LOSSES if minor < since)


LUT_FOLDER = "luts"
REFERENCE = "ACES2065-1"
DISPLAY = "sRGB - Display"
WORKING = "ACEScg"
TEXTURE = "sRGB Encoded Rec.709 (sRGB)"
DATA = "Raw"
DISPLAY_REFERENCE = "CIE XYZ-D65 - Display-referred"
UN_TONE_MAPPED = "Un-tone-mapped"

ROLES = {
    OCIO.ROLE_INTERCHANGE_SCENE: REFERENCE,
    OCIO.ROLE_INTERCHANGE_DISPLAY: DISPLAY_REFERENCE,
    OCIO.ROLE_SCENE_LINEAR: WORKING,
    OCIO.ROLE_RENDERING: WORKING,
    OCIO.ROLE_COMPOSITING_LOG: "ACEScct",
    OCIO.ROLE_COLOR_TIMING: "ACEScct",
    OCIO.ROLE_COLOR_PICKING: TEXTURE,
    OCIO.ROLE_TEXTURE_PAINT: TEXTURE,
    OCIO.ROLE_MATTE_PAINT: "ACEScct",
    OCIO.ROLE_DATA: DATA,
}

SRGB_IMAGES = ("jpg", "jpeg", "png")
"""Files of these kinds are sRGB where nothing says otherwise."""


@dataclass(frozen=True)
class _Display:
    """A display of the studio config. builtin: its curve and matrix, where this version of OpenColorIO has them."""

    name: str
    aliases: tuple[str, ...]
    builtin: str
    description: str


_DISPLAYS = (
    _Display(DISPLAY, ("srgb_display", "srgb_rec709_display"), "sRGB", "An sRGB monitor (piecewise curve)."),
    _Display(
        "Display P3 - Display",
        ("displayp3_display", "srgb_p3d65_display"),
        "DisplayP3",
        "A Display P3 monitor (sRGB curve, P3 primaries, D65).",
    ),
    _Display(
        "Gamma 2.6 P3-D65 - Display",
        ("p3d65_display", "g26_p3d65_display"),
        "G2.6-P3-D65",
        "A P3-D65 projector (gamma 2.6).",
    ),
    _Display(
        "Rec.1886 Rec.709 - Display",
        ("rec1886_rec709_display", "g24_rec709_display"),
        "REC.1886-REC.709",
        "A Rec.709 video monitor (BT.1886, gamma 2.4).",
    ),
)
DISPLAYS = tuple(display.name for display in _DISPLAYS)


def matrix_transform(matrix: Array) -> OCIO.MatrixTransform:
    """A 3 × 3 matrix as a transform."""
    whole = np.eye(4)
    whole[:3, :3] = matrix
    return OCIO.MatrixTransform(whole.ravel().tolist())


def base_config(version: str) -> OCIO.Config:
    """Reference spaces, roles, displays, file rules: what is there before any camera. Raises ConfigError."""
    minor = minor_version(version)
    config = OCIO.Config()
    config.setVersion(2, minor)
    config.setName("lutforge")
    config.setDescription("Cameras calibrated by LutForge: their RAW and JPEGs as colour spaces, views and looks.")
    config.setSearchPath(LUT_FOLDER)
    config.setEnvironmentMode(OCIO.ENV_ENVIRONMENT_LOAD_PREDEFINED)
    for space in (*_scene_spaces(minor), *_display_spaces(minor)):
        config.addColorSpace(space)
    for role, name in ROLES.items():
        config.setRole(role, name)
    config.setInactiveColorSpaces(DISPLAY_REFERENCE)
    config.addViewTransform(
        OCIO.ViewTransform(
            referenceSpace=OCIO.REFERENCE_SPACE_SCENE,
            name=UN_TONE_MAPPED,
            description="Scene to display without a tone scale, clipped by the display.",
            fromReference=OCIO.BuiltinTransform("UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD"),
        )
    )
    config.setDefaultViewTransformName(UN_TONE_MAPPED)
    config.addSharedView(UN_TONE_MAPPED, UN_TONE_MAPPED, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", "", "")
    config.setFileRules(_file_rules())
    return config


def add_displays(config: OCIO.Config, views: tuple[str, ...]) -> None:
    """The displays, each with the shared views in this order, the one without a tone scale, and the values as such."""
    for display in DISPLAYS:
        for view in (*views, UN_TONE_MAPPED):
            config.addDisplaySharedView(display, view)
        config.addDisplayView(display, DATA, DATA, "")
    for display in DISPLAYS:
        config.addActiveDisplay(display)
    for view in (*views, UN_TONE_MAPPED, DATA):  # the order of the menus; the first is the default
        config.addActiveView(view)


def _file_rules() -> OCIO.FileRules:
    """sRGB for the files that are sRGB unless told otherwise; all others are passed on as they are."""
    rules = OCIO.FileRules()
    for index, kind in enumerate(SRGB_IMAGES):
        either_case = "".join(f"[{letter}{letter.upper()}]" for letter in kind)
        rules.insertRule(index, f"sRGB {kind}", TEXTURE, "*", either_case)
    rules.setDefaultRuleColorSpace(DATA)
    return rules


def _space(minor: int, name: str, aliases: tuple[str, ...], interop: str, **properties: object) -> OCIO.ColorSpace:
    space = OCIO.ColorSpace(
        name=name, aliases=[*aliases, interop], bitDepth=OCIO.BIT_DEPTH_F32, equalityGroup="", **properties
    )
    if minor >= INTEROP_IDS:
        space.setInteropID(interop)
    return space


@dataclass(frozen=True)
class _SceneSpace:
    """A scene-referred space of the studio config. builtin: its way to the reference, where OpenColorIO has it."""

    name: str
    aliases: tuple[str, ...]
    interop: str
    encoding: str
    description: str
    builtin: str = ""

    @property
    def family(self) -> str:
        return "ACES" if self.name.startswith("ACES") else "Utility"

    @property
    def categories(self) -> list[str]:
        return ["file-io", "working-space"] if self.encoding in ("scene-linear", "log") else ["file-io"]


_LINEAR_SRGB = "Linear Rec.709 (sRGB)"
_SCENE_SPACES = (
    _SceneSpace(
        REFERENCE,
        ("aces2065_1", "ACES - ACES2065-1", "lin_ap0"),
        "lin_ap0_scene",
        "scene-linear",
        "The scene reference, AP0.",
    ),
    _SceneSpace(
        WORKING,
        ("ACES - ACEScg", "lin_ap1"),
        "lin_ap1_scene",
        "scene-linear",
        "Scene-linear AP1.",
        "ACEScg_to_ACES2065-1",
    ),
    _SceneSpace(
        "ACEScct",
        ("ACES - ACEScct", "acescct_ap1"),
        "ocio:acescct_ap1_scene",
        "log",
        "Log AP1 for grading.",
        "ACEScct_to_ACES2065-1",
    ),
    _SceneSpace(
        _LINEAR_SRGB,
        ("lin_rec709_srgb", "lin_rec709", "lin_srgb"),
        "lin_rec709_scene",
        "scene-linear",
        "Linear sRGB primaries, D65.",
    ),
    _SceneSpace(
        TEXTURE,
        ("sRGB - Texture", "srgb_tx", "srgb_texture"),
        "srgb_rec709_scene",
        "sdr-video",
        "sRGB-encoded images without a tone scale.",
    ),
)


def _scene_spaces(minor: int) -> list[OCIO.ColorSpace]:
    linear = matrix_transform(from_linear_srgb("aces2065-1"))
    own = {_LINEAR_SRGB: linear, TEXTURE: OCIO.GroupTransform([_srgb_curve(), linear])}
    made = []
    for entry in _SCENE_SPACES:
        space = _space(
            minor,
            entry.name,
            entry.aliases,
            entry.interop,
            family=entry.family,
            encoding=entry.encoding,
            categories=entry.categories,
            description=entry.description,
        )
        transform = OCIO.BuiltinTransform(entry.builtin) if entry.builtin else own.get(entry.name)
        if transform is not None:
            space.setTransform(transform, OCIO.COLORSPACE_DIR_TO_REFERENCE)
        made.append(space)
    return [*made, _data_space(minor)]


def _data_space(minor: int) -> OCIO.ColorSpace:
    data = _space(
        minor,
        DATA,
        ("Utility - Raw", "utility_raw"),
        "data",
        family="Utility",
        encoding="data",
        categories=["file-io"],
        description="Data, not colour: never converted.",
    )
    data.removeAlias("data")  # a role's name; the ID alone does without, since OpenColorIO knows it
    data.setIsData(True)
    return data


def _srgb_curve() -> OCIO.ExponentWithLinearTransform:
    """Encoded → linear, IEC 61966-2-1, mirrored below 0."""
    return OCIO.ExponentWithLinearTransform(
        gamma=[2.4, 2.4, 2.4, 1.0], offset=[0.055, 0.055, 0.055, 0.0], negativeStyle=OCIO.NEGATIVE_MIRROR
    )


def _display_spaces(minor: int) -> list[OCIO.ColorSpace]:
    reference = _space(
        minor,
        DISPLAY_REFERENCE,
        ("cie_xyz_d65_display", "CIE-XYZ-D65"),
        "ocio:lin_ciexyzd65_display",
        referenceSpace=OCIO.REFERENCE_SPACE_DISPLAY,
        family="Display",
        encoding="display-linear",
        categories=["file-io"],
        description="The display reference: CIE XYZ with a D65 white.",
    )
    made = [reference]
    for display in _DISPLAYS:
        space = _space(
            minor,
            display.name,
            display.aliases[:-1],
            display.aliases[-1],
            referenceSpace=OCIO.REFERENCE_SPACE_DISPLAY,
            family="Display",
            encoding="sdr-video",
            categories=["file-io"],
            description=display.description,
        )
        space.setTransform(_to_display(display.builtin, minor), OCIO.COLORSPACE_DIR_FROM_REFERENCE)
        made.append(space)
    return made


def _to_display(builtin: str, minor: int) -> OCIO.Transform:
    """CIE XYZ D65 → display. Display P3, which profiles have as a builtin from 2.3 on, is written out for all."""
    if builtin == "DisplayP3":
        curve = _srgb_curve()
        curve.setDirection(OCIO.TRANSFORM_DIR_INVERSE)
        return OCIO.GroupTransform([matrix_transform(np.asarray(np.linalg.inv(to_xyz("linear-p3")))), curve])
    mirrored = " - MIRROR NEGS" if minor >= MIRRORED_DISPLAYS else ""
    return OCIO.BuiltinTransform(f"DISPLAY - CIE-XYZ-D65_to_{builtin}{mirrored}")
