"""What every config of cameras starts from: reference spaces, roles, displays, the default of the file rules.

Spaces, with their names, aliases, IDs and views, are those of OpenColorIO's own studio config, so that both merge and
scripts know them.
"""

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

MINOR_VERSION = 1
"""Profile version 2.1, read by every OpenColorIO since 2021; newer ones add names, not colours."""

LUT_FOLDER = "luts"
LUT_SUFFIXES = {
    *(".3dl", ".clf", ".csp", ".ctf", ".cub", ".cube", ".hdl", ".itx", ".lut", ".mga", ".m3d", ".spi1d", ".spi3d"),
    *(".cc", ".ccc", ".cdl", ".icc", ".icm", ".look", ".spimtx", ".vf"),
}
"""Files that OpenColorIO reads, and so what belongs to a config."""
REFERENCE = "ACES2065-1"
DISPLAY = "sRGB - Display"
WORKING = "ACEScg"
TEXTURE = "sRGB Encoded Rec.709 (sRGB)"
DATA = "Raw"
DISPLAY_REFERENCE = "CIE XYZ-D65 - Display-referred"
UN_TONE_MAPPED = "Un-tone-mapped"

SRGB_IMAGES = ("jpg", "jpeg", "png")
"""Files of these kinds are sRGB where nothing says otherwise."""

STUDIO = "ocio://studio-config-v5.0.0_aces-v2.1_ocio-v2.6"
"""OpenColorIO's own config, from which the spaces of scenes and displays are."""
SCENE_SPACES = (REFERENCE, WORKING, "ACEScct", "Linear Rec.709 (sRGB)", TEXTURE, DATA)
DISPLAYS = (DISPLAY, "Display P3 - Display", "Gamma 2.6 P3-D65 - Display", "Rec.1886 Rec.709 - Display")


def base_config() -> OCIO.Config:
    """Reference spaces, roles, displays, file rules: what is there before any camera."""
    config = OCIO.Config()
    config.setVersion(2, MINOR_VERSION)
    config.setName("lutforge")
    config.setDescription("Cameras calibrated by LutForge: their RAW and JPEGs as colour spaces, views and looks.")
    config.setSearchPath(LUT_FOLDER)
    config.setEnvironmentMode(OCIO.ENV_ENVIRONMENT_LOAD_PREDEFINED)
    studio = OCIO.Config.CreateFromFile(STUDIO)
    for name in (*SCENE_SPACES, DISPLAY_REFERENCE, *DISPLAYS):
        config.addColorSpace(_in_version(studio.getColorSpace(name)))
    for role in studio.getRoleNames():
        config.setRole(role, studio.getRoleColorSpace(role))
    config.setRole(OCIO.ROLE_RENDERING, WORKING)
    config.setInactiveColorSpaces(DISPLAY_REFERENCE)
    config.addViewTransform(studio.getViewTransform(UN_TONE_MAPPED))
    config.setDefaultViewTransformName(UN_TONE_MAPPED)
    config.addSharedView(UN_TONE_MAPPED, UN_TONE_MAPPED, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", "", "")
    rules = OCIO.FileRules()  # sRGB for the files that are so unless told otherwise; others pass as they are
    for index, kind in enumerate(SRGB_IMAGES):
        either_case = "".join(f"[{letter}{letter.upper()}]" for letter in kind)
        rules.insertRule(index, f"sRGB {kind}", TEXTURE, "*", either_case)
    rules.setDefaultRuleColorSpace(DATA)
    config.setFileRules(rules)
    return config


def _in_version(space: OCIO.ColorSpace) -> OCIO.ColorSpace:
    """A space of the studio config as a config of version 2.1 can hold it: no IDs, and negative values are clamped."""
    space.setInteropID("")
    space.setInterchangeAttribute("amf_transform_ids", "")
    built_in = space.getTransform(OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    if isinstance(built_in, OCIO.BuiltinTransform):
        clamping = built_in.getStyle().removesuffix(" - MIRROR NEGS")
        if clamping != built_in.getStyle():
            shown = OCIO.BuiltinTransform(clamping)
            space.setDescription(space.getDescription().removesuffix(", mirror neg. values"))
        else:  # Display P3, which profiles have by name from 2.3 on, is written out
            shown = OCIO.Config.CreateRaw().getProcessor(built_in).createGroupTransform()
        space.setTransform(shown, OCIO.COLORSPACE_DIR_FROM_REFERENCE)
    return space
