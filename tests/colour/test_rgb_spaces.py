"""RGB spaces: curves are colour-science's, below 0 and above 1 too; curves and matrices OpenColorIO's, too."""

import colour
import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import CHROMATICITIES, SPACES, matrix_between, rgb_space
from lutforge.errors import SettingsError

LIGHT = np.concatenate([[-0.01, -0.002, 0.0], np.geomspace(1e-4, 8.0, 40)])


@pytest.mark.parametrize("name", [name for name, space in SPACES.items() if not space.is_linear and name != "acescc"])
def test_encoding_and_decoding_are_inverse_and_rise(name: str) -> None:
    space = rgb_space(name)
    encoded = space.encode(LIGHT)
    assert np.all(np.diff(encoded) > 0)
    assert np.abs(space.linearize(encoded) - LIGHT).max() < 1e-4


def test_the_curve_of_srgb_is_colour_sciences() -> None:
    space, light = rgb_space("srgb"), LIGHT[LIGHT >= 0]
    encoded = colour.cctf_encoding(light, function="sRGB")
    assert np.abs(space.encode(light) - encoded).max() < 1e-12
    assert np.abs(space.linearize(encoded) - light).max() < 1e-12


def test_curves_of_rec2100_and_their_diffuse_white() -> None:
    """BT.2408-7, table 1: diffuse white is 58 % in PQ and 75 % in HLG. OpenColorIO's curves have other scales."""
    codes = np.linspace(0.02, 0.95, 50)
    for name, style, white in (
        ("rec2100-pq", "CURVE - ST-2084_to_LINEAR", 0.58),
        ("rec2100-hlg", "CURVE - HLG-OETF-INVERSE", 0.75),
    ):
        light = rgb_space(name).linearize(codes)
        known = opencolorios(style, codes[:, None].repeat(3, 1))[:, 0] / light
        assert np.abs(known / known[0] - 1).max() < 1e-4
        assert rgb_space(name).encode(1.0) == pytest.approx(white, abs=0.0025)


@pytest.mark.parametrize(
    ("name", "style"),
    [
        ("apple-log-2", "APPLE_LOG-APPLEWG_to_ACES2065-1"), ("applelog", "APPLE_LOG_to_ACES2065-1"),
        ("vlog", "PANASONIC_VLOG-VGAMUT_to_ACES2065-1"), ("redlog3g10", "RED_LOG3G10-RWG_to_ACES2065-1"),
        ("acescct", "ACEScct_to_ACES2065-1"),
    ],
)  # fmt: skip
def test_spaces_are_opencolorios(name: str, style: str) -> None:
    """Its other built-in spaces of cameras adapt to another white by CAT02, so their matrices differ by 0.5 %."""
    codes = np.random.default_rng(0).uniform(0.1, 0.9, (2000, 3))
    light = rgb_space(name).linearize(codes) @ matrix_between(rgb_space(name).linear.name, "aces2065-1").T
    assert np.abs(opencolorios(style, codes) - light).max() < 1e-5 * np.abs(light).max()


def opencolorios(style: str, values: Array) -> Array:
    """What a built-in transform of OpenColorIO makes of values (n, 3)."""
    processor = OCIO.Config.CreateRaw().getProcessor(OCIO.BuiltinTransform(style))
    pixels = np.ascontiguousarray(values, dtype=np.float32)
    processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_NONE).applyRGB(pixels)
    return pixels.astype(np.float64)


def test_matrices_take_white_to_white_and_back() -> None:
    for name in SPACES:
        there, back = matrix_between("linear-srgb", name), matrix_between(name, "linear-srgb")
        assert np.abs(there.sum(axis=1) - 1).max() < 1e-12
        assert np.abs(there @ back - np.eye(3)).max() < 1e-12


SPELT = {
    "linear-p3": "P3-D65", "linear-rec2020": "ITU-R BT.2020", "linear-awg3": "ARRI Wide Gamut 3",
    "linear-awg4": "ARRI Wide Gamut 4",
}  # fmt: skip


def letters(name: str) -> str:
    """A name without what LutForge and colour-science spell in different ways."""
    return "".join(sign for sign in SPELT.get(name, name).removeprefix("linear-").lower() if sign.isalnum())


# It has no F-Gamut C and no Apple Wide Gamut.
@pytest.mark.parametrize("name", sorted(set(CHROMATICITIES) - {"linear-fgamut-c", "linear-apple-wide-gamut"}))
def test_matrices_are_those_of_colour_sciences_chromaticities(name: str) -> None:
    theirs = min((each for each in colour.RGB_COLOURSPACES if letters(name) in letters(each)), key=len)
    first, second = (colour.RGB_COLOURSPACES[each].copy() for each in ("sRGB", theirs))
    assert np.array_equal(CHROMATICITIES[name], [*second.primaries, second.whitepoint])
    for space in (first, second):
        space.use_derived_transformation_matrices(True)
    expected = colour.matrix_RGB_to_RGB(first, second, chromatic_adaptation_transform="Bradford")
    assert np.abs(matrix_between("linear-srgb", name) - expected).max() < 1e-12


def test_names_are_taken_in_any_case_and_unknown_ones_listed() -> None:
    assert rgb_space("ACEScct").name == "acescct"
    with pytest.raises(SettingsError, match="known: linear-srgb"):
        rgb_space("technicolor")
    with pytest.raises(SettingsError, match="known: acescg, aces2065-1"):  # those that hold the word come first
        rgb_space("ACES")
    with pytest.raises(SettingsError, match=r"did you mean acescg or acescc\?.*, linear-dgamut, .* and \d+ others$"):
        rgb_space("acesg")
