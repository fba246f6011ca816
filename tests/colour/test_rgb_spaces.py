"""RGB spaces: encodings are colour-science's, below 0 and above 1 too; matrices OpenColorIO's, too."""

import colour
import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.colour.chromaticities import CHROMATICITIES
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


@pytest.mark.parametrize("name", SPACES)
def test_every_space_has_a_linear_one_of_the_same_primaries(name: str) -> None:
    linear = rgb_space(name).linear
    assert linear.is_linear and linear.primaries == rgb_space(name).primaries


def test_matrices_take_white_to_white_and_back() -> None:
    for name in SPACES:
        there, back = matrix_between("linear-srgb", name), matrix_between(name, "linear-srgb")
        assert np.abs(there.sum(axis=1) - 1).max() < 1e-12
        assert np.abs(there @ back - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize("name", [name for name, space in SPACES.items() if space.is_linear])
def test_matrices_are_those_of_colour_sciences_chromaticities(name: str) -> None:
    first, second = (colour.RGB_COLOURSPACES[rgb_space(each).primaries].copy() for each in ("linear-srgb", name))
    known = CHROMATICITIES[second.name]
    assert np.array_equal(known, [*second.primaries, second.whitepoint])
    for space in (first, second):
        space.use_derived_transformation_matrices(True)
    wanted = colour.matrix_RGB_to_RGB(first, second, chromatic_adaptation_transform="Bradford")
    assert np.abs(matrix_between("linear-srgb", name) - wanted).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "theirs"), [("aces2065-1", "ACES2065-1"), ("acescg", "ACEScg"), ("linear-rec2020", "Linear Rec.2020")]
)
def test_matrices_are_opencolorios(name: str, theirs: str) -> None:
    config = OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1")
    columns = np.eye(3, dtype=np.float32)
    config.getProcessor("Linear Rec.709 (sRGB)", theirs).getDefaultCPUProcessor().applyRGB(columns)
    assert np.abs(matrix_between("linear-srgb", name) - columns.T).max() < 1e-6


def test_names_are_taken_in_any_case_and_unknown_ones_listed() -> None:
    assert rgb_space("ACEScct").name == "acescct"
    with pytest.raises(SettingsError, match="known: linear-srgb"):
        rgb_space("technicolor")
    with pytest.raises(SettingsError, match="known: acescg, aces2065-1"):  # those that hold the word come first
        rgb_space("ACES")
