"""The colour spaces of a camera, its RAW and its JPEGs per style and white balance; its views and looks.

The scene reference is ACES2065-1 under one white balance of each camera, daylight or the nearest to it: the reference
values of a scene do not depend on the camera's white balance. RAW → JPEG is the render of the profile, JPEG → RAW its
inverse, and one JPEG space → another a refinish (thesis, equation 6.1).
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.errors import ConfigError
from lutforge.luts.ocio_transforms import matrix_transform
from lutforge.model.provenance import ReferenceRaw, ResponseOnly
from lutforge.ocio.cameras import JPEG, Camera, UniqueNames, file_stem, space_name
from lutforge.ocio.renderings import Rendering

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


def base_config(minor: int = PROFILE_VERSIONS[OLDEST]) -> OCIO.Config:
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


def file_transform(name: str) -> OCIO.FileTransform:
    """A LUT file of the config."""
    return OCIO.FileTransform(src=name, interpolation=OCIO.INTERP_BEST)


class EqualityGroups:
    """The equality groups of a config: colour spaces with equal conversions, between which programs convert nothing.

    A group bears the alias of its first colour space.
    """

    def __init__(self) -> None:
        self._names: dict[tuple[str, bytes], str] = {}

    def of(self, space: str, files: str, to_reference: Array) -> str:
        """The group of a colour space, which the LUT files and the matrix (3, 3) of its conversion decide."""
        return self._names.setdefault((files, to_reference.tobytes()), file_stem(space))


def add_raw(config: OCIO.Config, camera: Camera, groups: EqualityGroups) -> None:
    """Add the camera's RAW before white balance, and after each."""
    for balance in (None, *camera.profile.white_balances):
        name = camera.raw(balance)
        matrix = camera.to_reference(balance)
        of_jpegs = isinstance(camera.profile.provenance, ReferenceRaw | ResponseOnly)
        kind = "values of the JPEGs" if of_jpegs else "RAW"
        description = f"Linear {kind} of the {camera.profile.camera}, black 0, saturation 1, "
        if balance is None:
            description += f"before white balance. Neutral in the reference under {camera.reference_balance}"
        else:
            setting = camera.profile.white_balances[balance]
            kelvin = f", about {setting.kelvin:.0f} K" if setting.kelvin is not None else ""
            r, g, b = setting.multipliers
            description += f"after white balance {balance}{kelvin}: multipliers {r:.4f}, {g:.4f}, {b:.4f}"
        group = groups.of(name, "", matrix)
        properties = {"equalityGroup": group, "toReference": matrix_transform(matrix)}
        config.addColorSpace(_space_of_files(name, camera.family, description, "scene-linear", properties))


def _space_of_files(
    name: str, family: str, description: str, encoding: str, properties: Mapping[str, object]
) -> OCIO.ColorSpace:
    """A colour space of pictures in files. properties: more arguments of OpenColorIO's ColorSpace, by their names."""
    return OCIO.ColorSpace(
        name=name, aliases=[file_stem(name)], family=family, encoding=encoding, categories=["file-io", "texture"],
        description=description, bitDepth=OCIO.BIT_DEPTH_F32, **properties,
    )  # fmt: skip


