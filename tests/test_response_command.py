"""`lutforge response`: a bracket, or exposures of a chart → a profile, LUTs, a config."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

import lutforge as lf
from lutforge.calibration.curve_basis import srgb_response
from lutforge.calibration.one_exposure import fit_one_exposure
from lutforge.cli.response import response as response_command
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.spectra import chart_reflectances, reflectances, surface_reflectances
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError, LutForgeError
from lutforge.model.emor import inverse_emor
from lutforge.model.provenance import Chart
from lutforge.model.response import Response
from lutforge.pipeline.chart_patches import SPACE
from lutforge.pipeline.input_transform import write_input_transform
from lutforge.pipeline.response import parse_times
from lutforge.reports.report import build_report
from lutforge.samples.chart import ChartKind, chart_kind
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.brackets import bracket
from tests.cases.charts import BORDER, PITCH, photograph_chart
from tests.cases.input_transforms import error_of, errors
from tests.conftest import CommandLine

# colour-science tells of optional packages when it is imported
pytestmark = pytest.mark.filterwarnings("ignore")

GAMMA = 1.8
TIMES, _, IMAGES = bracket(lambda light: light ** (1 / GAMMA), cells=24)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("frames")
    for index, image in enumerate(IMAGES):
        assert oiio.ImageBuf(np.rint(255 * image).astype(np.uint8)).write(str(folder / f"{index}.png"))
    return folder


def _power(profile: lf.CameraProfile) -> float:
    (selector,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    codes = np.linspace(0.2, 0.8, 20)
    light = profile.linearize(selector)(np.stack([codes] * 3, axis=1))[:, 1]
    return float(np.polyfit(np.log(codes), np.log(light), 1)[0])


def test_pictures_become_a_profile_luts_and_a_config(frames: Path, tmp_path: Path, lutforge: CommandLine) -> None:
    camera, curve = tmp_path / "camera.npz", tmp_path / "linear.cube"
    times = ",".join(f"{time:g}" for time in TIMES)
    output = lutforge("response", str(frames), "--times", times, "--camera", "Drone 7", "-o", str(camera)).stdout
    assert "Drone 7" in output and "is a fixed property of this camera" in output and "true / stated" in output
    assert _power(lf.load_profile(camera)) == pytest.approx(GAMMA, rel=0.02)
    good = " ".join(map(str, build_report(lf.load_profile(camera)).answers["How good is it?"]))
    assert "neighbouring shots agree within" in good and "Not known" not in good
    lutforge("bake", str(camera), "linearize", "--from", "standard/auto", "-o", str(curve))
    text = curve.read_text()
    assert "LUT_1D_SIZE" in text and "LUT_3D_SIZE" not in text and "scene-linear linear-srgb" in text
    codes = np.full((1, 3), 0.5)
    expected = lf.load_profile(camera).linearize("standard/auto")(codes)
    np.testing.assert_allclose(lf.read_lut(curve)(codes), expected, atol=1e-6)
    lutforge("config", str(camera), "-o", str(tmp_path / "config"))
    config = OCIO.Config.CreateFromFile(str(tmp_path / "config" / "config.ocio"))
    there = config.getProcessor("Drone 7 JPEG standard auto", "Drone 7 linear auto").getDefaultCPUProcessor()
    back = config.getProcessor("Drone 7 linear auto", "Drone 7 JPEG standard auto").getDefaultCPUProcessor()
    grey = np.full(3, 0.5, dtype=np.float32)
    light = np.array(there.applyRGB(grey.tolist()))
    np.testing.assert_allclose(light, expected[0], rtol=1e-4)
    np.testing.assert_allclose(back.applyRGB(light.tolist()), grey, atol=1e-4)


def test_what_is_wrong_is_said_in_a_line(frames: Path, tmp_path: Path) -> None:
    with pytest.raises(LutForgeError, match="2 exposure times for 7 pictures"):
        lf.response([frames], tmp_path / "camera.npz", [1, 2])
    with pytest.raises(LutForgeError, match="states no exposure time"):
        lf.response([frames], tmp_path / "camera.npz")
    with pytest.raises(LutForgeError, match="no pictures in this folder"):
        lf.response([tmp_path], tmp_path / "camera.npz", [1, 2])
    two = [tmp_path / f"{model}.jpg" for model in "AB"]
    for path in two:
        exif = PIL.Image.Exif()
        exif[0x0110] = f"Phone {path.stem}"
        PIL.Image.new("RGB", (16, 16)).save(path, exif=exif)
    with pytest.raises(LutForgeError, match=r"pictures of 2 cameras \(Phone A, Phone B\): give those of one"):
        lf.response(two, tmp_path / "camera.npz", [1, 2])
    with pytest.raises(LutForgeError, match="give seconds"):
        parse_times("1/0,two")
    with pytest.raises(LutForgeError, match="--light is of a colour chart"):
        response_command([frames], light="5200K")


@pytest.mark.slow
@pytest.mark.parametrize("camera", [nikon_d5100(), sigma_sd_merrill()], ids=["d5100", "sd-merrill"])
def test_half_the_error_of_a_curve_and_a_matrix(camera: object, tmp_path: Path) -> None:
    found = errors(camera, "daylight", "daylight", tmp_path)  # type: ignore[arg-type]
    ours, peer = found["LutForge"], found["Debevec and 3 × 3"]
    assert ours[0] <= 0.5 * peer[0]
    assert ours[1] <= peer[1]  # nor worse on surfaces that neither has seen


@pytest.mark.slow
def test_the_whole_way_on_the_command_line(tmp_path: Path, lutforge: CommandLine) -> None:
    camera, kind = nikon_d5100(), chart_kind("classic")
    files = photograph_chart(camera, kind, chart_reflectances(), tmp_path, (-3, -2, -1, 0, 1))
    profile, clf, cube = tmp_path / "camera.npz", tmp_path / "input.clf", tmp_path / "input.resolve.cube"
    words = ("--chart", "classic", "--light", "5200K", "--camera", "Drone 7", "-o", profile)
    output = lutforge("response", *files, *words).stdout
    assert "ColorChecker Classic under 5200K" in output
    assert "is a fixed property" in output and "held-out shots" in output
    lutforge("bake", profile, "linearize", "--from", "standard/auto", "--space", "aces2065-1", "-o", clf, "-o", cube)
    lut = lf.read_lut(clf)
    greys = camera.render(camera.expose(chart_reflectances()[18:23], "daylight"), "standard", "daylight")
    light = lut(greys)
    assert np.abs(light / light[:, 1:2] - 1).max() < 0.05
    expected = chart_reflectances()[18:23].mean(axis=1)
    np.testing.assert_allclose(light[:, 1] / light[2, 1], expected / expected[2], rtol=0.06)
    lutforge("config", profile, "-o", tmp_path / "config")
    config = OCIO.Config.CreateFromFile(str(tmp_path / "config" / "config.ocio"))
    there = config.getProcessor("Drone 7 JPEG standard auto", "ACES2065-1").getDefaultCPUProcessor()
    np.testing.assert_allclose([there.applyRGB(grey.tolist()) for grey in greys], light, rtol=0.05, atol=0.01)


def outlined(kind: ChartKind) -> str:
    """The corners of a photographed chart as `--corners` takes them."""
    return " ".join(f"{x:g},{y:g}" for x, y in BORDER + PITCH * kind.outline)


def test_one_picture_of_a_chart_gives_a_transform_that_is_called_approximate(
    tmp_path: Path, lutforge: CommandLine
) -> None:
    """Nearer to the light of other surfaces than what a user has without it: the JPEG taken for plain sRGB."""
    camera, kind = nikon_d5100(), chart_kind("classic")
    (file,) = photograph_chart(camera, kind, chart_reflectances(), tmp_path, (-1.0,))
    PIL.Image.open(file).save(tmp_path / "no_exif.jpg", quality=98)
    words = ("--chart", "classic", "--light", "5200K", "--corners", outlined(kind), "-o", tmp_path / "camera.npz")
    for picture in (file, tmp_path / "no_exif.jpg"):
        output = lutforge("response", picture, *words).stdout
        assert "approximate" in output and "EMoR's mean curve" in output and "ΔE00" in output
    profile = lf.load_profile(tmp_path / "camera.npz")
    assert any("approximate" in note for note in profile.notes)
    assert profile.provenance == Chart("ColorChecker Classic", "5200K", SPACE)
    to_space = matrix_between("linear-srgb", SPACE).T
    (balance,) = profile.white_balances
    ours, plain = (
        error_of(method, camera, surface_reflectances(), "daylight", "daylight")
        for method in (profile.linearize(f"standard/{balance}"), lambda codes: srgb_decode(codes) @ to_space)
    )
    assert ours < 0.75 * plain
    clf = tmp_path / "input.clf"
    lutforge("bake", tmp_path / "camera.npz", "linearize", "--from", f"standard/{balance}", "--space", SPACE, "-o", clf)
    greys = camera.render(
        camera.expose(chart_reflectances()[19:23], "daylight", camera.nominal_exposure_s / 2), "standard", "daylight"
    )
    light = lf.read_lut(clf)(greys)
    assert np.abs(light / light[:, 1:2] - 1).max() < 0.05


@pytest.mark.parametrize("greys", [3, 6])
@pytest.mark.parametrize("known", ["sRGB", "EMoR"])
def test_greys_decide_which_curve_is_taken(known: str, greys: int) -> None:
    rng = np.random.default_rng(0)
    neutral = np.repeat(np.geomspace(0.04, 0.8, greys)[:, None], 3, axis=1)
    colours = np.vstack([neutral, rng.uniform(0.05, 0.8, (18, 3))])
    grey = np.arange(len(colours)) < greys
    matrix = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.3, 1.3]])
    mean = Response(np.repeat(inverse_emor().mean[:, None], 3, axis=1))
    response = srgb_response() if known == "sRGB" else mean
    linear = 0.6 * colours * (0.9, 1.0, 1.1) @ matrix.T
    usable = np.all((linear > 0.01) & (linear < 1.0), axis=1)
    fit = fit_one_exposure(response.encode(linear[usable]), colours[usable], grey[usable], matrix)
    assert known in fit.curve and fit.spread < 0.02
    np.testing.assert_allclose(fit.multipliers, (0.9, 1.0, 1.1), rtol=0.01)
    np.testing.assert_allclose(fit.matrix, matrix, atol=0.05)
    with pytest.raises(CalibrationError, match="unclipped grey patches"):
        fit_one_exposure(response.encode(linear[usable]), colours[usable], np.zeros(usable.sum(), bool), matrix)


@pytest.mark.slow
def test_the_refusal_of_four_pictures_names_those_without_a_chart_in_two_lines(tmp_path: Path) -> None:
    pytest.importorskip("cv2", reason="OpenCV finds charts: pip install 'lutforge[chart]'")
    kind = chart_kind("classic")
    files = photograph_chart(nikon_d5100(), kind, chart_reflectances(), tmp_path, (-2.0, -1.0, 0.0, 1.0))
    for file in files[1:]:
        with PIL.Image.open(file) as picture:
            exif = picture.getexif()
            PIL.Image.new("RGB", picture.size, (90, 90, 90)).save(file, exif=exif)
    with pytest.raises(CalibrationError) as raised:
        write_input_transform(files, tmp_path / "camera.npz", kind, "5200K")
    message = str(raised.value)
    assert all(file.name in message for file in files[1:]) and files[0].name not in message
    assert len(message) <= 2 * 120


@pytest.mark.slow
def test_light_that_falls_over_the_chart_is_named_and_removed(tmp_path: Path) -> None:
    camera, kind = nikon_d5100(), chart_kind("classic")
    shade = 1.0 - 0.3 * (kind.places[:, :1] + 1.0) / 2.0
    corners = BORDER + PITCH * kind.outline
    scale, notes = [], []
    for name, of_patch in (("even", 1.0), ("falling", shade)):
        folder = tmp_path / name
        folder.mkdir()
        files = photograph_chart(camera, kind, chart_reflectances(), folder, (-3, -2, -1, 0, 1), shade=of_patch)
        fitted = write_input_transform(files, None, kind, "5200K", corners)
        greys = camera.render(camera.expose(chart_reflectances()[18:23], "daylight"), "standard", "daylight")
        light = fitted.profile.linearize("standard/auto")(greys)[:, 1]
        scale.append(light / light[2])
        notes.append("; ".join(fitted.profile.notes))
    np.testing.assert_allclose(scale[1], scale[0], rtol=0.05)
    assert "light falls" not in notes[0] and "from left to right over the chart" in notes[1]


def test_a_chart_that_no_detector_knows_needs_its_corners(tmp_path: Path) -> None:
    camera, kind = nikon_d5100(), chart_kind("spyder24")
    files = photograph_chart(camera, kind, reflectances("ISO 17321-1"), tmp_path, (-2.0, -1.0))
    with pytest.raises(
        CalibrationError, match=rf"{files[0].name}, {files[1].name}: no .*no detector for it.*--corners"
    ):
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50")
    corners = BORDER + PITCH * kind.outline
    with pytest.raises(CalibrationError, match="no SpyderCheckr 24"):  # but a ColorChecker
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners)
    with pytest.raises(CalibrationError, match="no ColorChecker Classic"):  # upside down
        turned = np.roll(corners, 2, axis=0)
        write_input_transform(files, tmp_path / "camera.npz", chart_kind("classic"), "D50", turned)
    for times, message in (([1.0, 0.0], "not above 0"), ([1.0], "1 exposure times for 2")):
        with pytest.raises(CalibrationError, match=message):
            write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners, times)
    with pytest.raises(CalibrationError, match="no SpyderCheckr 24"):
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners + 5000)
    assert not (tmp_path / "camera.npz").exists()


def test_a_refusal_names_the_pictures_without_a_chart(tmp_path: Path) -> None:
    pytest.importorskip("cv2", reason="OpenCV finds charts: pip install 'lutforge[chart]'")
    kind = chart_kind("classic")
    charted, covered = photograph_chart(
        nikon_d5100(), kind, chart_reflectances(), tmp_path, (-3.0, -1.0), light="tungsten", white_balance="shade"
    )
    with PIL.Image.open(covered) as picture:
        PIL.Image.new("RGB", picture.size, (90, 90, 90)).save(covered, exif=picture.getexif())
    with pytest.raises(CalibrationError, match=rf"no chart was found in {covered.name}$") as raised:
        write_input_transform([charted, covered], tmp_path / "camera.npz", kind, "A")
    assert f"in {charted.name}" not in str(raised.value)


def test_a_tinted_chart_is_refused_with_what_to_set(tmp_path: Path) -> None:
    kind = chart_kind("classic")
    files = photograph_chart(
        nikon_d5100(), kind, chart_reflectances(), tmp_path, (-3.0, -1.0), light="tungsten", white_balance="shade"
    )
    with pytest.raises(CalibrationError, match="unsaturated where the white balance is set to the light"):
        write_input_transform(files, tmp_path / "camera.npz", kind, "A", BORDER + PITCH * kind.outline)
