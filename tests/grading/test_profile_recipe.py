"""Refinishing pictures by their own settings: the simulated camera says what each should become."""

import pickle
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.raw_transfer import fit_raw_transfer
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import ProfileError, SettingsError, in_common
from lutforge.grading.baked_grades import SettingChange
from lutforge.grading.batch import apply_batch
from lutforge.grading.picture_settings import source_selector
from lutforge.grading.profile_recipe import ProfileRecipe
from lutforge.images.jpeg import read_header
from lutforge.images.read import Image, read_image
from lutforge.images.write import write_image
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.grading import Grading, apply
from lutforge.settings import parse_selector
from lutforge.shots.metadata import ShotMetadata, read_picture_settings
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import Photograph, develop_again, photograph
from lutforge.simulate.scene import palette
from lutforge.simulate.scenes import SCENES, still_life
from tests.cases.profiles import small_profile
from tests.cases.same_bytes import same_bytes
from tests.cases.samples import SETTINGS, STYLES, samples_of_settings

Recipes = Callable[..., ProfileRecipe]
"""Makes a recipe of the simulated camera's profile, with options."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("refinish")


@pytest.fixture(scope="module")
def profile(folder: Path) -> CameraProfile:
    made = calibrate(samples_of_settings(nikon_d5100(), 1), CalibrationOptions(size=17))
    made.save(folder / "camera.npz")
    return made


@pytest.fixture(scope="module")
def shot(folder: Path) -> Photograph:
    """A still life that no calibration has seen, tungsten in daylight; its JPEG says so."""
    settings = CameraSettings("standard", "tungsten", nikon_d5100().nominal_exposure_s * 0.6)
    scene = SCENES["still-life"](232, 344, 7)
    return photograph(nikon_d5100(), scene, settings, folder / "shot", "IMG_1", light="daylight")


@pytest.fixture(scope="module")
def recipe_of(profile: CameraProfile, folder: Path) -> Recipes:
    return partial(ProfileRecipe, (folder / "camera.npz",))


@pytest.fixture
def picture(shot: Photograph, tmp_path: Path) -> Path:
    """The shot's JPEG without its RAW file beside it."""
    assert shot.jpeg is not None
    return shutil.copyfile(shot.jpeg, tmp_path / "picture.jpg")


def truth(shot: Photograph, folder: Path, style: str, balance: str) -> NDArray[np.float32]:
    settings = CameraSettings(style, balance, nikon_d5100().nominal_exposure_s * 0.6)
    return read_image(develop_again(nikon_d5100(), shot, settings, folder / f"{style}-{balance}.jpg")).pixels


