"""Transfer functions of encoded RGB spaces, by name: linear light → code value, and back.

The log curves of cameras and of ACES come from colour-science, which follows the publications of their makers. Linear
values are relative to diffuse white. All curves continue below 0, so that noise around black keeps its mean.
"""

from collections.abc import Callable
from math import exp, log

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_decode, srgb_encode

TransferFunction = tuple[Callable[[Array], Array], Callable[[Array], Array]]
"""A function of arrays (…,), linear → encoded, and its inverse."""


def _mirrored(encode: Callable[[Array], Array], decode: Callable[[Array], Array]) -> TransferFunction:
    """A curve from 0 that continues below 0 by point symmetry."""
    return (
        lambda x: np.sign(x) * encode(np.abs(x)),
        lambda y: np.sign(y) * decode(np.abs(y)),
    )


def _of_colour_science(name: str) -> TransferFunction:
    """The curve that colour-science has under a name."""

    def curve(encodes: bool) -> Callable[[Array], Array]:
        def evaluate(values: Array) -> Array:
            import colour  # imported here: it takes most of a second, and most commands never need it

            function = colour.cctf_encoding if encodes else colour.cctf_decoding
            with np.errstate(all="ignore"):  # it evaluates each piece of a curve everywhere, and then chooses
                return np.asarray(function(values, function=name))

        return evaluate

    return curve(encodes=True), curve(encodes=False)


_ROMM_TOE = 16.0 ** (1.8 / (1.0 - 1.8))
"""Linear value up to which ROMM RGB is a straight line (ANSI/I3A IT10.7666, ISO 22028-2)."""


def _hlg() -> TransferFunction:
    """HLG as cameras encode the scene (ITU-R BT.2100-2, table 5); diffuse white is 75 % (BT.2408-7, table 1)."""
    a = 0.17883277
    b, c = 1 - 4 * a, 0.5 - a * log(4 * a)
    white = (exp((0.75 - c) / a) + b) / 12

    def encode(x: Array) -> Array:
        light = x * white
        return np.where(light <= 1 / 12, np.sqrt(3 * light), a * np.log(np.maximum(12 * light, 1.0) - b) + c)

    def decode(y: Array) -> Array:
        return np.where(y <= 0.5, y**2 / 3, (np.exp((y - c) / a) + b) / 12) / white

    return _mirrored(encode, decode)


def _pq() -> TransferFunction:
    """PQ (ITU-R BT.2100-2, table 4; SMPTE ST 2084) with diffuse white at 203 cd/m² (BT.2408-7, table 1)."""
    m1, m2, c1, c2, c3 = 2610 / 16384, 2523 / 32, 3424 / 4096, 2413 / 128, 2392 / 128
    white = 203 / 10000

    def encode(x: Array) -> Array:
        power = (x * white) ** m1
        return np.asarray(((c1 + c2 * power) / (1 + c3 * power)) ** m2 - c1**m2)

    def decode(y: Array) -> Array:
        root = (y + c1**m2) ** (1 / m2)
        return np.asarray((np.maximum(root - c1, 0.0) / (c2 - c3 * root)) ** (1 / m1) / white)

    return _mirrored(encode, decode)


TRANSFER_FUNCTIONS: dict[str, TransferFunction] = {
    "": (lambda x: x, lambda y: y),
    "sRGB": _mirrored(srgb_encode, srgb_decode),
    # Adobe RGB (1998) Color Image Encoding, section 4.3.4.2
    "Adobe RGB (1998)": _mirrored(lambda x: x ** (256.0 / 563.0), lambda y: y ** (563.0 / 256.0)),
    "ROMM RGB": _mirrored(
        lambda x: np.where(x < _ROMM_TOE, 16.0 * x, x ** (1 / 1.8)),
        lambda y: np.where(y < 16.0 * _ROMM_TOE, y / 16.0, y**1.8),
    ),
    "PQ": _pq(),
    "HLG": _hlg(),
    **{
        name: _of_colour_science(name)
        for name in (
            *(
                "ACEScc",
                "ACEScct",
                "ARRI LogC3",
                "ARRI LogC4",
                "S-Log2",
                "S-Log3",
                "V-Log",
                "Canon Log 2",
                "Canon Log 3",
            ),
            *("F-Log", "F-Log2", "N-Log", "L-Log", "D-Log", "DaVinci Intermediate", "Blackmagic Film Generation 5"),
            *("Log3G10", "Apple Log Profile"),
        )
    },
}
"""The transfer functions, by the names that colour-science has or would have."""
