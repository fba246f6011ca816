"""The profile of a camera of which only the response is known: the linear values of its JPEGs replace RAW."""

import numpy as np

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.provenance import ResponseOnly
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance


def profile_of_response(
    response: Response, camera: str, style: str, white_balance: str, shots: tuple[str, ...] = ()
) -> CameraProfile:
    """A profile with f alone: no matrix, no gamut map; linear values have the primaries of the JPEG."""
    model = CameraModel.without_gamut_map((white_balance,), np.eye(3), response)
    return CameraProfile(
        camera=camera,
        matrix=np.eye(3),
        white_balances={white_balance: WhiteBalance((1.0, 1.0, 1.0))},
        styles={style: PictureStyle(models=(model,))},
        shots=shots,
        provenance=ResponseOnly(),
        notes=("only the response is known: linear light is that of the JPEG, in its own primaries and white balance",),
    )
