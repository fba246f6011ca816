"""RGB spaces: encodings and matrices are colour-science's, over their range, below 0 and above 1 too."""

import colour
import numpy as np
import pytest

from lutforge.colour.rgb_spaces import SPACES, matrix_between, rgb_space
from lutforge.errors import SettingsError

LIGHT = np.concatenate([[-0.01, -0.002, 0.0], np.geomspace(1e-4, 8.0, 40)])
BY_THEMSELVES = ("Adobe RGB (1998)", "ROMM RGB")
"""Not computed by colour-science: its gamma gives nothing below 0, its ROMM RGB cuts at 0 and 1."""


@pytest.mark.parametrize("name", [name for name, space in SPACES.items() if not space.is_linear and name != "acescc"])
def test_encoding_and_decoding_are_inverse_and_rise(name: str) -> None:
    space = rgb_space(name)
    encoded = space.encode(LIGHT)
    assert np.all(np.diff(encoded) > 0)
    assert np.abs(space.decode(encoded) - LIGHT).max() < 1e-4


@pytest.mark.parametrize("name", [name for name, space in SPACES.items() if space.transfer])
def test_encodings_are_colour_sciences(name: str) -> None:
    space = rgb_space(name)
    light = LIGHT[LIGHT >= 0]
    light = light[light <= 1] if space.transfer in BY_THEMSELVES else light
    known = colour.RGB_COLOURSPACES[space.primaries].cctf_encoding
    with np.errstate(all="ignore"):
        wanted = (
            known(light) if space.transfer in BY_THEMSELVES else colour.cctf_encoding(light, function=space.transfer)
        )
    assert np.abs(space.encode(light) - wanted).max() < 1e-4


def test_matrices_take_white_to_white_and_back() -> None:
    for name in SPACES:
        there, back = matrix_between("linear-srgb", name), matrix_between(name, "linear-srgb")
        assert np.abs(there.sum(axis=1) - 1).max() < 3e-4  # published primaries have four decimals
        assert np.abs(there @ back - np.eye(3)).max() < 1e-3


def test_names_are_taken_in_any_case_and_unknown_ones_listed() -> None:
    assert rgb_space("ACEScct").name == "acescct"
    with pytest.raises(SettingsError, match="known: linear-srgb"):
        rgb_space("technicolor")
