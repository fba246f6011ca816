"""`lutforge response --chart`: JPEGs of a chart by a camera without RAW → a profile, an input transform, a config."""

from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.colour.spectra import chart_reflectances, reflectances
from lutforge.errors import CalibrationError
from lutforge.luts.formats.clf import ACES_ID
from lutforge.pipeline.charts import write_input_transform
from lutforge.samples.chart_kinds import chart_kind
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.charts import BORDER, PITCH, photograph_chart
from tests.cases.input_transforms import errors
from tests.conftest import CommandLine

pytestmark = pytest.mark.filterwarnings("ignore")  # colour-science tells of optional packages when it is imported


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
    files = photograph_chart(camera, kind, chart_reflectances(), tmp_path, (-3.0, -2.0, -1.0, 0.0, 1.0))
    profile, clf, cube = tmp_path / "camera.npz", tmp_path / "input.clf", tmp_path / "input.dctl"
    words = ("--chart", "classic", "--light", "5200K", "--camera", "Drone 7", "-o", profile)
    said = lutforge("response", *files, *words).stdout
    assert "ColorChecker Classic under 5200K" in said and "is a fixed property" in said and "held-out shots" in said
    lutforge("bake", profile, "linearize", "--from", "standard/auto", "--space", "aces2065-1", "-o", clf, "-o", cube)
    lut = lf.read_lut(clf)
    assert lut.metadata[ACES_ID] == "urn:ampas:aces:transformId:v2.0:CSC.LutForge.Drone_7_standard_auto_to_ACES.a2.v1"
    greys = camera.render(camera.expose(chart_reflectances()[18:23], "daylight"), "standard", "daylight")
    light = lut(greys)
    assert np.abs(light / light[:, 1:2] - 1).max() < 0.05
    wanted = chart_reflectances()[18:23].mean(axis=1)
    np.testing.assert_allclose(light[:, 1] / light[2, 1], wanted / wanted[2], rtol=0.06)
    lutforge("config", profile, "-o", tmp_path / "config")
    import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

    config = OCIO.Config.CreateFromFile(str(tmp_path / "config" / "config.ocio"))
    there = config.getProcessor("Drone 7 standard auto", "ACES2065-1").getDefaultCPUProcessor()
    np.testing.assert_allclose([there.applyRGB(grey.tolist()) for grey in greys], light, rtol=0.05, atol=0.01)


def test_a_chart_that_no_detector_knows_needs_its_corners(tmp_path: Path) -> None:
    camera, kind = nikon_d5100(), chart_kind("spyder24")
    files = photograph_chart(camera, kind, reflectances("ISO 17321-1"), tmp_path, (-2.0, -1.0))
    with pytest.raises(CalibrationError, match=r"no detector for it.*--corners"):
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50")
    corners = BORDER + PITCH * kind.outline
    with pytest.raises(CalibrationError, match="no SpyderCheckr 24"):  # but a ColorChecker
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners)
    with pytest.raises(CalibrationError, match="no ColorChecker Classic"):  # upside down
        turned = np.roll(corners, 2, axis=0)
        write_input_transform(files, tmp_path / "camera.npz", chart_kind("classic"), "D50", turned)
    for times, said in (([1.0, 0.0], "not above 0"), ([1.0], "1 exposure times for 2")):
        with pytest.raises(CalibrationError, match=said):
            write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners, times)
    with pytest.raises(CalibrationError, match="no SpyderCheckr 24"):
        write_input_transform(files, tmp_path / "camera.npz", kind, "D50", corners + 5000)
    assert not (tmp_path / "camera.npz").exists()


def test_a_tinted_chart_is_refused_with_what_to_set(tmp_path: Path) -> None:
    kind = chart_kind("classic")
    files = photograph_chart(
        nikon_d5100(), kind, chart_reflectances(), tmp_path, (-3.0, -1.0), light="tungsten", white_balance="shade"
    )
    with pytest.raises(CalibrationError, match="unsaturated where the white balance is set to the light"):
        write_input_transform(files, tmp_path / "camera.npz", kind, "A", BORDER + PITCH * kind.outline)
