"""What every config holds, whatever its cameras: common colour spaces, roles, displays, and rules for files.

The scene reference is ACES2065-1 under one white balance of each camera, daylight or the nearest to it: the reference
values of a scene do not depend on the camera's white balance.
"""

import re
from collections.abc import Iterable

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.errors import ConfigError
from lutforge.ocio.cameras import file_stem

OLDEST = "2.1"
PROFILE_VERSIONS = {OLDEST: 1, "2.5": 5}
"""Versions of a config, and their minor numbers. 2.1 is read by every OpenColorIO since August 2021."""
NEW_NAMES = 5
"""The minor version from which configs can hold interoperability IDs, mirrored negative values, and viewing rules."""

LUT_FOLDER = "luts"
LUT_SUFFIXES = {
    *(".3dl", ".clf", ".csp", ".ctf", ".cub", ".cube", ".hdl", ".itx", ".lut", ".mga", ".m3d", ".spi1d", ".spi3d"),
    *(".cc", ".ccc", ".cdl", ".icc", ".icm", ".look", ".spimtx", ".vf"),
}
"""Suffixes of the files that belong to a config: those that OpenColorIO reads."""

# The names below are those of OpenColorIO's studio config, so that other configs and programs know them.
REFERENCE = "ACES2065-1"
"""The scene reference, through which all scenes and cameras are converted."""
DISPLAY_REFERENCE = "CIE XYZ-D65 - Display-referred"
"""The display reference, through which all displays are converted."""
WORKING = "ACEScg"
"""The scene-linear space in which pictures are rendered and composited."""
LINEAR_REC709 = "Linear Rec.709 (sRGB)"
"""The scene-linear space with the primaries of sRGB."""
TEXTURE = "sRGB Encoded Rec.709 (sRGB)"
"""The space of finished pictures and textures, encoded sRGB."""
DATA = "Raw"
"""The space of what is no colour, which no conversion changes."""
DISPLAY = "sRGB - Display"
"""The space of an sRGB monitor."""
UN_TONE_MAPPED = "Un-tone-mapped"
"""The view without a tone scale."""
SCENE_RULE = "scene-referred"
"""The viewing rule for views of linear and logarithmic scenes, which finished pictures do not get."""

FILE_KINDS = {"exr": WORKING, "jpg": TEXTURE, "jpeg": TEXTURE, "png": TEXTURE}
"""The colour spaces of files by their suffixes, where their names do not contain one."""

BLENDER_NAMES = {
    REFERENCE: ("Linear ACES",),
    WORKING: ("Linear ACEScg",),
    LINEAR_REC709: ("Linear", "Linear Rec.709", "Linear BT.709"),
    TEXTURE: ("sRGB",),
    DATA: ("Non-Color", "Non-Colour Data", "Generic Data"),
}
"""The names of these spaces in Blender's config, by which .blend files refer to them."""
BLENDER_ROLES = {"default_byte": TEXTURE, "default_float": LINEAR_REC709, "default_sequencer": TEXTURE}
"""Roles that Blender asks a config for: the spaces of pictures of 8 bits, of float pictures, of its video editor."""

STUDIO = "ocio://studio-config-v5.0.0_aces-v2.1_ocio-v2.6"
"""OpenColorIO's built-in config, from which the spaces of scenes and displays are copied."""
SCENE_SPACES = (REFERENCE, WORKING, "ACEScct", LINEAR_REC709, TEXTURE, DATA)
"""The scene-referred spaces that a config has besides those of cameras."""
DISPLAYS = (DISPLAY, "Display P3 - Display", "Gamma 2.6 P3-D65 - Display", "Rec.1886 Rec.709 - Display")
"""The displays that a config has: monitors of sRGB and Display P3, cinema, television."""


def minor_version(text: str) -> int:
    """The minor number of a profile version, "2.1" or "2.5". Raises ConfigError."""
    if text not in PROFILE_VERSIONS:
        raise ConfigError(f'unknown profile version "{text}"; known: {", ".join(PROFILE_VERSIONS)}')
    return PROFILE_VERSIONS[text]


