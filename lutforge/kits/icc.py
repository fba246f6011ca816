"""ICC input profiles of a camera (.icc): white-balanced camera RGB → CIE Lab of D50, by curves and a cube.

They follow ICC.1:2001-04 (version 2.4, https://www.color.org/ICC_Minor_Revision_for_Web.pdf), which every RAW developer
reads: a profile of class `scnr`, whose table A2B0 is a `lut16Type` (6.5.8) with input curves of 4,096 entries, and a
cube of 16 bits that Little CMS interpolates by tetrahedra. The cube is fitted in Lab, where differences are about as
large as they look.
"""

import struct
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading, require_file
from lutforge.colour.icc_profile import icc_file, icc_xyz
from lutforge.colour.rgb_spaces import D50_XYZ, SRGB, to_xyz, to_xyz_d50
from lutforge.errors import LutError, one_line
from lutforge.images.icc import profile_name
from lutforge.kits.kit import BALANCED_RAW, Look
from lutforge.luts.fit_cube import Axes, fit_cube
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.writers.text import plain

CURVE_ENTRIES = 4096
"""Entries of an input curve: the most that a lut16Type has."""

NODES = 65
"""Nodes per axis: 99 % of the colours are then within 0.6 ΔE00 of the model, greys within 0.3. With 49 they are not."""

WIDEST_CELL = 1 / 40
"""Largest distance of two nodes, in roots of the input: colours near the greys need nodes everywhere."""

GAMMA = 2.4
"""The fit's points are evenly spaced in this root of the input, which is about perceptually uniform."""


class Variant(Enum):
    """The variants of a look in a camera profile; the value is the ending of the look's name."""

    JPEG = ""
    """The camera's JPEG."""
    COLOURS = " colours"
    """The look without its tone curve, scene-linear."""


_LAB_ZERO = np.array([0.0, 128.0, 128.0])
"""The offsets that are added to L*, a* and b* before they are encoded."""
_LAB_CODES = np.array([652.8, 256.0, 256.0])
"""16-bit codes per unit of L*, a* and b*."""
_ROOTS = np.linspace(0.0, 1.0, CURVE_ENTRIES) ** (1 / GAMMA)
"""The roots of the inputs of a curve's entries, (CURVE_ENTRIES,)."""
_XYZ_FROM_SRGB = to_xyz_d50("linear-srgb")


@dataclass(frozen=True, eq=False)
class IccProfile:
    """The contents of a camera's ICC profile: its name, a curve per channel, and a cube of Lab codes.

    These are the codes of version 2 as shares of 65535: L* · 652.8, a* and b* from −128 in steps of 1 / 256.
    description: one line per entry.
    """

    name: str
    curve: Curve
    cube: Cube
    description: tuple[str, ...] = ()

    def __call__(self, balanced: Array) -> Array:
        """Encoded sRGB (…, 3), clipped to [0, 1], that a developer renders from white-balanced camera RGB (…, 3)."""
        lightness, a, b = np.moveaxis(self.cube(self.curve(balanced)) * 65535 / _LAB_CODES - _LAB_ZERO, -1, 0)
        y = (lightness + 16) / 116
        root = np.stack([y + a / 500, y, y - b / 200], axis=-1)
        ratio = np.where(root > 6 / 29, root**3, (116 * root - 16) * 27 / 24389)
        linear = ratio @ np.linalg.inv(_XYZ_FROM_SRGB / np.array(D50_XYZ)[:, None]).T
        return SRGB.encode(np.clip(linear, 0.0, 1.0))


def fit_icc_profile(look: Look, variant: Variant = Variant.JPEG) -> IccProfile:
    """Express the look of a profile of RAW files as an ICC profile."""
    is_scene_linear = variant is Variant.COLOURS
    linear = scene_linear(look) if is_scene_linear else lambda x: SRGB.linearize(np.clip(look.render(x), 0.0, 1.0))

    def codes(root: Array) -> Array:
        # CIE 1976 L*a*b* (CIE 15:2018, 8.2.1)
        ratio = linear(root**GAMMA) @ (_XYZ_FROM_SRGB / np.array(D50_XYZ)[:, None]).T
        x, y, z = np.moveaxis(np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116), -1, 0)
        lab = np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)
        return np.asarray((lab + _LAB_ZERO) * _LAB_CODES / 65535)

    # All channels have the same axis, so that greys run from node to node and stay neutral.
    lab_of_greys = codes(np.repeat(_ROOTS[:, None], 3, axis=1)) * 65535 / _LAB_CODES
    level = polyline_levels(_ROOTS, lab_of_greys, NODES, WIDEST_CELL)
    even = np.linspace(0.0, 1.0, len(level))
    column = np.rint(np.interp(_ROOTS, level, even) * 65535) / 65535
    curve = Curve(np.repeat(column[:, None], 3, axis=1))
    axes = Axes((level, level, level), (even, even, even), lambda root: curve(root**GAMMA))
    values = fit_cube(codes, axes, "tetrahedral", np.ones(3))

    output = "CIE Lab (D50) of the camera's JPEG" + ", without its tone curve, scene-linear" * is_scene_linear
    lines = look.description(BALANCED_RAW, output)
    return IccProfile(f"{look.title}{variant.value}", curve, Cube(np.rint(values * 65535) / 65535), lines)


