"""Plain models of the response f, to stand beside EMoR: sRGB's curve and a gamma."""

import numpy as np

from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError
from lutforge.model.response import Response

CODES = np.linspace(0.0, 1.0, 1024)


def srgb_response() -> Response:
    """The sRGB curve (IEC 61966-2-1) in all channels."""
    return Response(np.stack([srgb_decode(CODES)] * 3, axis=1))


def gamma_response(gamma: float = 2.2) -> Response:
    """f⁻¹(I) = I^gamma in all channels. Raises CalibrationError unless 0.2 ≤ gamma ≤ 5."""
    if not 0.2 <= gamma <= 5.0:
        raise CalibrationError(f"gamma {gamma:g} is not within 0.2 … 5")
    return Response(np.stack([CODES**gamma] * 3, axis=1))
