"""The looks of a config: a camera's pictures under another white balance, or in another style."""

from collections.abc import Iterator, Sequence

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.luts.ocio_transforms import matrix_transform
from lutforge.ocio.camera_spaces import file_transform
from lutforge.ocio.cameras import JPEG, Camera, UniqueNames, space_name
from lutforge.ocio.renderings import Rendering


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
