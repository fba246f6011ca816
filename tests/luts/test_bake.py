"""Baking: a fit, never a sampling; exact where the model is a lattice; curves where the model has them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.bake import bake_steps, bake_to
from lutforge.luts.forms import FORMS, Form
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.reading import trusted_processor
from lutforge.luts.shaper import MAX_SHAPER_SIZE
from lutforge.luts.target import Target
from lutforge.luts.verification import verify
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import SHORT_SHAPER_SIZE, Lattice, grid, snap_levels, uniform_levels
from lutforge.model.response import Response
from lutforge.model.transform import Clip, Decode, Encode, Gain, MatrixStage, Purpose, PurposeKind, Stage, Transform
from lutforge.pipeline.baking import bake
from tests.cases.samples import made_samples

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.5, 1.5]])
GAIN = np.array([2.0, 1.0, 1.5])


def look(x: ArrayLike) -> Array:
    """Any function: a tone curve behind crossed channels."""
    mixed = np.asarray(x) ** 2.2 @ np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.05, 0.15, 0.8]]).T
    return np.asarray((0.01 + 0.99 * mixed) ** 0.45)


def response() -> Response:
    code = np.linspace(0.0, 1.0, 256)[:, None]
    return Response(np.concatenate([code**2.0, code**2.2, 0.3 * code + 0.7 * code**2.4], axis=1))


def gamut_map(seed: int, strength: float = 0.02) -> GamutMap:
    rng = np.random.default_rng(seed)
    centres = rng.random((40, 3))
    return GamutMap(centres, strength * rng.normal(size=(40, 3)), np.vstack([np.zeros(3), np.eye(3)]))


def render(gain: Array = GAIN) -> Transform:
    return Transform((Gain(gain), Clip(), MatrixStage(MATRIX), gamut_map(1), Encode(response())))


def linearize() -> Transform:
    return Transform((Clip(), Decode(response()), gamut_map(2), MatrixStage(np.linalg.inv(MATRIX) / GAIN[:, None])))


def refinish(exposure: float = 0.8) -> Transform:
    return Transform((*linearize().stages, Gain(np.full(3, exposure)), *render().stages))


def of_lattice(lattice: Lattice, *behind: Stage) -> Transform:
    return Transform((Gain(GAIN), Clip(), lattice, *behind))


def points(count: int = 20000) -> Array:
    grey = np.repeat(np.linspace(0, 1, 257)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    x = np.concatenate([np.random.default_rng(9).random((count, 3)), grey, corners])
    return x.astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_a_fit_has_less_error_than_sampling(method: Interpolation) -> None:
    x = points()
    expected = look(x)
    fitted = bake(look, size=17, interpolation=method)
    uniform = bake(look, size=17, interpolation=method, form="plain")
    sampled = Lattice(uniform_levels(17), look(grid(uniform_levels(17))), method)
    errors = [np.sqrt(np.mean((f(x) - expected) ** 2)) for f in (fitted, uniform, sampled)]
    assert uniform.summary == "Cube 17³"
    assert errors[0] < 0.8 * errors[1]
    assert errors[1] < 0.75 * errors[2]


def test_black_and_white_are_exact_and_grey_nearly() -> None:
    for transform in (look, render()):
        lut = bake(transform, size=33)
        ends = np.array([[0.0] * 3, [1.0] * 3])
        np.testing.assert_allclose(lut(ends), transform(ends), atol=1e-9)
    grey = np.repeat(np.linspace(0, 1, 500)[:, None], 3, axis=1)
    assert np.abs(bake(look, size=33)(grey) - look(grey)).max() < 2e-3


@pytest.mark.parametrize(("method", "most"), [("tetrahedral", 0.03), ("trilinear", 0.0025)])
def test_the_nodes_beside_white_are_fitted_to_the_white_that_stays(method: Interpolation, most: float) -> None:
    def rising_to_white(x: ArrayLike) -> Array:
        colour = np.asarray(x, dtype=np.float64)
        near = np.clip(colour.min(axis=-1, keepdims=True) / 0.05 - 19, 0.0, 1.0)
        return np.asarray((0.9 + 0.1 * near**2) * colour)

    grey = np.repeat(np.linspace(0.9, 1.0, 500)[:, None], 3, axis=1)
    lut = bake(rising_to_white, size=17, interpolation=method, form="plain")
    assert np.abs(lut(grey) - rising_to_white(grey)).max() <= most


def test_no_output_leaves_the_range_of_the_function() -> None:
    def clipped(x: ArrayLike) -> Array:
        return np.asarray(np.clip(3 * np.asarray(x) - 1, 0.0, 1.0))

    for form in FORMS:
        cube = bake(clipped, size=17, form=form).cube
        assert cube is not None
        assert cube.values.min() >= 0.0
        assert cube.values.max() <= 1.0


def test_a_lattice_is_baked_as_it_stands() -> None:
    axis = snap_levels(np.linspace(0, 1, 9) ** 2, MAX_SHAPER_SIZE)
    lattice = Lattice((axis, axis, axis), np.random.default_rng(0).random((9, 9, 9, 3)), "trilinear")
    transform = of_lattice(lattice, MatrixStage(MATRIX))
    lut = bake(transform)
    np.testing.assert_allclose(lut(points()), transform(points()), atol=1e-12)
    assert bake(transform, size=17).size == 17


def test_a_lattice_with_a_response_is_kept_by_process_lists(tmp_path: Path) -> None:
    """Other formats and other sizes are fitted; no file leaves [0, 1]."""
    axis = snap_levels(np.linspace(0, 1, 9), MAX_SHAPER_SIZE)
    values = grid((axis, axis, axis)) * 1.3 - 0.15
    even = np.linspace(0.0, 1.0, 4096)[:, None].repeat(3, axis=1)
    table = 2 * even / (1 + even)
    lattice = Lattice((axis, axis, axis), values, "trilinear", table)
    x = points()
    transform = Transform((Clip(), lattice))
    assert bake(transform, tmp_path / "a.clf").cube is not None
    read = evaluate(trusted_processor(tmp_path / "a.clf"), x)
    np.testing.assert_allclose(read, transform(x), atol=1e-5)
    assert read.min() >= 0.0 and read.max() <= 1.0
    other = bake(transform, size=17)
    assert isinstance(other.ops[-1], Curve) and np.linalg.norm(other(x) - transform(x), axis=1).max() < 0.01
    bake(transform, tmp_path / "b.csp")
    fitted = evaluate(trusted_processor(tmp_path / "b.csp", "trilinear"), x)
    assert np.abs(fitted - transform(x)).mean() < 0.03


@pytest.mark.parametrize("form", ["full", "shaper"])
def test_a_lattice_with_a_white_balance_is_near_in_any_form(tmp_path: Path, form: Form) -> None:
    """The gain is a matrix, or moves the nodes by less than a step of the shaper."""
    axis = snap_levels(np.linspace(0, 1, 33) ** 2, MAX_SHAPER_SIZE)
    levels = (axis, axis, axis)
    transform = of_lattice(Lattice(levels, look(grid(levels)), "trilinear"), MatrixStage(MATRIX))
    lut = bake(transform, form=form)
    x = points()
    assert np.abs(lut(x) - transform(x)).max() < (1e-12 if form == "full" else 1e-3)
    path = lut.write(tmp_path / ("a.clf" if form == "full" else "a.cube"))
    assert verify(path, lut, lut, display_referred=False).max < 5e-6


@pytest.mark.parametrize("suffix", [".clf", ".ctf"])
def test_a_physical_model_keeps_its_curves(tmp_path: Path, suffix: str) -> None:
    """The response stays a curve of its own in the file, and the file is the LUT."""
    x = points()
    for transform in (render(), linearize(), refinish(1.4)):
        staged = bake(transform, tmp_path / f"a{suffix}", size=17)
        behind = staged.ops[[isinstance(op, Cube) for op in staged.ops].index(True) + 1 :]
        assert any(isinstance(op, Curve) for op in behind) == isinstance(transform.stages[-1], Encode)
        got = evaluate(trusted_processor(tmp_path / f"a{suffix}"), x)
        np.testing.assert_allclose(got, staged(x), atol=1e-5)


def test_stages_at_17_beat_one_cube_at_33(published_d40: CameraProfile) -> None:
    """A real camera's model, both ways: half the error with an eighth of the nodes."""
    x = points(8000)
    for transform in (published_d40.render("standard/daylight"), published_d40.linearize("standard/daylight")):
        expected = transform(x)
        staged, one = bake(transform, size=17), bake(transform, size=33, form="plain")
        ours, plain = (np.linalg.norm(lut(x) - expected, axis=1) for lut in (staged, one))
        assert ours.mean() < 0.5 * plain.mean()
        assert ours.max() < 0.5 * plain.max()


