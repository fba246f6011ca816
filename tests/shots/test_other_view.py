"""JPEGs of one camera against RAW files of another that stood elsewhere."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.errors import ShotError
from lutforge.pipeline.sampling import sample_by_reference
from lutforge.shots.other_view import read_other_view
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scene import Scene
from lutforge.simulate.scenes import SCENES
from tests.conftest import CommandLine

cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
SHAPE = (404, 608)
SEEN = cv2.getPerspectiveTransform(  # the RAW's pixels → the JPEG's
    np.array([[45, 35], [560, 20], [575, 380], [30, 370]], dtype=np.float32),
    np.array([[0, 0], [608, 0], [608, 404], [0, 404]], dtype=np.float32),
)


def from_elsewhere(scene: Scene) -> Scene:
    """The scene as a camera sees it that stands elsewhere."""
    h, w = scene.shape
    kinds = dict.fromkeys(("first", "second"), cv2.INTER_NEAREST)
    kinds |= dict.fromkeys(("mix", "shade", "gloss"), cv2.INTER_LINEAR)
    seen = {name: cv2.warpPerspective(getattr(scene, name), SEEN, (w, h), flags=flags) for name, flags in kinds.items()}
    return replace(scene, **seen, patches=np.zeros((0, 2)), patch_side=0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, reference, camera = tmp_path_factory.mktemp("views"), nikon_d5100(), sigma_sd_merrill()
    for name, kind in (("a", "still-life"), ("b", "wall")):
        scene = SCENES[kind](*SHAPE, 0)
        photograph(reference, scene, CameraSettings(exposure_s=1 / 60), folder / "raw", name, jpeg_beside=False)
        photograph(camera, from_elsewhere(scene), CameraSettings(exposure_s=1 / 80), folder / "both", name)
        (folder / "jpeg").mkdir(exist_ok=True)
        (folder / "both" / f"{name}.JPG").rename(folder / "jpeg" / f"{name}.JPG")
    return folder


def test_the_raw_lies_in_the_frame_of_the_jpeg(folder: Path) -> None:
    shot, ratio = read_other_view(folder / "jpeg" / "a.JPG", folder / "raw" / "a.dng")
    assert ratio == pytest.approx(60 / 80, rel=0.01)
    assert shot.metadata.camera == "LutForge Simulated SD Merrill"
    assert shot.raw_camera == "LutForge Simulated D5100"
    light = from_elsewhere(SCENES["still-life"](*SHAPE, 0)).irradiance(nikon_d5100(), "daylight", 1 / 60)
    h, w = shot.jpeg.shape[:2]
    size = shot.raw.pixel_size
    rows, columns = ((np.arange(n) + 0.5) * size for n in shot.raw.pixels.shape[:2])
    seen = light[np.minimum(rows + 4, SHAPE[0] - 1).astype(int)][:, np.minimum(columns + 8, SHAPE[1] - 1).astype(int)]
    assert (w, h) == (SHAPE[1] - 16, SHAPE[0] - 8)
    error = np.abs(shot.raw.pixels - np.clip(seen, 0, 1))[4:-4, 4:-4]
    assert np.median(error) < 0.01 and np.quantile(error, 0.9) < 0.03


def test_samples_name_both_cameras(folder: Path, tmp_path: Path, lutforge: CommandLine) -> None:
    table = tmp_path / "samples.csv"
    lutforge("sample", str(folder / "jpeg"), "--reference", str(folder / "raw"), "-o", str(table))
    header, first, *rest = table.read_text().splitlines()
    assert len(rest) > 80
    values = dict(zip(header.split(","), first.split(","), strict=True))
    assert values["camera"] == "LutForge Simulated SD Merrill"
    assert values["raw_camera"] == "LutForge Simulated D5100"
    profile = lf.calibrate(table)
    assert profile.raw_camera == "LutForge Simulated D5100"
    samples = lf.read_samples(table)
    usable = np.all((samples.srgb > 0.02) & (samples.srgb < 0.98), axis=1)
    error = profile.render("standard/daylight")(samples.raw[usable]) - samples.srgb[usable]
    assert np.median(np.linalg.norm(error, axis=1)) < 0.02


def test_what_does_not_belong_together_is_refused(folder: Path) -> None:
    with pytest.raises(ShotError, match="another scene"):
        read_other_view(folder / "jpeg" / "a.JPG", folder / "raw" / "b.dng")
    with pytest.raises(ShotError, match="1 JPEGs and 2 RAW"):
        odd = folder / "odd.JPG"
        odd.write_bytes((folder / "jpeg" / "a.JPG").read_bytes())
        sample_by_reference([odd], folder / "raw")