def error(before: NDArray[np.float32], after: NDArray[np.float32], expected: NDArray[np.float32]) -> float:
    """RMSE of the means of 8 × 8 pixels of which none is clipped, before or after."""

    def tiles(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        height, width = (length // 8 * 8 for length in picture.shape[:2])
        return picture[:height, :width].reshape(height // 8, 8, width // 8, 8, 3)

    usable = (
        (tiles(before) > 0.002) & (tiles(before) < 0.998) & (tiles(expected) > 0.002) & (tiles(expected) < 0.998)
    ).all(axis=(1, 3, 4))
    assert usable.mean() > 0.3
    return float(np.sqrt(np.mean((tiles(after) - tiles(expected)).mean(axis=(1, 3))[usable] ** 2)))


@pytest.mark.slow
def test_pairs_on_an_unseen_scene(recipe_of: Recipes, profile: CameraProfile, shot: Photograph, folder: Path) -> None:
    settings = [(style, balance) for style in STYLES for balance in SETTINGS]
    pictures = {setting: truth(shot, folder, *setting) for setting in settings}
    errors = {}
    for source in settings:
        for target in settings:
            if source != target:
                recipe = recipe_of("/".join(source), "/".join(target))
                taken_as, wanted = (profile.selector("/".join(setting)) for setting in (source, target))
                chain = recipe.baked_grades.refinish(SettingChange(profile, taken_as, profile, wanted))
                # One of highlights between those of the model.
                assert sum(isinstance(op, Cube) for op in chain.ops) == 3
                after = evaluate(chain.processor(), pictures[source])
                errors[source, target] = error(pictures[source], after, pictures[target])
    # One draw. Over six draws of the samples and two scenes the median is 0.0032 and the worst pair of a scene
    # 0.0129 on average, 0.0096 to 0.0206, whichever of the two matrices the renderings are made to continue.
    assert np.median(list(errors.values())) <= 0.0031
    assert max(errors.values()) <= 0.014, max(errors, key=lambda pair: errors[pair])


def test_a_picture_tells_its_own_settings(recipe_of: Recipes, shot: Photograph, picture: Path, tmp_path: Path) -> None:
    recipe = recipe_of(target="vivid/daylight")
    recipe.check()
    result = apply_batch(recipe, [picture], tmp_path / "out")
    assert not result.failed
    after = read_image(tmp_path / "out" / "picture.jpg")
    assert error(read_image(picture).pixels, after.pixels, truth(shot, tmp_path, "vivid", "daylight")) < 0.012
    header = read_header((tmp_path / "out" / "picture.jpg").read_bytes())
    assert header is not None
    assert header.comments[-1].endswith("standard/tungsten -> LutForge Simulated D5100: vivid/daylight")
    (other,) = apply_batch(recipe, [picture], tmp_path / "out", ".tif").done
    spec = read_image(other.target).spec
    assert spec.get_int_attribute("Exif:LightSource") == 1
    assert spec.getattribute("Exif:Saturation") is None
    # The result tells what it is now, whatever its description still says.
    now = read_picture_settings(tmp_path / "out" / "picture.jpg")
    assert (now.camera, now.style, now.white_balance) == (nikon_d5100().name, "vivid", "daylight")
    back = apply_batch(recipe_of(target="standard/tungsten"), [result.done[0].target], tmp_path / "back")
    assert error(after.pixels, read_image(back.done[0].target).pixels, read_image(picture).pixels) < 0.012


def test_as_shot_keeps_either(recipe_of: Recipes, picture: Path) -> None:
    for target, told in (
        ("vivid/as-shot", "vivid/tungsten"),
        ("as-shot/shade", "standard/shade"),
        (None, "standard/tungsten"),
        ("standard/5200K+10", "standard/5200K+10"),
    ):
        grade = recipe_of(target=target).grade(picture)
        assert grade.history.endswith(f"-> {nikon_d5100().name}: {told}")


def test_what_a_picture_does_not_tell_is_refused_with_advice(recipe_of: Recipes, folder: Path, tmp_path: Path) -> None:
    pixels = np.full((8, 8, 3), 0.4, dtype=np.float32)
    spec = oiio.ImageSpec(8, 8, 3, "uint8")
    write_image(tmp_path / "bare.png", pixels, Image(pixels, spec))
    spec.attribute("Make", "LutForge")
    spec.attribute("Model", "Simulated D5100")
    write_image(tmp_path / "named.jpg", pixels, Image(pixels, spec))
    spec.attribute("Model", "Other")
    spec.attribute("ImageDescription", "PictureStyle=vivid; WhiteBalance=shade")
    write_image(tmp_path / "other.jpg", pixels, Image(pixels, spec))
    recipe = recipe_of(target="vivid/daylight")
    for tells_nothing in (recipe, recipe_of(ev=0.5)):
        with pytest.raises(SettingsError, match=r"does not name its camera.*--from"):
            tells_nothing.grade(tmp_path / "bare.png")
    brightened = recipe_of("standard/as-shot", ev=0.5).grade(tmp_path / "bare.png")  # exposure alone
    assert brightened.lut is not None
    assert [note for note in brightened.notes if "white balance" in note] == [
        "the file does not state its white balance, which stays as it is; it is graded as standard/cloudy"
    ]
    with pytest.raises(SettingsError, match=r"does not state its picture style.*standard, vivid.*--from"):
        recipe.grade(tmp_path / "named.jpg")
    with pytest.raises(SettingsError, match=r"is of LutForge Other.*--from"):
        recipe.grade(tmp_path / "other.jpg")
    with pytest.raises(SettingsError, match=r"white balance.*tungsten.*studio"):
        recipe_of("standard/as-shot", "vivid/daylight").grade(tmp_path / "named.jpg")
    asked = recipe_of("standard/shade", "vivid/daylight")
    assert "is of LutForge Other" in asked.grade(tmp_path / "other.jpg").notes[0]
    with pytest.raises(SettingsError, match="sepia"):
        recipe_of(target="sepia/daylight").check()
    with pytest.raises(ProfileError, match="second profile"):
        ProfileRecipe((folder / "camera.npz", folder / "camera.npz")).check()


def test_clipped_whites_and_blacks_stay_neutral(recipe_of: Recipes, profile: CameraProfile) -> None:
    render = profile.styles["vivid"].render
    assert render is not None
    greys = render(np.linspace(0.0, 1.0, 4097)[:, None].repeat(3, axis=1))
    for ev in (-1.0, 0.0, 1.0):
        recipe = recipe_of("standard/tungsten", "vivid/shade", ev)
        taken_as = profile.selector("standard/tungsten")
        wanted = profile.selector("vivid/shade")
        chain = recipe.baked_grades.refinish(SettingChange(profile, taken_as, profile, wanted, ev))
        white, black = evaluate(chain.processor(), np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]))
        # One of the greys that the camera makes, within half a code
        assert np.linalg.norm(greys - white, axis=1).min() < 0.5 / 255
        assert np.all(black == 0.0)
        model = profile.refinish("standard/tungsten", "vivid/shade", ev)
        below = np.random.default_rng(0).integers(1, 240, (500, 3)) / 255
        # What rises to a white that becomes darker begins at a third of white; below, the model is as it is.
        below[:, 1] = np.minimum(below[:, 1], 0.3 if ev < 0 else 0.5)
        np.testing.assert_allclose(chain(below), model(below), atol=1e-9)
        near = np.random.default_rng(1).integers(200, 256, (500, 3)) / 255
        assert np.abs(chain(near) - model(near)).mean() < 0.005  # within a cell of where they begin to rise


def test_a_raw_file_is_rendered_as_the_camera_renders_it(recipe_of: Recipes, shot: Photograph, tmp_path: Path) -> None:
    recipe = recipe_of(target="vivid/daylight")
    result = apply_batch(recipe, [shot.dng], tmp_path / "out", ".tif")
    assert not result.failed
    again = apply_batch(recipe, [shot.dng], tmp_path / "out", ".tif", resume=True)
    assert again.skipped == (tmp_path / "out" / "IMG_1.tif",)
    written = read_image(tmp_path / "out" / "IMG_1.tif")
    for name, value in {"Make": "LutForge", "Model": "Simulated D5100", "DateTime": "2015:06:15 12:00:00"}.items():
        assert written.spec.get_string_attribute(name) == value
    assert written.spec.get_string_attribute("Exif:DateTimeOriginal") == "2015:06:15 12:00:00"
    assert written.spec.get_float_attribute("FNumber") == pytest.approx(8.0)
    assert written.spec.get_float_attribute("ExposureTime") > 0
    assert written.spec.get_int_attribute("Exif:RecommendedExposureIndex") == 100  # OpenImageIO's TIFFs have no other
    rendered = written.pixels
    expected = truth(shot, tmp_path, "vivid", "daylight")
    top, left = ((a - b) // 2 for a, b in zip(rendered.shape[:2], expected.shape[:2], strict=True))
    cut = rendered[top : top + expected.shape[0], left : left + expected.shape[1]]
    assert error(expected, cut, expected) < 0.012
    as_shot = recipe_of().grade(shot.dng)
    assert as_shot.history.endswith("standard/tungsten")
    darker = recipe_of(ev=-2.0).grade(shot.dng)
    white = evaluate(darker.processor, np.ones((1, 3)))
    assert np.ptp(white) < 0.02
    assert white.max() < 0.8


@pytest.mark.parametrize("target", [None, "standard/tungsten"])
def test_what_is_as_wanted_is_copied(recipe_of: Recipes, picture: Path, tmp_path: Path, target: str | None) -> None:
    result = apply_batch(recipe_of(target=target), [picture], tmp_path / "out")
    assert same_bytes(result.done[0].target, picture)
    assert any("nothing to change" in note for note in result.done[0].notes)
    other = apply_batch(recipe_of(target=target), [picture], tmp_path / "out", ".png")
    np.testing.assert_array_equal(read_image(other.done[0].target).pixels, read_image(picture).pixels)


def test_photographs_of_two_cameras_come_to_one_look(
    recipe_of: Recipes, shot: Photograph, picture: Path, folder: Path, tmp_path: Path
) -> None:
    other = sigma_sd_merrill()
    theirs_only = samples_of_settings(other, 2, ("vivid",), ("tungsten", "daylight", "shade"))
    calibrate(theirs_only, CalibrationOptions(size=17)).save(tmp_path / "other.npz")
    settings = CameraSettings("vivid", "daylight", other.nominal_exposure_s * 0.6)
    scene = SCENES["still-life"](232, 344, 7)
    theirs = photograph(other, scene, settings, tmp_path, "theirs", jpeg_beside=True)
    assert theirs.jpeg is not None
    theirs.dng.unlink()
    surfaces = palette(200, np.random.default_rng(5))
    x, y = (camera.expose(surfaces, "daylight") for camera in (other, nikon_d5100()))
    transfer = fit_raw_transfer(other.name, nikon_d5100().name, x, y, 1 / other.multipliers("daylight"))
    transfer.save(tmp_path / "t.json")
    errors = []
    for measured in (None, tmp_path / "t.json"):
        profiles = (folder / "camera.npz", tmp_path / "other.npz")
        recipe = ProfileRecipe(profiles, target="standard/as-shot", look=profiles[0], transfer=measured)
        recipe.check()
        again: ProfileRecipe = pickle.loads(pickle.dumps(replace(recipe)))  # as it goes to a cluster
        assert again.key == recipe.key
        grade = recipe.grade(theirs.jpeg)
        assert grade.history.endswith(f"{other.name}: vivid/daylight -> {nikon_d5100().name}: standard/daylight")
        before = read_image(theirs.jpeg).pixels
        mine = photograph(nikon_d5100(), scene, replace(settings, style="standard"), tmp_path, "mine")
        assert mine.jpeg is not None
        errors.append(error(before, evaluate(grade.processor, before), read_image(mine.jpeg).pixels))
        own = recipe.grade(picture)
        assert own.history.endswith(f"-> {nikon_d5100().name}: standard/tungsten")
    assert max(errors) <= 0.02
    with pytest.raises(SettingsError, match="--as"):
        recipe_of(transfer=tmp_path / "t.json").check()
    transfer = replace(transfer, target="Another")
    transfer.save(tmp_path / "t.json")
    with pytest.raises(SettingsError, match=f"leads from {other.name} to Another, not from"):
        replace(recipe).check()


@pytest.mark.parametrize(
    ("style", "balance", "asked", "told"),
    [
        ("vivid", "daylight", "standard/tungsten", "vivid/daylight"),
        ("standard", "daylight", "standard/tungsten", "standard/daylight"),
        ("vivid", "daylight", "standard/as-shot", "vivid/daylight"),
        ("standard", "shade", "standard/tungsten", "standard/shade"),
        ("standard", "tungsten", "standard/tungsten", ""),
        ("standard", "tungsten", "standard/1.3,1,2.6", ""),
        ("unknown", "unknown", "standard/tungsten", ""),
        ("vivid", "daylight", None, ""),
    ],
)
def test_settings_that_contradict_the_file_are_noted(style: str, balance: str, asked: str | None, told: str) -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, style, balance, None)
    given, notes = source_selector(Path("a.jpg"), settings, camera, parse_selector(asked or "as-shot/as-shot"))
    assert notes == ((f"the file says {told}; it is taken for {given}, as --from says",) if told else ())


def test_multipliers_of_the_file_count_as_what_it_says() -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, "standard", "auto", np.array([1.31, 1.0, 2.58]))
    assert source_selector(Path("a.jpg"), settings, camera, parse_selector("standard/tungsten"))[1] == ()
    assert (
        "the file says standard/auto"
        in source_selector(Path("a.jpg"), settings, camera, parse_selector("standard/daylight"))[1][0]
    )


