"""Refinish looks: another white balance, another picture style, and one look whose settings are context variables.

A look changes colours of its process space into colours of that same space, so that programs can apply it between any
two spaces. With source and target the JPEG space that a photograph was taken in, the result is the JPEG that the camera
would have made with the other setting.
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.ocio.base_config import matrix_transform
from lutforge.ocio.cameras import AS_SHOT, Camera
from lutforge.ocio.names import UniqueNames, space_name
from lutforge.ocio.renderings import Rendering
from lutforge.ocio.spaces import BALANCE_VAR, SOURCE_NAME, TARGET_NAME, file_transform

REFINISH = "Camera refinish"


def add_looks(
    config: OCIO.Config, cameras: Sequence[Camera], renderings: Sequence[Rendering], looks: UniqueNames, as_shot: str
) -> None:
    """Add all looks of the cameras to a config.

    looks: the names that are taken; as_shot: the space of photographs by any camera.
    """
    for camera in cameras:
        _add_white_balances(config, camera, looks)
        for rendering in (rendering for rendering in renderings if rendering.camera is camera):
            _add_refinishes(config, rendering, looks)
        whole = {r.style for r in renderings if r.camera is camera and r.render is not None and r.linearize is not None}
        _add_styles(config, camera, [name for name in camera.profile.styles if name in whole], looks)
    config.addLook(
        OCIO.Look(
            name=looks(REFINISH),
            processSpace=as_shot,
            transform=OCIO.ColorSpaceTransform(src=SOURCE_NAME, dst=TARGET_NAME),
            inverseTransform=OCIO.ColorSpaceTransform(src=TARGET_NAME, dst=SOURCE_NAME),
            description="From the settings LUTFORGE_CAMERA, _STYLE and _WB to LUTFORGE_TO_CAMERA, _TO_STYLE and _TO_WB",
        )
    )


def _add_white_balances(config: OCIO.Config, camera: Camera, looks: UniqueNames) -> None:
    """Add looks from each white balance to each other, in RAW: exact, for any light, and the same for all styles."""
    for source, target in permutations(camera.profile.white_balances, 2):
        ratio = camera.gain(target) / camera.gain(source)
        config.addLook(
            OCIO.Look(
                name=looks(space_name(camera.name, camera.balances[source], "to", camera.balances[target])),
                processSpace=camera.raw(),
                transform=matrix_transform(np.diag(ratio)),
                description=f"White balance {target} instead of {source}",
            )
        )


def _add_refinishes(config: OCIO.Config, rendering: Rendering, looks: UniqueNames) -> None:
    """Add looks for photographs, from each white balance of a style to each other: as `apply` refinishes.

    Colour space conversions pass the light of the scene alone, which does not tell burnt-out white under one white
    balance from a coloured highlight under another; these know both.
    """
    camera, names = rendering.camera, rendering.camera.balances

    def refinish(source: str, target: str) -> OCIO.GroupTransform:
        files = rendering.calibrated_file, rendering.balance_file(source, target), rendering.render_file
        return OCIO.GroupTransform([file_transform(name) for name in files])

    for source, target, _ in rendering.refinishes():
        style = camera.styles[rendering.style]
        config.addLook(
            OCIO.Look(
                name=looks(space_name(camera.name, style, names[source], "to", names[target])),
                processSpace=camera.jpeg(rendering.style, source),
                transform=refinish(source, target),
                inverseTransform=refinish(target, source),
                description=f"A JPEG in picture style {rendering.style}, white balance {target} instead of {source}",
            )
        )


def _add_styles(config: OCIO.Config, camera: Camera, styles: Sequence[str], looks: UniqueNames) -> None:
    """Add looks from each style to each other, under the white balance that the context variable names."""

    def settings(style: str) -> str:
        return space_name(camera.name, camera.styles[style], f"${{{BALANCE_VAR}}}")

    for source, target in permutations(styles, 2):
        config.addLook(
            OCIO.Look(
                name=looks(space_name(camera.name, camera.styles[source], "to", camera.styles[target])),
                processSpace=space_name(camera.name, camera.styles[source], AS_SHOT),
                transform=OCIO.ColorSpaceTransform(src=settings(source), dst=settings(target)),
                inverseTransform=OCIO.ColorSpaceTransform(src=settings(target), dst=settings(source)),
                description=f"Taken in picture style {source}, as if in {target}; {BALANCE_VAR} is the white balance",
            )
        )
