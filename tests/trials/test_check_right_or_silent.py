"""What `check` says of LUT files is what their readers do, by trial."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import PIL.Image
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.arrays import Array
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels

NODES = grid(uniform_levels(17))


def through_ffmpeg(path: Path) -> tuple[Array, Array] | None:
    """8-bit colours in [0, 1] and what ffmpeg makes of them; None where it refuses the file."""
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    codes = np.random.default_rng(0).integers(0, 256, (1, 2000, 3), dtype=np.uint8)
    PIL.Image.fromarray(codes).save(path.with_name("in.png"))
    command = ["ffmpeg", "-v", "error", "-y", "-i", "in.png", "-vf"]
    command += [f"format=gbrp,lut3d={path.name}:interp=tetrahedral", "-pix_fmt", "rgb24", "out.png"]
    if subprocess.run(command, cwd=path.parent, capture_output=True, check=False).returncode != 0:
        return None
    return codes[0] / 255.0, np.asarray(PIL.Image.open(path.with_name("out.png")))[0] / 255.0


@pytest.mark.parametrize("knots", [np.linspace(0, 1, 64), np.array([0, 0.05, 0.2, 0.5, 1]), np.linspace(0, 1, 8192)])
def test_bent_preluts_in_ffmpeg(knots: Array, tmp_path: Path) -> None:
    curve = Curve((knots**0.45)[:, None].repeat(3, 1), inputs=knots[:, None].repeat(3, 1))
    lut = Lut((curve, Cube(NODES)))
    path = lut.write(tmp_path / "a.csp")
    tried = through_ffmpeg(path)
    assert tried is not None
    off = 255 * np.abs(tried[1] - lut(tried[0])).max()
    said = check_lut(path).readers["ffmpeg"]
    assert said != "reads it" or off < 5, (said, off)


@pytest.mark.parametrize(("format", "size"), [("flame", 17), ("flame", 33), ("lustre", 17), ("lustre", 33)])
def test_baked_3dl_files_in_ffmpeg(format: str, size: int, tmp_path: Path) -> None:
    config = OCIO.Config.CreateRaw()
    for name, transform in (("in", OCIO.MatrixTransform()), ("out", OCIO.ExponentTransform(value=[0.5, 0.5, 0.5, 1]))):
        config.addColorSpace(OCIO.ColorSpace(name=name, fromReference=transform))
    baker = OCIO.Baker()
    baker.setConfig(config)
    baker.setInputSpace("in")
    baker.setTargetSpace("out")
    baker.setFormat(format)
    baker.setCubeSize(size)
    path = tmp_path / "a.3dl"
    path.write_text(baker.bake())
    tried = through_ffmpeg(path)
    right = tried is not None and 255 * np.abs(tried[1] - read_lut(path)(tried[0])).max() < 2
    assert (check_lut(path).readers["ffmpeg"] == "reads it") == right


def test_a_cube_with_red_and_blue_exchanged(tmp_path: Path) -> None:
    path = Lut((Cube(np.ascontiguousarray(NODES[..., ::-1])),)).write(tmp_path / "a.cube")
    assert any("channels are exchanged" in text for text in check_lut(path).problems)


def test_wide_outputs_have_no_limits(tmp_path: Path) -> None:
    lines = report_lines(check_lut(Lut((Cube(NODES * 2042 - 2030),)).write(tmp_path / "a.cube")))
    assert not any("at a limit" in line for line in lines)
