"""What every config of cameras starts from: reference spaces, roles, a display, file rules."""

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.model.scene_spaces import from_linear_srgb

LUT_FOLDER = "luts"
REFERENCE = "ACES2065-1"
DISPLAY = "sRGB - Display"
WORKING = "ACEScg"

ROLES = {
    OCIO.ROLE_INTERCHANGE_SCENE: REFERENCE,
    OCIO.ROLE_INTERCHANGE_DISPLAY: "CIE-XYZ-D65",
    OCIO.ROLE_SCENE_LINEAR: WORKING,
    OCIO.ROLE_RENDERING: WORKING,
    OCIO.ROLE_COMPOSITING_LOG: "ACEScct",
    OCIO.ROLE_COLOR_TIMING: "ACEScct",
    OCIO.ROLE_COLOR_PICKING: "sRGB - Texture",
    OCIO.ROLE_TEXTURE_PAINT: "sRGB - Texture",
    OCIO.ROLE_MATTE_PAINT: "sRGB - Texture",
    OCIO.ROLE_DATA: "Raw",
}


def matrix_transform(matrix: NDArray[np.float64]) -> OCIO.MatrixTransform:
    """A 3 × 3 matrix as a transform."""
    whole = np.eye(4)
    whole[:3, :3] = matrix
    return OCIO.MatrixTransform(whole.ravel().tolist())


def base_config() -> OCIO.Config:
    """Reference spaces, roles, one display, file rules: what is there before any camera."""
    config = OCIO.Config()
    config.setVersion(2, 1)
    config.setName("lutforge")
    config.setDescription("Cameras calibrated by LutForge: RAW and JPEG colour spaces, and white-balance looks.")
    config.setSearchPath(LUT_FOLDER)
    config.setEnvironmentMode(OCIO.ENV_ENVIRONMENT_LOAD_PREDEFINED)
    for space in _scene_spaces():
        config.addColorSpace(space)
    for space in _display_spaces():
        config.addColorSpace(space)
    for role, name in ROLES.items():
        config.setRole(role, name)
    config.addViewTransform(
        OCIO.ViewTransform(
            referenceSpace=OCIO.REFERENCE_SPACE_SCENE,
            name="Colorimetric",
            description="Scene to display without a tone scale, clipped by the display.",
            fromReference=OCIO.BuiltinTransform("UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD"),
        )
    )
    config.addDisplayView(DISPLAY, "Colorimetric", "Colorimetric", DISPLAY, "", "", "Scene to display, clipped.")
    config.addDisplayView(DISPLAY, "Raw", "Raw", "")
    config.setActiveDisplays(DISPLAY)
    rules = OCIO.FileRules()
    rules.setDefaultRuleColorSpace("sRGB - Texture")
    config.setFileRules(rules)
    return config


def _scene_spaces() -> list[OCIO.ColorSpace]:
    def space(
        name: str, aliases: list[str], encoding: str, description: str, transform: OCIO.Transform | None
    ) -> OCIO.ColorSpace:
        made = OCIO.ColorSpace(
            name=name,
            aliases=aliases,
            family="ACES" if name.startswith("ACES") else "Utility",
            encoding=encoding,
            categories=["working-space" if encoding in ("scene-linear", "log") else "file-io"],
            description=description,
            bitDepth=OCIO.BIT_DEPTH_F32,
        )
        if transform is not None:
            made.setTransform(transform, OCIO.COLORSPACE_DIR_TO_REFERENCE)
        return made

    linear = matrix_transform(from_linear_srgb("aces2065-1"))
    curve = OCIO.ExponentWithLinearTransform(
        gamma=[2.4, 2.4, 2.4, 1.0],
        offset=[0.055, 0.055, 0.055, 0.0],
        negativeStyle=OCIO.NEGATIVE_MIRROR,
    )
    raw = space("Raw", ["utility_raw"], "data", "Data, not colour.", None)
    raw.setIsData(True)
    return [
        space(REFERENCE, ["aces2065_1", "ACES - ACES2065-1"], "scene-linear", "The scene reference, AP0.", None),
        space(
            WORKING,
            ["acescg_ap1", "lin_ap1"],
            "scene-linear",
            "Scene-linear AP1.",
            OCIO.BuiltinTransform("ACEScg_to_ACES2065-1"),
        ),
        space(
            "ACEScct",
            ["acescct_ap1"],
            "log",
            "Log AP1 for grading.",
            OCIO.BuiltinTransform("ACEScct_to_ACES2065-1"),
        ),
        space(
            "Linear Rec.709 (sRGB)",
            ["lin_rec709", "lin_srgb"],
            "scene-linear",
            "Linear sRGB primaries, D65.",
            linear,
        ),
        space(
            "sRGB - Texture",
            ["srgb_tx", "srgb_texture"],
            "sdr-video",
            "sRGB-encoded images without a tone scale.",
            OCIO.GroupTransform([curve, linear]),
        ),
        raw,
    ]


def _display_spaces() -> list[OCIO.ColorSpace]:
    xyz = OCIO.ColorSpace(
        referenceSpace=OCIO.REFERENCE_SPACE_DISPLAY,
        name="CIE-XYZ-D65",
        aliases=["cie_xyz_d65"],
        family="Display",
        encoding="display-linear",
        categories=["file-io"],
        description="The display reference: CIE XYZ with a D65 white.",
        bitDepth=OCIO.BIT_DEPTH_F32,
    )
    srgb = OCIO.ColorSpace(
        referenceSpace=OCIO.REFERENCE_SPACE_DISPLAY,
        name=DISPLAY,
        aliases=["srgb_display"],
        family="Display",
        encoding="sdr-video",
        categories=["file-io"],
        description="An sRGB monitor.",
        bitDepth=OCIO.BIT_DEPTH_F32,
        fromReference=OCIO.BuiltinTransform("DISPLAY - CIE-XYZ-D65_to_sRGB"),
    )
    return [xyz, srgb]
