"""The colour spaces of a camera, its RAW and its JPEGs per style and white balance; its views and looks.

The scene reference is ACES2065-1 under one white balance of each camera, its daylight (or what comes nearest): the
reference RAW of a scene does not change with the dial. RAW → JPEG is the render of the profile, JPEG → RAW the way
back, and from one JPEG space to another is a refinish (thesis, equation 6.1).
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.luts.sequence import matrix_transform
from lutforge.model.camera_profile import has_own_raw
from lutforge.ocio.cameras import Camera, UniqueNames, file_stem, space_name
from lutforge.ocio.renderings import Rendering

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


# --- What every config starts from: reference spaces, roles, displays, the default of the file rules ------------------


def file_transform(name: str) -> OCIO.FileTransform:
    """A LUT file of the config."""
    return OCIO.FileTransform(src=name, interpolation=OCIO.INTERP_BEST)


def add_raw(config: OCIO.Config, camera: Camera, groups: dict[object, str]) -> None:
    """The camera's RAW before white balance, and after each. groups: equality groups, by what decides them."""
    for balance in (None, *camera.profile.white_balances):
        name, matrix = camera.raw(balance), camera.to_reference(balance)
        light = "RAW" if has_own_raw(camera.profile) else "light of the JPEGs"
        what = f"Linear {light} of the {camera.profile.camera}, black 0, saturation 1, "
        if balance is None:
            what += f"before white balance. Neutral in the reference under {camera.own}"
        else:
            setting = camera.profile.white_balances[balance]
            kelvin = f", about {setting.kelvin:.0f} K" if setting.kelvin is not None else ""
            r, g, b = setting.multipliers
            what += f"after white balance {balance}{kelvin}: multipliers {r:.4f}, {g:.4f}, {b:.4f}"
        group = groups.setdefault(matrix.tobytes(), file_stem(name))
        way = matrix_transform(matrix)
        _add(config, name, camera.family, what, "scene-linear", equalityGroup=group, toReference=way)


def _add(config: OCIO.Config, name: str, family: str, what: str, encoding: str, **more: object) -> None:
    """Add a colour space of files."""
    space = OCIO.ColorSpace(
        name=name, aliases=[file_stem(name)], family=family, encoding=encoding, categories=["file-io"],
        description=what, bitDepth=OCIO.BIT_DEPTH_F32, **more,
    )  # fmt: skip
    config.addColorSpace(space)