def common_config(minor: int = PROFILE_VERSIONS[OLDEST]) -> OCIO.Config:
    """The config before any camera is added: reference spaces, roles, displays, and rules for files."""
    config = OCIO.Config()
    config.setVersion(2, minor)
    config.setName("lutforge")
    config.setDescription("Cameras calibrated by LutForge: their RAW and JPEGs as colour spaces, views and looks.")
    config.setSearchPath(LUT_FOLDER)

    # The common colour spaces and their roles, as the studio config has them, and those that Blender asks for.
    studio = OCIO.Config.CreateFromFile(STUDIO)
    for name in (*SCENE_SPACES, DISPLAY_REFERENCE, *DISPLAYS):
        space = studio.getColorSpace(name)
        for alias in BLENDER_NAMES.get(name, ()):
            space.addAlias(alias)
        config.addColorSpace(space if minor >= NEW_NAMES else _in_oldest_version(space))
    for role in studio.getRoleNames():
        config.setRole(role, studio.getRoleColorSpace(role))
    config.setRole(OCIO.ROLE_RENDERING, WORKING)
    for role, name in BLENDER_ROLES.items():
        config.setRole(role, name)
    config.setInactiveColorSpaces(DISPLAY_REFERENCE)

    # The view without a tone scale, and rules for views and files.
    config.addViewTransform(studio.getViewTransform(UN_TONE_MAPPED))
    config.setDefaultViewTransformName(UN_TONE_MAPPED)
    config.addSharedView(UN_TONE_MAPPED, UN_TONE_MAPPED, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", "", "")
    if minor >= NEW_NAMES:
        viewing = OCIO.ViewingRules()
        viewing.insertRule(0, SCENE_RULE)
        for encoding in ("scene-linear", "log"):
            viewing.addEncoding(0, encoding)
        config.setViewingRules(viewing)
    add_file_rules(config, ())
    return config


def add_file_rules(config: OCIO.Config, camera_spaces: Iterable[str]) -> None:
    """Set the rules that give files a colour space: by the space's name in their path, else by their suffix.

    Only whole words of a path count. OpenColorIO's own search would match any part of it, so that "raw/a.jpg" would be
    data. Files that match no rule are data.
    """
    words = {name: [name, file_stem(name)] for name in camera_spaces}
    for name in SCENE_SPACES:
        if name != DATA:
            aliases = config.getColorSpace(name).getAliases()
            words[name] = [name, name.lower(), *(alias for alias in aliases if "_" in alias and ":" not in alias)]
    rules = OCIO.FileRules()
    for index, name in enumerate(sorted(words, key=len, reverse=True)):  # of several names the longest counts
        either = "|".join(re.sub(r"([.()])", r"\\\1", word) for word in dict.fromkeys(words[name]))
        rules.insertRule(index, name, name, f"(.*[^A-Za-z0-9])?({either})([^A-Za-z0-9].*)?")
    for kind, space in FILE_KINDS.items():
        either_case = "".join(f"[{letter}{letter.upper()}]" for letter in kind)
        rules.insertRule(rules.getNumEntries() - 1, f"{space} {kind}", space, "*", either_case)
    rules.setDefaultRuleColorSpace(DATA)
    config.setFileRules(rules)


def _in_oldest_version(space: OCIO.ColorSpace) -> OCIO.ColorSpace:
    """A space of the studio config as a config of version 2.1 can hold it: no IDs, and negative values are clamped."""
    space.setInteropID("")
    space.setInterchangeAttribute("amf_transform_ids", "")
    built_in = space.getTransform(OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    if isinstance(built_in, OCIO.BuiltinTransform):
        clamping = built_in.getStyle().removesuffix(" - MIRROR NEGS")
        if clamping != built_in.getStyle():
            transform = OCIO.BuiltinTransform(clamping)
            space.setDescription(space.getDescription().removesuffix(", mirror neg. values"))
        else:  # Display P3, which configs can name from version 2.3 on, becomes its operations
            transform = OCIO.Config.CreateRaw().getProcessor(built_in).createGroupTransform()
        space.setTransform(transform, OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    return space