def test_notes_that_files_share_are_one_line() -> None:
    notes = [(f"IMG_{n}.CRW", f"passed over: shots/IMG_{n}.JPG: no match, by {n}.5 pixels") for n in range(10, 14)]
    assert list(in_common([*notes, ("IMG_10.CRW", "D-Lighting was on"), notes[0]], "shots")) == [
        f"4 shots, such as IMG_10.CRW: {notes[0][1]}",
        "IMG_10.CRW: D-Lighting was on",
    ]


def test_automatic_white_balance_without_multipliers_is_refused_with_what_to_do() -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, "standard", "auto", None)
    message = (
        r'a\.jpg: its white balance is "auto", and .* multipliers .*; put its RAW file beside it, name it with --from '
        r"standard/WB, where WB is .*, a temperature from \d+K to \d+K; `lutforge studio`"
    )
    with pytest.raises(SettingsError, match=message):
        source_selector(Path("a.jpg"), settings, camera)


def test_an_automatic_white_balance_that_stays_is_noted_with_the_one_that_is_used() -> None:
    camera = small_profile()
    camera = replace(camera, white_balances={"auto": replace(camera.white_balances["daylight"], spread=0.2)})
    settings = ShotMetadata(camera.camera, "standard", "auto", None)
    given, notes = source_selector(Path("a.jpg"), settings, camera, needs_balance=False)
    assert given == parse_selector("standard/auto")
    assert [note.split("; ")[1] for note in notes] == [
        "it is graded as standard/auto, the white balance of the middle shot"
    ]


