"""Telling a picture's camera by its pixels, on cameras of matrix and response whose noise is known."""

import json
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from lutforge.arrays import Array
from lutforge.errors import ImageError, ProfileError
from lutforge.identification.evidence import PictureEvidence, explain, read_evidence
from lutforge.identification.judgement import departed, judge
from lutforge.identification.noise_tally import LEVELS
from lutforge.identification.rendering import Rendering, renderings
from lutforge.identification.scene_colours import palette
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.identification import identify, known_cameras
from tests.conftest import CommandLine

BALANCES = {"daylight": WhiteBalance((2.0, 1.0, 1.5)), "tungsten": WhiteBalance((1.2, 1.0, 2.9))}
MATRICES = {
    "One": np.array([[1.7, -0.6, -0.1], [-0.15, 1.5, -0.35], [0.05, -0.55, 1.5]]),
    "Two": np.array([[1.2, 0.1, -0.3], [-0.3, 1.4, -0.1], [0.1, -0.9, 1.8]]),
}


def camera(name: str, exponents: dict[str, float]) -> CameraProfile:
    """A camera whose styles are powers, with a toe."""
    codes = np.linspace(0.0, 1.0, 256)
    styles = {}
    for style, exponent in exponents.items():
        curve = ((codes + 0.04) ** exponent - 0.04**exponent) / (1.04**exponent - 0.04**exponent)
        response = Response(np.repeat(curve[:, None], 3, axis=1))
        model = PhysicalModel(tuple(BALANCES), MATRICES[name], response, identity_gamut_map(), identity_gamut_map())
        styles[style] = PictureStyle(physical=(model,))
    return CameraProfile(f"Maker {name}", MATRICES[name], BALANCES, styles)


def photograph(profile: CameraProfile, selector: str, seed: int, quality: int = 92, well: float = 15_000) -> bytes:
    """A JPEG of 96 surfaces, each lit unevenly, with the noise of photons in RAW."""
    rng = np.random.default_rng(seed)
    surfaces = rng.uniform(0.12, 0.85, (96, 1)) * (1 + rng.normal(0, 0.2, (96, 3)))
    scene = np.kron(surfaces.reshape(8, 12, 3), np.ones((48, 48, 1)))
    scene *= (1 + 0.1 * np.linspace(-1, 1, 48 * 12))[None, :, None]
    gain = profile.multipliers(selector)
    raw = np.clip(scene / gain, 0.0, 1.0)
    raw = np.maximum(raw + rng.standard_normal(raw.shape) * np.sqrt(raw / well), 0.0)
    codes = np.rint(255 * profile.render(selector)(raw)).astype(np.uint8)
    file = BytesIO()
    Pillow.fromarray(codes).save(file, "JPEG", quality=quality, subsampling=0)
    return file.getvalue()


@pytest.fixture(scope="module")
def cameras() -> tuple[CameraProfile, CameraProfile]:
    return camera("One", {"soft": 1.9, "hard": 2.4}), camera("Two", {"soft": 1.9, "hard": 2.4})


@pytest.fixture(scope="module")
def known(cameras: tuple[CameraProfile, CameraProfile]) -> list[Rendering]:
    return [rendering for profile in cameras for rendering in renderings(profile)]


def evidence(folder: Path, data: bytes) -> PictureEvidence:
    path = folder / "picture.jpg"
    path.write_bytes(data)
    return read_evidence(path)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("balance", BALANCES)
def test_noise_tells_camera_style_and_light(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], known: list[Rendering], place: int, balance: str
) -> None:
    selector = f"{('soft', 'hard')[place % 2]}/{balance}"
    picture = evidence(tmp_path, photograph(cameras[place // 2], selector, place))
    told = np.array([explain(picture, rendering).noise for rendering in known])
    assert divmod(int(told.argmax()), len(BALANCES)) == (place, list(BALANCES).index(balance))


def test_a_picture_that_was_saved_without_loss_has_no_noise_of_its_own(tmp_path: Path, known: list[Rendering]) -> None:
    pixels = Pillow.open(BytesIO(photograph(camera("One", {"soft": 1.9}), "soft/daylight", 1)))
    pixels.save(tmp_path / "picture.png")
    judgement = judge(read_evidence(tmp_path / "picture.png"), known)
    assert judgement.notes


def test_probabilities_are_shares_of_one(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], known: list[Rendering]
) -> None:
    picture = evidence(tmp_path, photograph(cameras[1], "hard/daylight", 5))
    judgement = judge(picture, known)
    assert sum(each.probability for each in judgement.candidates) + judgement.unknown == pytest.approx(1.0)
    for candidate in judgement.candidates:
        assert sum(candidate.white_balances.values()) == pytest.approx(1.0)
    assert (judgement.candidates[0].camera, judgement.candidates[0].style) == ("Maker Two", "hard")


def test_a_picture_by_another_camera_is_not_told(tmp_path: Path, known: list[Rendering]) -> None:
    stranger = camera("One", {"other": 1.3})
    judgement = judge(evidence(tmp_path, photograph(stranger, "other/daylight", 6)), known)
    assert judgement.answer is None
    assert judgement.lines()[0].startswith("cannot tell")
    assert judgement.lines()[1] == "white balance: cannot tell"


def with_tables(data: bytes, step: int) -> bytes:
    """The same picture with quantization tables that no libjpeg writes."""
    file = BytesIO()
    tables = [[step] * 64, [step + 1] * 64]
    Pillow.open(BytesIO(data)).save(file, "JPEG", qtables=tables, subsampling=0)
    return file.getvalue()


def test_tables_that_a_camera_was_calibrated_with_speak_for_it(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], known: list[Rendering]
) -> None:
    data = photograph(cameras[0], "soft/daylight", 7)
    own, other = (evidence(tmp_path, with_tables(data, step)) for step in (5, 7))
    seen = replace(known[0], encoders=(own.encoder,))
    told = explain(own, seen).encoder
    assert explain(other, seen).encoder < explain(own, known[0]).encoder == 0.0 < told
    assert explain(own, departed(seen, gamma=0.1)).encoder == 0.0  # strangers' tables are unknown
    usual = evidence(tmp_path, data)
    assert usual.encoder == "libjpeg"  # any program's
    assert explain(usual, seen).encoder == explain(usual, replace(seen, encoders=("libjpeg",))).encoder == 0.0
    unsure = judge(own, known).candidates
    share = {each.style: each.probability for each in judge(own, [seen, *known[1:]]).candidates if "One" in each.camera}
    assert share["soft"] > next(e.probability for e in unsure if (e.camera, e.style) == ("Maker One", "soft"))


def test_a_camera_is_not_likelier_for_having_more_styles(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], known: list[Rendering]
) -> None:
    picture = evidence(tmp_path, photograph(cameras[0], "soft/daylight", 9))
    others = [replace(known[0], camera="Other", style=style) for style in ("a", "b", "c")]
    shares = {(each.camera, each.style): each.probability for each in judge(picture, [known[0], *others]).candidates}
    assert shares.pop(("Maker One", "soft")) == pytest.approx(sum(shares.values()))


