"""Plain models of the response f, to stand beside EMoR: sRGB's curve and a gamma."""

import numpy as np

from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError
from lutforge.model.response import Response


def srgb_response(entries: int = 1024) -> Response:
    """The sRGB curve (IEC 61966-2-1) in all channels."""
    v = np.linspace(0.0, 1.0, entries)
    linear = srgb_decode(v)
    return Response(np.stack([linear] * 3, axis=1))


def gamma_response(gamma: float = 2.2, entries: int = 1024) -> Response:
    """f⁻¹(I) = I^gamma in all channels. Raises CalibrationError unless 0.2 ≤ gamma ≤ 5."""
    if not 0.2 <= gamma <= 5.0:
        raise CalibrationError(f"gamma {gamma:g} is not within 0.2 … 5")
    return Response(np.stack([np.linspace(0.0, 1.0, entries) ** gamma] * 3, axis=1))