@pytest.mark.parametrize(
    ("grade", "options", "why"),
    [
        ("config.ocio", {"ev": 1.0}, "--ev goes with a profile"),
        ("a.cube", {"ev": 1.0}, "--ev with a profile"),
        ("camera.npz", {"exposure": "exif"}, "--exposure goes with --space"),
        ("camera.npz", {"space": "acescg", "exposure": "meter"}, "unknown exposure"),
        ("camera.npz", {"space": "vlog"}, "pictures become linear light"),
        ("camera.npz", {"space": "acescg", "target": "vivid/daylight"}, "light has no style"),
        ("camera.npz", {"space": "acescg", "suffix": ".jpg"}, "linear light is written as .exr"),
        ("camera.npz", {"space": "acescg", "look": Path("b.npz")}, "--as goes without --space"),
    ],
)
@pytest.mark.usefixtures("profile")
def test_options_that_would_do_nothing_or_do_not_go_together(
    grade: str, options: dict[str, Any], why: str, folder: Path, picture: Path, tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match=why):
        Grading((folder / grade, picture), tmp_path / "out", **options).run()
    assert not (tmp_path / "out").exists()


BALANCES, EXPOSURES = ("tungsten", "daylight", "shade"), (-2, -1, 0, 1, 2)
TILE = 8