def jpeg_to_reference(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """JPEG → ACES2065-1."""
    matrix = rendering.camera.to_reference(balance)
    return OCIO.GroupTransform([file_transform(rendering.file("linearize")), matrix_transform(matrix)])


def reference_to_jpeg(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """ACES2065-1 → JPEG."""
    to_raw = np.asarray(np.linalg.inv(rendering.camera.to_reference(balance)), dtype=np.float64)
    return OCIO.GroupTransform([matrix_transform(to_raw), file_transform(rendering.file("render"))])


HELD_OUT = ("render_mean", "render_max", "render_de00_mean", "linearize_mean", "linearize_max")
"""The errors of a style that a colour space's description tells."""


def add_jpegs(config: OCIO.Config, rendering: Rendering, groups: dict[object, str], errors: Sequence[str]) -> None:
    """The JPEGs of a rendering by white balance. errors: of its LUTs."""
    camera, style = rendering.camera, rendering.camera.profile.styles[rendering.style]
    named = {name.replace("de00_mean", "mean_CIEDE2000").replace("_", " "): name for name in HELD_OUT}
    held_out = "; ".join(f"{words} {style.errors[name]:.3g}" for words, name in named.items() if name in style.errors)
    for balance in rendering.white_balances:
        name = camera.jpeg(rendering.style, balance)
        what = f"JPEG of the {camera.profile.camera}, picture style {rendering.style}, white balance {balance}"
        what = "\n".join((what, f"held-out error of the profile: {held_out or 'not measured'}", *errors))
        group = groups.setdefault((rendering.stem, camera.to_reference(balance).tobytes()), file_stem(name))
        ways = {}
        if rendering.linearize is not None:
            ways["toReference"] = jpeg_to_reference(rendering, balance)
        if rendering.render is not None:
            ways["fromReference"] = reference_to_jpeg(rendering, balance)
        _add(config, name, camera.family, what, "sdr-video", equalityGroup=group, **ways)


def _default_balances(renderings: Sequence[Rendering]) -> dict[tuple[str, str], str]:
    """Per camera name and style the white balance of its view: the camera's own, or the first that it has."""
    found: dict[tuple[str, str], str] = {}
    for rendering in renderings:
        key, own = (rendering.camera.name, rendering.style), rendering.camera.own
        if own in rendering.white_balances or key not in found:
            found[key] = own if own in rendering.white_balances else rendering.white_balances[0]
    return found


def add_views(config: OCIO.Config, renderings: Sequence[Rendering], views: UniqueNames) -> tuple[str, ...]:
    """A view transform and a shared view for each style of each camera; their names. views: names taken."""
    # The camera's JPEG is sRGB: it is taken to CIE XYZ, and from there to each display by OpenColorIO's own spaces.
    added, defaults = [], _default_balances(renderings)
    for rendering in renderings:
        camera, style = rendering.camera, rendering.style
        balance = defaults[camera.name, style]
        if rendering.render is None or balance not in rendering.white_balances:
            continue
        name = views(space_name(camera.name, camera.styles[style]))
        to_display = OCIO.GroupTransform([reference_to_jpeg(rendering, balance), _srgb(OCIO.TRANSFORM_DIR_INVERSE)])
        properties = {}
        if rendering.linearize is not None:
            back = OCIO.GroupTransform([_srgb(OCIO.TRANSFORM_DIR_FORWARD), jpeg_to_reference(rendering, balance)])
            properties["toReference"] = back
        what = f"As the {camera.profile.camera} renders: picture style {style}, white balance {balance}"
        view = OCIO.ViewTransform(
            referenceSpace=OCIO.REFERENCE_SPACE_SCENE, name=name, family=camera.family, description=what,
            fromReference=to_display, **properties,
        )  # fmt: skip
        config.addViewTransform(view)
        config.addSharedView(name, name, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", "", "")
        added.append(name)
    return tuple(added)


def _srgb(direction: OCIO.TransformDirection) -> OCIO.BuiltinTransform:
    return OCIO.BuiltinTransform("DISPLAY - CIE-XYZ-D65_to_sRGB", direction)


# --- Refinish looks: another white balance, or another style ----------------------------------------------------------
# A look changes colours of its process space into colours of that same space, so that programs can apply it between any
# two spaces. With source and target the JPEG space that a photograph was taken in, the result is the JPEG that the
# camera would have made with the other setting.


def add_looks(config: OCIO.Config, camera: Camera, renderings: Sequence[Rendering], looks: UniqueNames) -> None:
    """Add all looks of a camera with these renderings. looks: the names that are taken."""

    def add(name: str, space: str, transform: OCIO.Transform, back: OCIO.Transform | None, what: str) -> None:
        inverse = {} if back is None else {"inverseTransform": back}
        look = OCIO.Look(name=looks(name), processSpace=space, transform=transform, description=what, **inverse)
        config.addLook(look)

    names, styles = camera.balances, camera.styles
    # From each white balance to each other, in RAW: exact, for any light, and the same for all styles.
    for source, target in permutations(camera.profile.white_balances, 2):
        ratio = matrix_transform(np.diag(camera.gain(target) / camera.gain(source)))
        name = space_name(camera.name, names[source], "to", names[target])
        add(name, camera.raw(), ratio, None, f"White balance {target} instead of {source}")
    # For photographs, from each white balance of a style to each other: as `apply` refinishes. Colour space
    # conversions pass the light of the scene alone, which does not tell burnt-out white under one white balance
    # from a coloured highlight under another; these know both.
    for rendering in renderings:
        render = rendering.file("render")
        for source, target, _ in rendering.refinishes():
            there, back = (
                OCIO.GroupTransform([file_transform(file) for file in (rendering.file("calibrated"), step, render)])
                for step in (rendering.balance_file(source, target), rendering.balance_file(target, source))
            )
            name = space_name(camera.name, styles[rendering.style], names[source], "to", names[target])
            what = f"A JPEG in picture style {rendering.style}, white balance {target} instead of {source}"
            add(name, camera.jpeg(rendering.style, source), there, back, what)
    # From each style to each other, under each white balance that both have.
    whole = [part for part in renderings if part.render is not None and part.linearize is not None]
    jpegs = [(part.style, balance) for part in whole for balance in part.white_balances]
    for (source, balance), (target, other) in permutations(jpegs, 2):
        if balance == other:
            before, after = camera.jpeg(source, balance), camera.jpeg(target, balance)
            there, back = OCIO.ColorSpaceTransform(before, after), OCIO.ColorSpaceTransform(after, before)
            name = space_name(camera.name, styles[source], names[balance], "to", styles[target])
            what = f"A JPEG in picture style {target} instead of {source}, white balance {balance}"
            add(name, before, there, back, what)