def test_reach_is_judged_by_what_the_calibration_leaves_of_its_own_colours(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], known: list[Rendering]
) -> None:
    picture = evidence(tmp_path, photograph(cameras[0], "soft/daylight", 10))
    rough = replace(known[0], render=lambda scene: known[0].render(scene) + 4 / 255)
    assert explain(picture, rough).reach < explain(picture, replace(rough, slack=4 / 255)).reach
    assert explain(picture, known[0]).reach == pytest.approx(0.0, abs=1e-3)


def test_a_departed_rendering_is_taken_back_by_its_own_inverse(known: list[Rendering]) -> None:
    other = departed(known[0], gamma=0.1, contrast=0.1, saturation=-0.1)
    codes = np.random.default_rng(0).uniform(0.25, 0.75, (100, 3))
    assert np.allclose(other.render(other.linearize(codes)), codes, atol=2e-3)
    assert not np.allclose(other.linearize(codes), known[0].linearize(codes), atol=0.02)


def test_slopes_are_those_of_the_rendering(known: list[Rendering]) -> None:
    codes = np.random.default_rng(1).uniform(0.3, 0.7, (20, 3))
    scene, slopes = known[1].slopes(codes)
    step = 1e-3 * np.array([1.0, -0.5, 0.3])
    change: Array = 255 * (known[1].render(scene + step) - known[1].render(scene - step)) / 2
    assert np.allclose(slopes @ step, change, rtol=0.05, atol=0.02)


def test_counts_are_of_flat_blocks_of_a_colour(tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile]) -> None:
    picture = evidence(tmp_path, photograph(cameras[0], "soft/daylight", 2))
    luma, chroma = picture.noise
    assert luma.counts.shape == (len(luma.colours), len(luma.steps), LEVELS)
    assert luma.counts.sum(axis=(0, 2)).max() <= 8 * 6 * 12 * 6
    assert len(chroma.colours) % 2 == 0
    assert np.all((luma.colours > 0) & (luma.colours < 1))


def test_a_palette_has_each_flat_colour_once() -> None:
    picture = np.zeros((64, 64, 3), dtype=np.float32) + 0.5
    picture[:32] = (0.2, 0.4, 0.6)
    colours, counts = palette(picture)
    assert colours == pytest.approx(np.array([[0.5, 0.5, 0.5], [0.2, 0.4, 0.6]]), abs=1e-6) or len(colours) == 2
    assert counts.sum() <= 32 * 32


@pytest.mark.parametrize("damage", ["grey", "flat", "cut", "text", "missing"])
def test_what_tells_nothing_is_refused_in_one_line(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], damage: str
) -> None:
    path = tmp_path / "picture.jpg"
    data = photograph(cameras[0], "soft/daylight", 3)
    if damage == "grey":
        Pillow.open(BytesIO(data)).convert("L").save(path)
    elif damage == "flat":
        Pillow.new("RGB", (640, 480), (90, 120, 80)).save(path)
    elif damage == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "text":
        path.write_text("not a picture")
    with pytest.raises(ImageError) as told:
        read_evidence(path)
    assert "\n" not in str(told.value)


def test_a_profile_among_the_pictures_is_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "camera.npz").touch()
    with pytest.raises(ImageError, match=r"a camera profile, not a picture.*--profiles"):
        read_evidence(tmp_path / "camera.npz")


def test_a_folder_without_profiles_is_told(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="no camera profile"):
        known_cameras(tmp_path)


def test_the_command_prints_and_gives_json(
    tmp_path: Path, cameras: tuple[CameraProfile, CameraProfile], lutforge: CommandLine
) -> None:
    folder = tmp_path / "profiles"
    folder.mkdir()
    for profile in cameras:
        profile.save(folder / f"{profile.camera}.npz")
    picture = tmp_path / "picture.jpg"
    picture.write_bytes(photograph(cameras[0], "hard/tungsten", 8))
    run = lutforge("identify", picture, "--profiles", folder)
    assert run.returncode == 0, run.stderr
    assert "Maker One, style hard" in run.stdout
    told = json.loads(lutforge("identify", picture, "--profiles", folder, "--json").stdout)
    assert told[0]["candidates"][0]["style"] == "hard"
    assert 0 <= told[0]["none_of_these"] <= 1
    assert lutforge("identify", tmp_path / "no.jpg", "--profiles", folder).returncode == 2
    assert identify(picture, folder).candidates[0].camera == "Maker One"