@pytest.mark.parametrize("name", ["a.resolve.cube", "a.csp", "a.cube", "a.3dl"])
def test_each_form_is_a_fit_of_its_own(tmp_path: Path, name: str) -> None:
    """A curve behind the cube, or a shaper, is never lost by sampling what was fitted with it."""
    transform = refinish()
    x = points()
    lut = bake(transform, tmp_path / name, size=None if name in ("a.cube", "a.3dl") else 17)
    assert np.linalg.norm(lut(x) - transform(x), axis=1).mean() < 0.006
    assert verify(tmp_path / name, lut, lut).max < (3e-4 if name == "a.3dl" else 2e-5)


def test_a_shaper_is_as_long_as_it_needs() -> None:
    def steep(x: ArrayLike) -> Array:
        return np.asarray((np.asarray(x) + 1e-5) ** 0.3)

    lengths = [len(shaper.outputs) for f in (refinish(), steep) if (shaper := bake(f, size=17, form="shaper").shaper)]
    assert lengths == [SHORT_SHAPER_SIZE, MAX_SHAPER_SIZE]


@pytest.mark.parametrize("gain", [(2.0, 1.0, 1.5), (0.7, 1.0, 3.1)])
def test_a_white_balance_in_the_shaper_is_fitted_with_it(tmp_path: Path, gain: tuple[float, float, float]) -> None:
    """The file is the model that was fitted, and no worse than with the gain apart."""
    transform = render(np.array(gain))
    full, shaped = (bake_to(transform, Target(form, 17)) for form in ("full", "shaper"))
    path = shaped.write(tmp_path / "a.cube")
    assert verify(path, shaped, shaped, display_referred=False).max < 2e-6
    behind = bake(lambda x: transform(np.asarray(x) / transform.gain), size=17, form="shaper")

    x = points()
    exact = transform(x)

    def error(rendered: Array) -> float:
        return float(np.linalg.norm(rendered - exact, axis=1).mean())

    assert error(full(x)) < error(shaped(x)) < 1.3 * error(behind(x * transform.gain))


