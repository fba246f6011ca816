"""ICC input profiles of a camera (.icc): white-balanced camera RGB → CIE Lab of D50, by curves and a cube.

ICC.1:2001-04 (version 2.4, https://www.color.org/ICC_Minor_Revision_for_Web.pdf), which every RAW developer reads: a
profile of class `scnr` whose table A2B0 is a `lut16Type` (6.5.8): input curves of 4,096 entries, and a cube that Little
CMS interpolates by tetrahedra, in 16 bits. Both are fitted for that in Lab, so that an error counts as it is seen.
"""

import struct
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading, require_file
from lutforge.colour.rgb_spaces import D50, icc_file, icc_xyz, rgb_space, to_xyz, to_xyz_d50
from lutforge.errors import LutError, one_line
from lutforge.images.icc import profile_name
from lutforge.kits.kit import BALANCED_RAW, Look
from lutforge.luts.fit_cube import Axes, fit_cube
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.writers.text import plain

ENTRIES = 4096
"""Entries of an input curve: the most that a lut16Type has."""

NODES = 65
"""Nodes per axis, with which 99 % of colours keep within 0.6 ΔE00 of the model, and greys within 0.3: 49 do not."""

WIDEST = 1 / 40
"""How far nodes lie apart at most, in roots of the input: colours beside the greys need them everywhere."""

GAMMA = 2.4
"""Points of the fit are even in this root of the input, about as the eye counts light."""

VARIANTS = ("", " colours")
"""What is behind a look's name: nothing for the camera's JPEG; the same without its tone curve, scene-linear."""

_ZERO, _STEPS = np.array([0.0, 128.0, 128.0]), np.array([652.8, 256.0, 256.0])
_ROOTS = np.linspace(0.0, 1.0, ENTRIES) ** (1 / GAMMA)
_SRGB = rgb_space("srgb")
_XYZ_FROM_SRGB = to_xyz_d50("linear-srgb")


@dataclass(frozen=True, eq=False)
class IccProfile:
    """What a profile of a camera holds: its name, a curve per channel, and a cube of Lab codes.

    These are the codes of version 2 as shares of 65535: L* · 652.8, a* and b* from −128 in steps of 1 / 256.
    description: what it states of itself, a line each.
    """

    name: str
    curve: Curve
    cube: Cube
    description: tuple[str, ...] = ()

    def __call__(self, balanced: Array) -> Array:
        """What a developer makes of white-balanced camera RGB (…, 3): encoded sRGB, clipped to [0, 1]."""
        lightness, a, b = np.moveaxis(self.cube(self.curve(balanced)) * 65535 / _STEPS - _ZERO, -1, 0)
        y = (lightness + 16) / 116
        root = np.stack([y + a / 500, y, y - b / 200], axis=-1)
        ratio = np.where(root > 6 / 29, root**3, (116 * root - 16) * 27 / 24389)
        light = ratio @ np.linalg.inv(_XYZ_FROM_SRGB / np.array(D50)[:, None]).T
        return _SRGB.encode(np.clip(light, 0.0, 1.0))


def fit_icc_profile(look: Look, variant: str = "") -> IccProfile:
    """Express the look of a profile of RAW files as an ICC profile. variant: of VARIANTS."""
    shown = scene_linear(look) if variant else lambda x: _SRGB.linearize(np.clip(look.render(x), 0.0, 1.0))

    def codes(root: Array) -> Array:
        ratio = shown(root**GAMMA) @ (_XYZ_FROM_SRGB / np.array(D50)[:, None]).T
        x, y, z = np.moveaxis(np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116), -1, 0)
        lab = np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)
        return np.asarray((lab + _ZERO) * _STEPS / 65535)

    # All channels share their axis, so that greys run from node to node and stay neutral.
    level = polyline_levels(_ROOTS, codes(np.repeat(_ROOTS[:, None], 3, axis=1)) * 65535 / _STEPS, NODES, WIDEST)
    even = np.linspace(0.0, 1.0, len(level))
    column = np.rint(np.interp(_ROOTS, level, even) * 65535) / 65535
    curve = Curve(np.repeat(column[:, None], 3, axis=1))
    axes = Axes((level, level, level), (even, even, even), lambda root: curve(root**GAMMA))
    values = fit_cube(codes, axes, "tetrahedral", np.ones(3))
    gives = "CIE Lab (D50) of the camera's JPEG" + ", without its tone curve, scene-linear" * bool(variant)
    stated = look.description(BALANCED_RAW, gives)
    return IccProfile(f"{look.title}{variant}", curve, Cube(np.rint(values * 65535) / 65535), stated)


