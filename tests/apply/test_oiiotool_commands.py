"""The printed oiiotool lines run as they are, and give the pixels of apply."""

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.apply.batch import apply_batch, plan_jobs
from lutforge.apply.grade import ConfigRecipe, Grade, LutRecipe, Recipe
from lutforge.apply.inputs import Failure, Input
from lutforge.apply.oiiotool_commands import oiiotool_commands
from lutforge.images.read import read_image
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut
from tests.cases.pictures import write_cube, write_picture


@dataclass(frozen=True)
class BakedRecipe(Recipe):
    """Gives a LUT that is in no file, as a profile does."""

    @cached_property
    def _lut(self) -> Lut:
        axis = np.linspace(0, 1, 5)
        cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1) ** 2
        return Lut((Cube(cube),))

    def grade(self, source: Path) -> Grade:
        return Grade(self._lut.processor(), "baked", {"Artist": "it's {me}"}, lut=self._lut)


def recipe_of(kind: str, folder: Path) -> Recipe:
    cube = write_cube(folder / "a look's {1}.cube")
    if kind == "LUT":
        return LutRecipe(cube)
    if kind == "baked":
        return BakedRecipe()
    config = OCIO.Config.CreateRaw()
    space = OCIO.ColorSpace(name="log look")
    space.setTransform(OCIO.ExponentTransform([2.0, 2.0, 2.0, 1.0]), OCIO.COLORSPACE_DIR_TO_REFERENCE)
    config.addColorSpace(space)
    (folder / "config.ocio").write_text(config.serialize())
    return ConfigRecipe(folder / "config.ocio", "log look", config.getColorSpaceNames()[0])


@pytest.mark.parametrize("kind", ["LUT", "baked", "config"])
def test_the_lines_give_the_pixels_of_apply(tmp_path: Path, kind: str) -> None:
    recipe = recipe_of(kind, tmp_path)
    (tmp_path / "in").mkdir()
    sources = [tmp_path / "in" / name for name in ("it's #1 {a}.png", "b.exr", "c.tif", "d.jpg", "%04d.png")]
    write_picture(sources[0], (60, 80), "uint16", channels=4, oiio_UnassociatedAlpha=1)
    write_picture(sources[1], (60, 80), "half", 16, channels=4)
    write_picture(sources[2], (60, 80), "uint8", Orientation=6)
    write_picture(sources[3], (60, 80))
    write_picture(sources[4], (60, 80))
    inputs = [Input(source, Path(source.name)) for source in sources]
    here = apply_batch(recipe, inputs, tmp_path / "here")
    assert not here.failed
    lines = list(oiiotool_commands(recipe, plan_jobs(inputs, tmp_path / "farm"), tmp_path / "farm" / "luts"))
    assert all(isinstance(line, str) for line in lines), lines
    program = Path(sys.executable).with_name("oiiotool")
    assert program.exists()
    environment = os.environ | {"PATH": f"{program.parent}:{os.environ['PATH']}"}
    script = "set -e\n" + "\n".join(map(str, lines))
    subprocess.run(["bash", "-c", script], check=True, env=environment, timeout=100)
    for done in here.done:
        mine, theirs = read_image(done.target), read_image(tmp_path / "farm" / done.target.name)
        assert theirs.spec.format == mine.spec.format
        assert theirs.spec.channelnames == mine.spec.channelnames
        step = {"uint8": 1 / 255, "uint16": 1 / 65535, "half": 1e-3}[str(mine.spec.format)]
        difference = np.abs(mine.pixels - theirs.pixels)
        assert difference.max() <= (2.5 if done.target.suffix == ".jpg" else 1.01) * step, done.target
        assert (difference > 0.01 * step).mean() < 0.01, done.target  # of the rounding of a value between two codes
        assert theirs.spec.get_string_attribute("Software") == "LutForge"
    luts = list((tmp_path / "farm" / "luts").glob("*.clf")) if kind == "baked" else []
    assert len(luts) == (kind == "baked")


def test_what_oiiotool_cannot_do_is_said(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.png")
    jobs = plan_jobs([Input(tmp_path / "a.png", Path("a.png"))], tmp_path / "out")
    for recipe, says in (
        (LutRecipe(write_cube(tmp_path / "l.cube"), "trilinear"), "no such interpolation"),
        (LutRecipe(write_cube(tmp_path / "l$HOME.cube")), "variables"),
    ):
        (line,) = oiiotool_commands(recipe, jobs, tmp_path)
        assert isinstance(line, Failure)
        assert says in line.reason