def test_a_plain_cube_of_a_calibrated_camera(tmp_path: Path) -> None:
    """A refinish to another white balance, as OpenColorIO reads it, is within one code of the camera's own JPEG."""
    profile = calibrate(made_samples(), CalibrationOptions(size=9))[0]
    red, blue = 2.0, 1.3
    lut = bake(profile.refinish("standard/daylight", f"standard/{red},1,{blue}"), tmp_path / "a.cube", size=9)
    assert lut.summary == "Cube 9³"
    jpeg = np.random.default_rng(0).uniform(0.1, 0.9, (2000, 3))
    ratio = np.array([red, 1.0, blue]) / profile.multipliers("standard/daylight")
    camera = np.clip(jpeg ** (1 / 0.45) * ratio, 0.0, 1.0) ** 0.45
    read = evaluate(trusted_processor(tmp_path / "a.cube"), jpeg)
    assert np.abs(read - camera).mean() < 1 / 255


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_a_hald_image_is_its_cube_to_16_bits(tmp_path: Path, name: str) -> None:
    cube = bake(look, tmp_path / name, size=16).cube
    assert cube is not None
    pixels = np.asarray(oiio.ImageBuf(str(tmp_path / name)).get_pixels(oiio.FLOAT))
    assert pixels.shape == (64, 64, 3)
    red_first = cube.values.transpose(2, 1, 0, 3).reshape(64, 64, 3)
    np.testing.assert_allclose(pixels, red_first, atol=1e-5)
    with pytest.raises(LutError, match="17 nodes"):
        bake(look, tmp_path / name, size=17)


def test_lattices_in_steps_are_the_model(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    levels = tuple(snap_levels(np.linspace(0, 1, 9) ** p, MAX_SHAPER_SIZE) for p in (1.5, 2.0, 2.5))
    r, g, b = levels
    back = Lattice((r, g, b), rng.random((9, 9, 9, 3)), "trilinear")
    forth = Lattice((r, g, b), rng.random((9, 9, 9, 3)), "tetrahedral")
    transform = Transform((Clip(), back, MatrixStage(np.diag(1.3 / GAIN)), *of_lattice(forth).stages))
    lut = bake_steps(transform, title="a look")
    x = points()
    np.testing.assert_allclose(lut(x), transform(x), atol=1e-9)
    path = lut.write(tmp_path / "steps.clf")
    np.testing.assert_allclose(evaluate(trusted_processor(path), x), transform(x), atol=5e-5)
    with pytest.raises(LutError, match="holds one cube"):
        lut.write(tmp_path / "steps.cube")


def test_a_tolerance_that_no_size_can_reach_is_given_up_at_once() -> None:
    tried: list[str] = []

    def note(what: str, share: float) -> None:
        tried.append(what.split()[0])

    with pytest.raises(LutError, match=r"the smallest error found is .*, at 9; give a larger tolerance"):
        bake(look, tolerance=1e-6, progress=note)
    assert set(tried) == {"9³"}  # even 65³ could not be (65 / 9)³ times 1000 times better


def test_a_tolerance_picks_the_size() -> None:
    assert bake(look, tolerance=1.0).size <= bake(look, tolerance=0.2).size
    linear = replace(linearize(), purpose=Purpose(kind=PurposeKind.LINEARIZE))
    with pytest.raises(LutError, match="tolerance"):
        bake(linear, tolerance=0.2)
    with pytest.raises(LutError, match="not both"):
        bake(look, size=17, tolerance=0.2)


def test_what_is_not_a_transform_of_colours_is_refused() -> None:
    with pytest.raises(LutError, match="not finite"):
        bake(lambda x: np.where(np.asarray(x) > 0.5, np.nan, 0.5), size=5)
    with pytest.raises(LutError, match="keep the shape"):
        bake(lambda x: np.asarray(x)[..., :1], size=5)


@pytest.mark.parametrize("form", FORMS)
def test_the_identity_is_an_identity_in_every_form(form: Form) -> None:
    x = points(500)
    lut = bake(Transform(), form=form)
    assert Transform().is_identity
    np.testing.assert_allclose(lut(x), x, atol=1e-12)
    np.testing.assert_array_equal(bake_steps(Transform())(x), x)