def jpeg_to_reference(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """JPEG → ACES2065-1."""
    matrix = rendering.camera.to_reference(balance)
    return OCIO.GroupTransform([file_transform(rendering.file("linearize")), matrix_transform(matrix)])


def reference_to_jpeg(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """ACES2065-1 → JPEG."""
    to_raw = np.asarray(np.linalg.inv(rendering.camera.to_reference(balance)), dtype=np.float64)
    return OCIO.GroupTransform([matrix_transform(to_raw), file_transform(rendering.file("render"))])


DESCRIBED_ERRORS = ("render_mean", "render_max", "render_de00_mean", "linearize_mean", "linearize_max")
"""The held-out errors of a style that the description of a colour space states."""


def add_jpegs(config: OCIO.Config, rendering: Rendering, groups: EqualityGroups, errors: Sequence[str]) -> None:
    """Add the JPEGs of a rendering under each white balance. errors: lines on the errors of its LUTs."""
    camera = rendering.camera
    style = camera.profile.styles[rendering.style]
    named = {name.replace("de00_mean", "mean_CIEDE2000").replace("_", " "): name for name in DESCRIBED_ERRORS}
    held_out = "; ".join(f"{words} {style.errors[name]:.3g}" for words, name in named.items() if name in style.errors)
    for balance in rendering.white_balances:
        name = camera.jpeg(rendering.style, balance)
        setting = f"JPEG of the {camera.profile.camera}, picture style {rendering.style}, white balance {balance}"
        description = "\n".join((setting, f"held-out error of the profile: {held_out or 'not measured'}", *errors))
        properties: dict[str, object] = {"equalityGroup": groups.of(name, rendering.stem, camera.to_reference(balance))}
        if rendering.linearize is not None:
            properties["toReference"] = jpeg_to_reference(rendering, balance)
        if rendering.render is not None:
            properties["fromReference"] = reference_to_jpeg(rendering, balance)
        config.addColorSpace(_space_of_files(name, camera.family, description, "sdr-video", properties))


def _default_balances(renderings: Sequence[Rendering]) -> dict[tuple[str, str], str]:
    """The white balance of the view, by camera name and style: that of the reference, or else the first."""
    balances: dict[tuple[str, str], str] = {}
    for rendering in renderings:
        key = (rendering.camera.name, rendering.style)
        reference = rendering.camera.reference_balance
        if reference in rendering.white_balances or key not in balances:
            balances[key] = reference if reference in rendering.white_balances else rendering.white_balances[0]
    return balances


@dataclass(frozen=True)
class View:
    """The view of a camera's style: its name, and the colour space of the JPEG that it shows."""

    name: str
    jpeg: str


def add_views(config: OCIO.Config, renderings: Sequence[Rendering], unique_view_name: UniqueNames) -> tuple[View, ...]:
    """Add a view transform and a shared view for each style of each camera."""
    # The camera's JPEG is sRGB: it is converted to CIE XYZ, and from there to each display by OpenColorIO's spaces.
    added = []
    defaults = _default_balances(renderings)
    rule = SCENE_RULE if config.getViewingRules().getNumEntries() else ""
    for rendering in renderings:
        camera, style = rendering.camera, rendering.style
        balance = defaults[camera.name, style]
        if rendering.render is None or balance not in rendering.white_balances:
            continue
        name = unique_view_name(space_name(camera.name, camera.styles[style]))
        to_display = OCIO.GroupTransform([reference_to_jpeg(rendering, balance), _srgb(OCIO.TRANSFORM_DIR_INVERSE)])
        properties = {}
        if rendering.linearize is not None:
            back = OCIO.GroupTransform([_srgb(OCIO.TRANSFORM_DIR_FORWARD), jpeg_to_reference(rendering, balance)])
            properties["toReference"] = back
        description = f"As the {camera.profile.camera} renders: picture style {style}, white balance {balance}"
        view = OCIO.ViewTransform(
            referenceSpace=OCIO.REFERENCE_SPACE_SCENE, name=name, family=camera.family, description=description,
            fromReference=to_display, **properties,
        )  # fmt: skip
        config.addViewTransform(view)
        config.addSharedView(name, name, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", rule, "")
        added.append(View(name, camera.jpeg(style, balance)))
    return tuple(added)


def arrange_views(config: OCIO.Config, view_names: Sequence[str]) -> None:
    """Offer the views on each display in this order, then the view without a tone scale, and that of data."""
    for display in DISPLAYS:
        for name in (*view_names, UN_TONE_MAPPED):
            config.addDisplaySharedView(display, name)
        config.addDisplayView(display, DATA, DATA, "")
        config.addActiveDisplay(display)
    for name in (*view_names, UN_TONE_MAPPED, DATA):  # the order of the menus; the first is the default
        config.addActiveView(name)


def _srgb(direction: OCIO.TransformDirection) -> OCIO.BuiltinTransform:
    """CIE XYZ → encoded sRGB, or its inverse."""
    return OCIO.BuiltinTransform("DISPLAY - CIE-XYZ-D65_to_sRGB", direction)


def add_looks(
    config: OCIO.Config, camera: Camera, renderings: Sequence[Rendering], unique_look_name: UniqueNames
) -> None:
    """Add the looks of a camera with these renderings: to another white balance, or another style.

    A look changes colours of its process space into colours of that same space, so that programs can apply it between
    any two spaces. With source and target the JPEG space that a photograph was taken in, the result is the JPEG that
    the camera would have made with the other setting. Every look has an inverse.
    """
    looks = [
        *_looks_of_jpeg_balances(camera, renderings),
        *_looks_of_styles(camera, renderings),
        *_looks_of_raw_balances(camera),
    ]
    for look in looks:
        look.setName(unique_look_name(look.getName()))
        config.addLook(look)


def _looks_of_jpeg_balances(camera: Camera, renderings: Sequence[Rendering]) -> Iterator[OCIO.Look]:
    """Looks of photographs from one white balance to another, refinished as `apply` does.

    A conversion between two colour spaces knows only the linear values of the scene, which can be the same for
    burnt-out white under one white balance and for a coloured highlight under another. These looks know both white
    balances, and keep white neutral.
    """
    names = camera.balances
    for rendering in renderings:
        style = camera.styles[rendering.style]
        refinishes = {(source, target) for source, target, _ in rendering.refinishes()}
        for source, target in camera.look_pairs:
            if (source, target) not in refinishes:
                continue
            yield OCIO.Look(
                name=space_name(camera.name, JPEG, style, f"{names[source]} → {names[target]}"),
                processSpace=camera.jpeg(rendering.style, source),
                transform=_refinish(rendering, source, target),
                inverseTransform=_refinish(rendering, target, source),
                description=f"A JPEG in picture style {rendering.style}, white balance {target} instead of {source}",
            )


def _refinish(rendering: Rendering, source: str, target: str) -> OCIO.GroupTransform:
    """JPEG under one white balance → JPEG under another: linearized, changed in white balance, and rendered again."""
    files = (rendering.file("calibrated"), rendering.balance_file(source, target), rendering.file("render"))
    return OCIO.GroupTransform([file_transform(file) for file in files])


def _looks_of_styles(camera: Camera, renderings: Sequence[Rendering]) -> Iterator[OCIO.Look]:
    """Looks of photographs from the standard style to each of the others, and back."""
    for source, target, balance in _style_pairs(camera, renderings):
        before = camera.jpeg(source, balance)
        after = camera.jpeg(target, balance)
        yield OCIO.Look(
            name=space_name(before, "→", camera.styles[target], camera.balances[balance]),
            processSpace=before,
            transform=OCIO.ColorSpaceTransform(before, after),
            inverseTransform=OCIO.ColorSpaceTransform(after, before),
            description=f"A JPEG in picture style {target} instead of {source}, white balance {balance}",
        )


def _looks_of_raw_balances(camera: Camera) -> Iterator[OCIO.Look]:
    """Looks of RAW from one white balance to another: exact for any linear values, such as a rendered scene's.

    They are common to all styles.
    """
    names = camera.balances
    for source, target in camera.look_pairs:
        yield OCIO.Look(
            name=space_name(camera.name, "scene", f"{names[source]} → {names[target]}"),
            processSpace=camera.raw(),
            transform=matrix_transform(np.diag(camera.gain(target) / camera.gain(source))),
            description=f"A scene as white balance {target} shows it, instead of {source}",
        )


def _style_pairs(camera: Camera, renderings: Sequence[Rendering]) -> Iterator[tuple[str, str, str]]:
    """The styles (from, to) that looks change, with the white balance: the standard style to all others, and back."""
    both_ways = [
        rendering for rendering in renderings if rendering.render is not None and rendering.linearize is not None
    ]
    balance = camera.look_pairs[0][1] if camera.look_pairs else camera.reference_balance
    styles = list(dict.fromkeys(rendering.style for rendering in both_ways if balance in rendering.white_balances))
    if not styles:
        return
    hub = "standard" if "standard" in styles else styles[0]
    for style in styles:
        if style != hub:
            yield hub, style, balance
            yield style, hub, balance