def polyline_levels(x: Array, y: Array, most: int, widest: float) -> Array:
    """Choose at most `most` of x (m,), both ends among them; straight lines between them follow y (m, 3) closely.

    Each is followed by the last x, no farther than `widest`, to which a line keeps within a tolerance; bisection finds
    the least tolerance for which they suffice. Functions with kinks need this: levels of even mass pass them by.
    """

    def distance(start: int, end: int) -> float:
        share = (x[start:end] - x[start]) / (x[end] - x[start])
        return float(np.abs(y[start:end] - y[start] - share[:, None] * (y[end] - y[start])).max())

    def chain(tolerance: float) -> list[int]:
        nodes = [0]
        while nodes[-1] < len(x) - 1 and len(nodes) <= most:
            start = nodes[-1]
            ends = range(start + 1, max(int(np.searchsorted(x, x[start] + widest)), start + 2))
            nodes.append(start + max(bisect_right(ends, tolerance, key=lambda end: distance(start, end)), 1))
        return nodes

    low, high = 0.0, float(np.ptp(y))
    for _ in range(16):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if len(chain(middle)) > most else (low, middle)
    return np.asarray(x[chain(high)])


def scene_linear(look: Look) -> Callable[[Array], Array]:
    """The look without its tone curve: balanced camera RGB (…, 3) → linear sRGB.

    Each colour keeps the chromaticity that the look gives it. Its gain is that of the brightest of three greys, of each
    of which the look makes one channel as large as the colour's: it takes that grey's luminance back to its light.
    """
    grey, luminance = np.linspace(0.0, 1.0, 4 * ENTRIES)[1:] ** GAMMA, to_xyz("linear-srgb")[1]
    shown = _SRGB.linearize(np.clip(look.render(np.repeat(grey[:, None], 3, axis=1)), 0.0, 1.0))
    tones, gains = np.maximum.accumulate(shown), grey / (shown @ luminance)
    rising = np.diff(tones, axis=0, prepend=0.0) > 0.0  # of the inputs that clip, the least

    def light(balanced: Array) -> Array:
        toned = _SRGB.linearize(np.clip(look.render(balanced), 0.0, 1.0))
        levels = [np.interp(toned[..., c], tones[rising[:, c], c], grey[rising[:, c]]) for c in range(3)]
        inverse = toned * np.interp(np.max(levels, axis=0), grey, gains)[..., None]
        # A clipped JPEG channel no longer rises with the light; there the RAW channel takes its place.
        return np.asarray(np.where(toned >= tones[-1], np.maximum(inverse, balanced), inverse))

    return light


def write_icc(profile: IccProfile, path: Path) -> None:
    """Write an .icc file, atomically."""
    unit = (1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 16)
    table = b"mft2" + struct.pack(">4x3Bx9i2H", 3, 3, profile.cube.size, *unit, len(profile.curve.outputs), 2)
    for values in (profile.curve.outputs.T, profile.cube.values, np.tile([0.0, 1.0], (3, 1))):
        table += np.rint(values * 65535).astype(">u2").tobytes()
    stated = "; ".join(plain(line) for line in profile.description)
    content = icc_file(b"scnr", b"Lab ", profile.name, stated, {b"wtpt": icc_xyz(D50), b"A2B0": table})
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def read_icc(path: str | Path) -> IccProfile:
    """Read a camera profile as LutForge writes it: lut16Type, RGB to Lab. Raises LutError, one line."""
    data, tags = _tags(Path(path))
    table = tags.get(b"A2B0", b"")
    with reading(path, "an ICC profile", LutError):
        kind, inputs, outputs, nodes, *_, entries, after = struct.unpack_from(">4s4x3Bx36x2H", table)
        if (kind, inputs, outputs, after) != (b"mft2", 3, 3, 2) or not (2 <= nodes <= 129 and 2 <= entries <= ENTRIES):
            wanted = "no table of 16 bits from RGB to Lab with straight output curves"
            raise LutError(f"{path}: {wanted}, as LutForge writes")
        numbers = np.frombuffer(table, ">u2", 3 * (entries + nodes**3), 52) / 65535
        curve, cube = np.split(numbers, [3 * entries])
        curves, nodes_of_cube = curve.reshape(3, entries).T, cube.reshape(nodes, nodes, nodes, 3)
        return IccProfile(profile_name(data), Curve(curves), Cube(nodes_of_cube), _copyright(tags))


