"""File rules: a file whose path names a camera and its settings is in that colour space.

"…/Nikon D40/standard/tungsten/DSC_1.JPG", "nikon_d40_standard_tungsten_0007.jpg" and "Nikon-D40 standard tungsten.tif"
all name one. Only whole words count, the longest name first, and only kinds of files that can be it: an EXR is never a
JPEG rendering, a JPEG never RAW.
"""

import re
from collections.abc import Iterable

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.ocio.cameras import Camera
from lutforge.ocio.renderings import Rendering

RENDERED = "jpe?g|JPE?G|png|PNG|tiff?|TIFF?"
LINEAR = "exr|EXR|tiff?|TIFF?"


def camera_rules(cameras: Iterable[Camera], renderings: Iterable[Rendering]) -> list[tuple[str, str, str]]:
    """(rule name, colour space, regular expression) in the order in which they are to be tried."""
    rules = [(camera.raw(balance), LINEAR) for camera in cameras for balance in (None, *camera.profile.white_balances)]
    for rendering in renderings:
        rules += [(rendering.camera.jpeg(rendering.style, balance), RENDERED) for balance in rendering.white_balances]
    rules.sort(key=lambda rule: (-len(rule[0]), rule[0]))
    return [(name, name, path_pattern(name, kinds)) for name, kinds in rules]


def path_pattern(name: str, kinds: str) -> str:
    """An ECMAScript regular expression for paths that hold the words of a name in their order, then end in `kinds`.

    A capital of the name may be small. They are short, since OpenColorIO compiles all of them when it loads a config.
    """
    words = r"[ _./\\-]+".join(_letters(word) for word in re.split(r"[ _.()-]+", name) if word)
    return rf"^(.*[^A-Za-z0-9])?{words}([^A-Za-z0-9].*)?[.]({kinds})$"


def _letters(word: str) -> str:
    return "".join(f"[{sign.lower()}{sign}]" if "A" <= sign <= "Z" else sign for sign in word)


def put_first(rules: OCIO.FileRules, added: Iterable[tuple[str, str, str]]) -> None:
    """Insert rules before all others."""
    for index, (name, space, pattern) in enumerate(added):
        rules.insertRule(index, name, space, pattern)
