"""The transforms of a profile: chains against the formulas they stand for, round trips, refinishing and matching."""

from itertools import permutations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lutforge.colour.srgb import checked_colours
from lutforge.errors import ImageError, ProfileError, SettingsError
from lutforge.model.camera_profile import CameraProfile, ModelName, match
from lutforge.model.lattice import Lattice
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.provenance import OwnRaw, ReferenceRaw
from lutforge.model.transform import Encode
from lutforge.model.white_balance import WhiteBalance
from tests.cases.profiles import GAMMA, MATRIX, gamma_response, identity_map, small_profile


def _physical_profile(
    camera: str,
    matrix: np.ndarray,
    daylight: tuple[float, float, float] = (1.0, 1.0, 1.0),
    tungsten: tuple[float, float, float] = (1.3, 1.0, 2.6),
    raw_transfer: np.ndarray | None = None,
) -> CameraProfile:
    physical = CameraModel(("daylight",), matrix, gamma_response(), identity_map(), identity_map())
    balances = {"daylight": WhiteBalance(daylight, 5200.0), "tungsten": WhiteBalance(tungsten, 3200.0)}
    provenance = OwnRaw() if raw_transfer is None else ReferenceRaw("Reference", raw_transfer)
    return CameraProfile(
        camera, matrix, balances, {"standard": PictureStyle(models=(physical,))}, provenance=provenance
    )


PROFILE = _physical_profile("One", MATRIX, (2.0, 1.0, 1.5))
RAW = (
    np.random.default_rng(2).uniform(0.1, 0.3, size=(200, 1))
    * np.array([0.5, 1.0, 0.7])
    * (1 + 0.1 * np.random.default_rng(3).uniform(size=(200, 3)))
)
NARROW = np.diag([0.8, 1.0, 0.9])
TRANSFER = np.array([[0.9, 0.1, 0.0], [0.05, 0.9, 0.05], [0.0, 0.1, 0.9]])


def test_render_is_the_thesis_equation_and_linearize_undoes_it() -> None:
    encoded, linear = PROFILE.render("standard/daylight")(RAW), (RAW * [2.0, 1.0, 1.5]) @ MATRIX.T
    np.testing.assert_allclose(encoded, np.clip(linear, 0.0, 1.0) ** (1 / GAMMA), atol=1e-4)
    np.testing.assert_allclose(PROFILE.linearize("standard/daylight")(encoded), RAW, atol=1e-6)
    np.testing.assert_allclose(PROFILE.linearize("standard/daylight", "linear-srgb")(encoded), linear, atol=1e-6)


def test_white_stays_white_in_aces() -> None:
    white = PROFILE.render("standard/daylight")(0.4 / np.array([2.0, 1.0, 1.5]))
    for space in ("acescg", "aces2065-1", "linear-srgb"):
        linear = PROFILE.linearize("standard/daylight", space)(white)
        np.testing.assert_allclose(linear, 0.4, rtol=2e-3)


def test_refinish_changes_white_balance_and_exposure() -> None:
    before = PROFILE.render("standard/tungsten")(RAW)
    after = PROFILE.refinish("standard/tungsten", "standard/daylight", ev=-0.5)(before)
    np.testing.assert_allclose(after, PROFILE.render("standard/daylight")(RAW * 2**-0.5), atol=1e-6)


@pytest.mark.parametrize("model", ["lattice", "camera model"])
def test_the_same_settings_change_nothing(model: ModelName) -> None:
    profile = small_profile()
    x = np.random.default_rng(0).random((100, 3))
    r, g, b = profile.multipliers("standard/daylight")
    for words in ("standard/daylight", f"standard/{float(r)!r},{float(g)!r},{float(b)!r}"):
        same = profile.refinish("standard/daylight", words, model=model)
        assert same.is_identity
        np.testing.assert_array_equal(same(x), x)
    assert not profile.refinish("standard/daylight", "standard/daylight", ev=0.1, model=model).is_identity
    assert not profile.refinish("standard/daylight", "standard/tungsten", model=model).is_identity


def test_match_goes_through_the_scene() -> None:
    other = _physical_profile("Two", np.roll(MATRIX, (1, 1), (0, 1)), (1.7, 1.0, 1.9))
    scene = (RAW * [2.0, 1.0, 1.5]) @ MATRIX.T  # linear sRGB under daylight
    raw_of_other = (scene @ np.linalg.inv(other.matrix).T) / [1.7, 1.0, 1.9]
    expected = other.render("standard/daylight")(raw_of_other)
    got = match(PROFILE, "standard/daylight", other, "standard/daylight")(PROFILE.render("standard/daylight")(RAW))
    np.testing.assert_allclose(got, expected, atol=1e-6)


