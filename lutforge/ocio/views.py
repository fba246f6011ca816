"""The views of a config: one for each style of each camera, which shows a scene as that camera renders it."""

from collections.abc import Sequence
from dataclasses import dataclass

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.ocio.camera_spaces import jpeg_to_reference, reference_to_jpeg
from lutforge.ocio.cameras import UniqueNames, space_name
from lutforge.ocio.common import DATA, DISPLAYS, SCENE_RULE, UN_TONE_MAPPED
from lutforge.ocio.renderings import Rendering


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


def _default_balances(renderings: Sequence[Rendering]) -> dict[tuple[str, str], str]:
    """The white balance of the view, by camera name and style: that of the reference, or else the first."""
    balances: dict[tuple[str, str], str] = {}
    for rendering in renderings:
        key = (rendering.camera.name, rendering.style)
        reference = rendering.camera.reference_balance
        if reference in rendering.white_balances or key not in balances:
            balances[key] = reference if reference in rendering.white_balances else rendering.white_balances[0]
    return balances


def _srgb(direction: OCIO.TransformDirection) -> OCIO.BuiltinTransform:
    """CIE XYZ → encoded sRGB, or its inverse."""
    return OCIO.BuiltinTransform("DISPLAY - CIE-XYZ-D65_to_sRGB", direction)


def arrange_views(config: OCIO.Config, view_names: Sequence[str]) -> None:
    """Offer the views on each display in this order, then the view without a tone scale, and that of data."""
    for display in DISPLAYS:
        for name in (*view_names, UN_TONE_MAPPED):
            config.addDisplaySharedView(display, name)
        config.addDisplayView(display, DATA, DATA, "")
        config.addActiveDisplay(display)
    for name in (*view_names, UN_TONE_MAPPED, DATA):  # the order of the menus; the first is the default
        config.addActiveView(name)