def icc_lines(path: str | Path) -> list[str]:
    """What is in an ICC profile, anyone's, and what Little CMS makes of it. Raises LutError where it is none."""
    from PIL import Image, ImageCms  # imported here: kits are written without it

    data, tags = _tags(Path(path))
    names = {b"scnr": "input", b"mntr": "display", b"prtr": "output", b"spac": "colour space", b"link": "device link"}
    kind, space, pcs = (data[at : at + 4] for at in (12, 16, 20))
    lines = [
        f"{path}: ICC profile",
        f"  title     {profile_name(data)}",
        *(f"  comment   {text}" for text in _copyright(tags) if text),
        f"  1. version {data[8]}.{data[9] >> 4}, class {names.get(kind, 'other')}, {_word(space)} to {_word(pcs)}",
        f"  2. tags {', '.join(_word(tag) for tag in tags)}",
    ]
    if space != b"RGB ":
        return [*lines, "  problem   it takes no RGB: RAW developers cannot use it"]
    codes = np.array([[0, 0, 0], [46, 46, 46], [255, 255, 255], *np.random.default_rng(0).integers(0, 256, (4093, 3))])
    picture = Image.fromarray(codes.astype(np.uint8)[None])
    try:
        source, srgb = ImageCms.ImageCmsProfile(str(path)), ImageCms.createProfile("sRGB")
        made = ImageCms.profileToProfile(picture, source, srgb, flags=ImageCms.Flags.NOOPTIMIZE)
    except (ImageCms.PyCMSError, OSError, ValueError) as error:
        return [*lines, f"  problem   Little CMS refuses it: {one_line(str(error), 160)}"]
    shown = np.asarray(made, dtype=np.float64)[0]
    for name, colour in zip(("black", "grey 18 %", "white"), shown, strict=False):
        lines.append(f"  {name:10} {' '.join(f'{value / 255:.3f}' for value in colour)} (encoded sRGB)")
    try:
        apart = float(np.abs(read_icc(path)(codes / 255) * 255 - shown).max())
        lines.append(f"  Little CMS: reads it, within {apart:.1f} of 255 codes of what its numbers say")
    except LutError:
        lines.append("  Little CMS: reads it")
    if kind == b"scnr":
        lines.append("  darktable, RawTherapee, ART, Capture One, digiKam: take it as a camera's input profile")
    return lines


def _tags(path: Path) -> tuple[bytes, dict[bytes, bytes]]:
    """The bytes of a file, and those of each tag. Raises LutError."""
    require_file(path, "an ICC profile", LutError, 64 << 20)
    data = path.read_bytes()
    if len(data) < 132 or data[36:40] != b"acsp":
        raise LutError(f"{path}: no ICC profile: its header does not say acsp")
    with reading(path, "an ICC profile", LutError):
        (count,) = struct.unpack_from(">I", data, 128)
        if count > 200:
            raise LutError(f"{path}: an ICC profile of {count:,} tags")
        places = [struct.unpack_from(">4s2I", data, 132 + 12 * index) for index in range(count)]
        return data, {tag: data[start : start + length] for tag, start, length in places}


def _copyright(tags: dict[bytes, bytes]) -> tuple[str, ...]:
    """What the copyright tag of version 2 holds, in which our profiles state input, output, settings and licence."""
    kind, text = tags.get(b"cprt", b"")[:4], tags.get(b"cprt", b"")[8:]
    stated = text.split(b"\0")[0].decode("ascii", "replace") if kind == b"text" else ""
    return tuple(one_line(stated, 1000).split("; "))


def _word(tag: bytes) -> str:
    return one_line(tag.decode("latin-1").strip(), 16)
