"""Blender with our configs: textures of files that were saved before look as they did."""

import os
import subprocess
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.images.read import read_image
from lutforge.ocio.blender import blender_config
from lutforge.ocio.check import check_config, load_config
from tests.cases.other_versions import blender, folder
from tests.cases.pictures import write_picture
from tests.cases.profiles import plain_profile
from tests.conftest import CommandLine
from tests.ocio.test_config import convert, write_config

SPACES = {
    "3.4": ("sRGB", "Non-Color", "Linear", "Raw", "Linear ACES"),
    "4.2.0": ("sRGB", "Non-Color", "Linear Rec.709", "ACES2065-1"),
}
DATA = ("Non-Color", "Raw")


def own_config(version: str) -> Path:
    """The config that Blender brings along. Skips without."""
    blender(version)
    found = blender_config() if version == "3.4" else next(folder("bpy", version).rglob("colormanagement/config.ocio"))
    assert found is not None
    return found


def run_blender(version: str, config: Path | None, home: Path, *words: str) -> None:
    command = [*blender(version), str(Path(__file__).with_name("blender_textures.py")), "--", *words]
    environment = {name: value for name, value in os.environ.items() if name not in ("OCIO", "PYTHONPATH")}
    environment |= {"HOME": str(home)} | ({} if config is None else {"OCIO": str(config)})
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def seen(version: str, config: Path | None, file: Path, out: Path) -> dict[str, Array]:
    """The linear values of each texture in the scene's space, by the name of its colour space."""
    out.mkdir()
    run_blender(version, config, out, "read", str(file), str(out))
    return {path.stem: read_image(path).pixels[..., :3].astype(np.float64) for path in out.glob("*.exr")}


@pytest.mark.slow
@pytest.mark.parametrize("version", SPACES)
def test_textures_of_existing_files_look_the_same(version: str, tmp_path: Path) -> None:
    """Exactly in Blender's config with the camera; in ours the same light and data, where the scene is ACEScg."""
    picture, file = tmp_path / "picture.png", tmp_path / "file.blend"
    own = own_config(version)
    pixels = np.full((32, 32, 3), 128 / 255, dtype=np.float32)
    pixels[:, 16:] = (0.9, 0.3, 0.1)
    write_picture(picture, pixels=pixels)
    run_blender(version, None, tmp_path, "make", str(file), str(picture), *SPACES[version])
    before = seen(version, None, file, tmp_path / "before")
    assert set(before) == set(SPACES[version])

    merged = write_config([plain_profile("Canon")], tmp_path / "merged", merge=own)
    for name, texture in seen(version, merged, file, tmp_path / "with merged").items():
        assert np.array_equal(texture, before[name]), name

    alone = write_config([plain_profile("Canon")], tmp_path / "alone")
    for name, texture in seen(version, alone, file, tmp_path / "with alone").items():
        expected = before[name] if name in DATA else before[name] @ from_linear_srgb("acescg").T
        np.testing.assert_allclose(texture, expected, atol=5e-4, err_msg=name)


@pytest.mark.parametrize("version", SPACES)
def test_the_camera_is_a_view_of_blenders_own_display(version: str, tmp_path: Path) -> None:
    """Files keep their display, which Blender calls sRGB: it shows the camera's JPEG."""
    profile = plain_profile("Canon")
    config = load_config(write_config([profile], tmp_path / "ocio", merge=own_config(version)))
    assert "Canon standard" in list(config.getViews("sRGB"))
    raw = np.random.default_rng(2).random((500, 3))
    shown = convert(config, "Canon RAW unbalanced", "sRGB", "Canon standard", OCIO.TRANSFORM_DIR_FORWARD, pixels=raw)
    np.testing.assert_allclose(shown, np.clip(profile.render("standard/daylight")(raw), 0, 1), atol=2e-3)


@pytest.mark.usefixtures("small_inverses")
@pytest.mark.parametrize("version", ["3.4", pytest.param("4.2.0", marks=pytest.mark.slow)])
def test_faults_of_the_base_are_notes(version: str, tmp_path: Path, lutforge: CommandLine) -> None:
    """Blender's False Color cannot be undone, which is no fault of the cameras."""
    base = own_config(version)
    assert check_config(load_config(base))
    plain_profile("Canon").save(tmp_path / "camera.npz")
    made = lutforge("config", "camera.npz", "-o", "ocio", "--merge", base, cwd=tmp_path)
    assert "False Color" in made.stderr
    assert all(line.startswith("note: ") for line in made.stderr.splitlines())
