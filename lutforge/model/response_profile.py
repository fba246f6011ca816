"""The profile of a camera of which only the response is known: its JPEGs' own light stands in the place of RAW."""

import numpy as np

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance

SOURCE = "exposure bracket"
"""What the options of such a profile name as its source."""


def profile_of_response(
    response: Response, camera: str, style: str, white_balance: str, shots: tuple[str, ...] = ()
) -> CameraProfile:
    """A profile with f alone: no matrix, no gamut map; linear light has the primaries of the JPEG."""
    nothing = identity_gamut_map()
    model = PhysicalModel((white_balance,), np.eye(3), response, nothing, nothing)
    return CameraProfile(
        camera=camera,
        matrix=np.eye(3),
        white_balances={white_balance: WhiteBalance((1.0, 1.0, 1.0))},
        styles={style: PictureStyle(physical=(model,))},
        shots=shots,
        options={"source": SOURCE, "model": "rbf"},
        notes=("only the response is known: linear light is that of the JPEG, in its own primaries and white balance",),
    )


def has_own_raw(profile: CameraProfile) -> bool:
    """True where the profile is of the camera's own RAW, not of a response alone or through a reference camera."""
    return not (is_response_alone(profile) or profile.raw_camera)


def is_response_alone(profile: CameraProfile) -> bool:
    """True for a profile that `profile_of_response` made."""
    return profile.options.get("source") == SOURCE