@pytest.fixture(scope="module")
def bracket(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """One scene in daylight, in every style, white balance and exposure."""
    folder, camera, scene = tmp_path_factory.mktemp("bracket"), nikon_d5100(), still_life(240, 360, 5)
    files = []
    for style in STYLES:
        for balance in BALANCES:
            for ev in EXPOSURES:
                settings = CameraSettings(style, balance, camera.nominal_exposure_s * 2.0**ev, preview_scale=0.25)
                shot = photograph(camera, scene, settings, folder, f"{style}-{balance}{ev:+d}", light="daylight")
                assert shot.jpeg is not None
                files.append(shot.jpeg)
    return files


def tiles(values: Array) -> Array:
    """Mean of tiles of an image (h, w, c)."""
    height, width = (side // TILE for side in values.shape[:2])
    cut = values[: height * TILE, : width * TILE]
    return np.asarray(cut.reshape(height, TILE, width, TILE, -1).mean(axis=(1, 3)))


def departures(pictures: list[Array], clipped: list[Mask]) -> Array:
    """How far each surface's channels are from their median over the pictures that do not clip it, as shares of it."""
    means = np.array([tiles(picture) for picture in pictures])
    whole = np.array([tiles(mask[..., None].astype(np.float64)) == 0 for mask in clipped])[..., 0]
    means[~whole] = np.nan
    means = means[:, whole.sum(axis=0) >= 2]
    shares = np.abs(means / np.nanmedian(means, axis=0) - 1)
    return np.asarray(shares[np.isfinite(shares)])


@pytest.mark.usefixtures("profile")
def test_pictures_of_one_scene_agree(folder: Path, bracket: list[Path], tmp_path: Path) -> None:
    result = apply(folder / "camera.npz", bracket, tmp_path, space="acescg", exposure="exif")
    assert not result.failed and len(result.done) == len(bracket)
    light = [read_image(done.target).pixels.astype(np.float64) for done in result.done]
    masks = [picture[..., 3] > 0.5 for picture in light]
    shares = departures([picture[..., :3] for picture in light], masks)
    codes = [read_image(path).pixels.astype(np.float64) for path in bracket]
    times = [2.0 ** float(path.stem[-2:]) for path in bracket]
    naive = departures([srgb_decode(image) / time for image, time in zip(codes, times, strict=True)], masks)
    assert np.median(shares) < 0.02 and np.quantile(shares, 0.95) < 0.05
    assert np.median(shares) < np.median(naive) / 10


@pytest.mark.usefixtures("profile")
def test_light_is_that_of_the_scene(folder: Path, bracket: list[Path], tmp_path: Path) -> None:
    """In the camera's own white balance, without exposure: 1 is where a neutral surface saturates."""
    camera, picture = nikon_d5100(), next(path for path in bracket if path.stem == "standard-daylight+0")
    result = apply(folder / "camera.npz", picture, tmp_path, space="acescg")
    light = read_image(result.done[0].target).pixels
    scene = still_life(240, 360, 5).irradiance(camera, "daylight").astype(np.float64) * camera.multipliers("daylight")
    truth = scene @ (from_linear_srgb("acescg") @ camera.matrix).T
    side = [(a - b) // 2 for a, b in zip(truth.shape, light.shape, strict=False)][:2]
    truth = truth[side[0] : side[0] + light.shape[0], side[1] : side[1] + light.shape[1]]
    sound = tiles(light[..., 3:].astype(np.float64))[..., 0] == 0
    ratio = tiles(light[..., :3].astype(np.float64))[sound] / tiles(truth)[sound]
    assert abs(np.median(ratio) - 1) < 0.02


@pytest.mark.usefixtures("profile")
def test_the_file_tells_what_it_holds(folder: Path, bracket: list[Path], tmp_path: Path) -> None:
    (done,) = apply(folder / "camera.npz", bracket[0], tmp_path, space="acescg", exposure="exif").done
    file = oiio.ImageInput.open(str(done.target))
    assert file is not None
    spec = file.spec()
    assert done.target.suffix == ".exr" and str(spec.format) == "half"
    assert spec.channelnames == ("R", "G", "B", "clipped")
    assert spec.get_string_attribute("colorInteropID") == "lin_ap1_scene"
    assert spec.get_string_attribute("Model") == "Simulated D5100" and spec.get_float_attribute("FNumber") == 8.0
    codes = read_image(bracket[0]).pixels
    ends = ((codes <= 0.5 / 255) | (codes >= 254.5 / 255)).any(axis=-1)
    assert np.array_equal(read_image(done.target).pixels[..., 3] > 0.5, ends)
