"""Views: any scene-linear footage seen through a camera's picture style, on every display of the config."""

from collections.abc import Sequence

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.ocio.names import UniqueNames, space_name
from lutforge.ocio.renderings import Rendering
from lutforge.ocio.spaces import jpeg_to_reference, reference_to_jpeg


def add_views(
    config: OCIO.Config, renderings: Sequence[Rendering], defaults: dict[tuple[str, str], str], views: UniqueNames
) -> tuple[str, ...]:
    """A view transform and a shared view for each style of each camera. Returns their names. views: names taken.

    The camera's JPEG is sRGB: it is taken to CIE XYZ, and from there to each display by OpenColorIO's own spaces.
    """
    added = []
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
        config.addViewTransform(
            OCIO.ViewTransform(
                referenceSpace=OCIO.REFERENCE_SPACE_SCENE,
                name=name,
                family=camera.family,
                description=f"As the {camera.profile.camera} renders: picture style {style}, white balance {balance}",
                fromReference=to_display,
                **properties,
            )
        )
        config.addSharedView(name, name, OCIO.OCIO_VIEW_USE_DISPLAY_NAME, "", "", "")
        added.append(name)
    return tuple(added)


def _srgb(direction: OCIO.TransformDirection) -> OCIO.BuiltinTransform:
    return OCIO.BuiltinTransform("DISPLAY - CIE-XYZ-D65_to_sRGB", direction)