def test_a_style_answers_with_the_model_asked_for() -> None:
    profile = small_profile()
    assert isinstance(profile.render("standard/daylight").stages[-1], Lattice)
    assert isinstance(profile.render("standard/daylight", model="model").stages[-1], Encode)
    with pytest.raises(ProfileError, match="no camera model"):
        profile.render("vivid/daylight", model="model")


def test_unknown_settings_list_the_known_ones() -> None:
    profile = small_profile()
    with pytest.raises(SettingsError, match="standard, vivid"):
        profile.render("portrait/daylight")
    with pytest.raises(SettingsError, match="auto, daylight, tungsten"):
        profile.render("standard/shade")
    with pytest.raises(SettingsError, match="±20"):
        profile.refinish("standard/daylight", "standard/daylight", ev=21.0)


def test_a_profile_through_a_reference_camera_refinishes_but_has_no_raw() -> None:
    profile = _physical_profile("No RAW", MATRIX, tungsten=(0.7, 1.0, 1.4), raw_transfer=TRANSFER)
    near_grey = RAW * [2.0, 1.0, 1.5]
    before = profile.render("standard/tungsten")(near_grey)
    expected = np.clip((near_grey @ TRANSFER.T) * [0.7, 1, 1.4] @ MATRIX.T, 0, 1) ** (1 / GAMMA)
    np.testing.assert_allclose(before, expected, atol=1e-4)
    after = profile.refinish("standard/tungsten", "standard/daylight")(before)
    np.testing.assert_allclose(after, profile.render("standard/daylight")(near_grey), atol=1e-6)
    with pytest.raises(ProfileError, match=r"No RAW has no RAW.*Reference"):
        profile.linearize("standard/daylight")
    between = profile.multipliers("standard/4000K")  # between the settings that it knows
    assert 0.7 < between[0] < 1.0 and 1.0 < between[2] < 1.4
    scene = profile.linearize("standard/daylight", "linear-srgb")(profile.render("standard/daylight")(near_grey))
    np.testing.assert_allclose(scene, near_grey @ (MATRIX @ TRANSFER).T, atol=1e-6)


def test_a_match_through_a_common_reference_joins_both_transfers() -> None:
    """Tc from one camera without RAW to another is that of both to their reference, whose own is none (thesis 6.3)."""
    first, second = (_physical_profile(name, MATRIX, raw_transfer=tc) for name, tc in (("A", NARROW), ("B", TRANSFER)))
    reference, grey = _physical_profile("Reference", 0.9 * MATRIX), RAW * [1.6, 0.8, 1.2]
    for camera_a, camera_b in permutations((first, second, reference), 2):
        rendered = camera_a.render("standard/daylight")(grey)
        matched = match(camera_a, "standard/daylight", camera_b, "standard/daylight")(rendered)
        np.testing.assert_allclose(matched, camera_b.render("standard/daylight")(grey), atol=1e-6)


def test_what_is_not_colours_on_0_to_1_is_refused() -> None:
    transform = small_profile().render("standard/daylight")
    with pytest.raises(ImageError, match="uint8"):
        transform(np.zeros((4, 4, 3), dtype=np.uint8))
    with pytest.raises(ImageError, match=r"pixels\[\.\.\., :3\]"):
        transform(np.zeros((4, 4, 4)))
    for of_codes in (transform, small_profile().refinish("standard/daylight", "standard/tungsten")):
        with pytest.raises(ImageError, match=r"pixels up to 200.*scale them to \[0, 1\]"):
            of_codes(np.array([[200.0, 100.0, 50.0], [0.0, 0.0, 180.0]]))
    assert np.all(np.isfinite(transform([[1.2, 2.5, 0.3]])))
    broken = transform(np.array([[0.2, np.nan, 0.3], [0.2, 0.2, 0.3]]))
    np.testing.assert_array_equal(np.isnan(broken).any(axis=1), [True, False])
    np.testing.assert_allclose(transform([0, 0, 0]), transform(np.zeros(3)))


@pytest.mark.parametrize("colours", [[[128, 128, 128]], [np.array([1, 2, 3], np.uint8)], [["0.1", "0.2", "0.3"]]])
def test_lists_whose_scale_is_unknown_are_refused(colours: ArrayLike) -> None:
    with pytest.raises(ImageError, match=r"scale them to \[0, 1\]"):
        checked_colours(colours)


def test_lists_of_black_and_white_and_rows_of_different_lengths() -> None:
    np.testing.assert_array_equal(checked_colours([[0, 1, 0]]), [[0.0, 1.0, 0.0]])
    with pytest.raises(ImageError, match="different lengths"):
        checked_colours([[0.1, 0.2], [0.3]])