def polyline_levels(x: Array, y: Array, most: int, widest: float) -> Array:
    """Choose at most `most` of x (m,), with both ends, such that straight lines between them follow y (m, 3) closely.

    After each chosen x comes the last one, at most `widest` away, to which a line keeps within a tolerance; bisection
    finds the least tolerance for which `most` suffice. Functions with kinks need this: node levels by curvature (see
    `fit_axes`) miss them.
    """

    def distance(start: int, end: int) -> float:
        share = (x[start:end] - x[start]) / (x[end] - x[start])
        return float(np.abs(y[start:end] - y[start] - share[:, None] * (y[end] - y[start])).max())

    def chain(tolerance: float) -> list[int]:
        nodes = [0]
        while nodes[-1] < len(x) - 1 and len(nodes) <= most:
            start = nodes[-1]
            next_nodes = range(start + 1, max(int(np.searchsorted(x, x[start] + widest)), start + 2))
            nodes.append(start + max(bisect_right(next_nodes, tolerance, key=lambda end: distance(start, end)), 1))
        return nodes

    low = 0.0
    high = float(np.ptp(y))
    for _ in range(16):
        middle = 0.5 * (low + high)
        if len(chain(middle)) > most:
            low = middle
        else:
            high = middle
    return np.asarray(x[chain(high)])


def scene_linear(look: Look) -> Callable[[Array], Array]:
    """The look without its tone curve: balanced camera RGB (…, 3) → linear sRGB.

    A colour is scaled and so keeps the chromaticity that the look gives it. For each of its channels there is a grey
    that the look renders as large as that channel. The scale is the one that takes the brightest of these three greys
    from its rendered luminance back to its linear value.
    """
    grey = np.linspace(0.0, 1.0, 4 * CURVE_ENTRIES)[1:] ** GAMMA
    luminance = to_xyz("linear-srgb")[1]
    rendered = SRGB.linearize(np.clip(look.render(np.repeat(grey[:, None], 3, axis=1)), 0.0, 1.0))
    tones = np.maximum.accumulate(rendered)
    scales = grey / (rendered @ luminance)
    rising = np.diff(tones, axis=0, prepend=0.0) > 0.0  # of the inputs that clip, the least

    def linear(balanced: Array) -> Array:
        toned = SRGB.linearize(np.clip(look.render(balanced), 0.0, 1.0))
        greys = [np.interp(toned[..., c], tones[rising[:, c], c], grey[rising[:, c]]) for c in range(3)]
        untoned = toned * np.interp(np.max(greys, axis=0), grey, scales)[..., None]
        # A clipped JPEG channel no longer rises with the scene; there the RAW channel takes its place.
        return np.asarray(np.where(toned >= tones[-1], np.maximum(untoned, balanced), untoned))

    return linear


def write_icc(profile: IccProfile, path: Path) -> None:
    """Write an .icc file, atomically."""
    unit = (1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 16)
    table = b"mft2" + struct.pack(">4x3Bx9i2H", 3, 3, profile.cube.size, *unit, len(profile.curve.outputs), 2)
    for values in (profile.curve.outputs.T, profile.cube.values, np.tile([0.0, 1.0], (3, 1))):
        table += np.rint(values * 65535).astype(">u2").tobytes()
    text = "; ".join(plain(line) for line in profile.description)
    content = icc_file(b"scnr", b"Lab ", profile.name, text, {b"wtpt": icc_xyz(D50_XYZ), b"A2B0": table})
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def read_icc(path: str | Path) -> IccProfile:
    """Read a camera profile as LutForge writes it: lut16Type, RGB to Lab. Raises LutError, one line."""
    data, tags = _tags(Path(path))
    table = tags.get(b"A2B0", b"")
    with reading(path, "an ICC profile", LutError):
        kind, inputs, outputs, nodes, *_, entries, after = struct.unpack_from(">4s4x3Bx36x2H", table)
        if (kind, inputs, outputs, after) != (b"mft2", 3, 3, 2) or not (
            2 <= nodes <= 129 and 2 <= entries <= CURVE_ENTRIES
        ):
            kind_of_table = "table of 16 bits from RGB to Lab with straight output curves"
            raise LutError(f"{path}: no {kind_of_table}, as LutForge writes")
        numbers = np.frombuffer(table, ">u2", 3 * (entries + nodes**3), 52) / 65535
        curve_codes, cube_codes = np.split(numbers, [3 * entries])
        curve = Curve(curve_codes.reshape(3, entries).T)
        cube = Cube(cube_codes.reshape(nodes, nodes, nodes, 3))
        return IccProfile(profile_name(data), curve, cube, _copyright(tags))


def icc_lines(path: str | Path) -> list[str]:
    """The report on an ICC profile of any origin, as lines of text: what it holds, and how Little CMS renders by it.

    Raises LutError where the file is no ICC profile.
    """
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
        source = ImageCms.ImageCmsProfile(str(path))
        srgb = ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(picture, source, srgb, flags=ImageCms.Flags.NOOPTIMIZE)
    except (ImageCms.PyCMSError, OSError, ValueError) as error:
        return [*lines, f"  problem   Little CMS refuses it: {one_line(str(error), 160)}"]
    by_little_cms = np.asarray(converted, dtype=np.float64)[0]
    for name, colour in zip(("black", "grey 18 %", "white"), by_little_cms, strict=False):
        lines.append(f"  {name:10} {' '.join(f'{value / 255:.3f}' for value in colour)} (encoded sRGB)")
    try:
        deviation = float(np.abs(read_icc(path)(codes / 255) * 255 - by_little_cms).max())
        lines.append(f"  Little CMS: reads it, within {deviation:.1f} of 255 codes of what its numbers say")
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
    """The lines of the copyright tag of version 2; profiles of LutForge state input, output and settings there."""
    kind = tags.get(b"cprt", b"")[:4]
    data = tags.get(b"cprt", b"")[8:]
    text = data.split(b"\0")[0].decode("ascii", "replace") if kind == b"text" else ""
    return tuple(one_line(text, 1000).split("; "))


def _word(tag: bytes) -> str:
    """A four-character code as printable text."""
    return one_line(tag.decode("latin-1").strip(), 16)
