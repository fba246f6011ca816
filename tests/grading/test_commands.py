"""The printed oiiotool lines run as they are, in every oiiotool that is there, and give the pixels of apply."""

import os
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.grading.batch import apply_batch, plan_jobs
from lutforge.grading.grade import ConfigRecipe, Grade, LutRecipe, Recipe, ViewRecipe
from lutforge.grading.inputs import Failure
from lutforge.grading.oiiotool_commands import oiiotool_commands
from lutforge.images.read import read_image
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut
from tests.cases.other_versions import oiiotool
from tests.cases.pictures import write_cube, write_picture
from tests.cases.profiles import plain_profile
from tests.conftest import CommandLine, Refused

OIIOTOOLS = ("2.4", "3.0.3.1", "")
"""The distribution's, an older one of a wheel, and the one beside this Python."""


@dataclass(frozen=True)
class BakedRecipe(Recipe):
    """Gives a LUT that is in no file, as a profile does."""

    @cached_property
    def _lut(self) -> Lut:
        axis = np.linspace(0, 1, 5)
        cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1) ** 1.9
        return Lut((Cube(cube),))

    def grade(self, source: Path) -> Grade:
        return Grade(
            processor=self._lut.processor(), history="baked", attributes={"Artist": "it's {me}"}, lut=self._lut
        )


def small_config() -> OCIO.Config:
    """A space, and a display on which it is seen through a view."""
    config = OCIO.Config.CreateRaw()
    config.setVersion(2, 1)
    for name, own in (("log look", 0.5), ("shown", 0.75), ("scene", 1.0)):
        mixed = np.eye(4)
        mixed[:3, :3] = own * np.eye(3) + (1 - own) / 3
        config.addColorSpace(OCIO.ColorSpace(name=name, toReference=OCIO.MatrixTransform(mixed.ravel().tolist())))
    config.addDisplayView("a screen", "a view", "shown", "")
    return config


def recipe_of(kind: str, folder: Path) -> Recipe:
    """A recipe whose files are named relative to the folder that this process is in."""
    write_cube(folder / "a look's {1}.cube")
    (folder / "config.ocio").write_text(small_config().serialize())
    recipes = {
        "LUT": LutRecipe(Path("a look's {1}.cube")),
        "baked": BakedRecipe(),
        "spaces": ConfigRecipe(Path("config.ocio"), "log look", "scene"),
        "view": ViewRecipe(Path("config.ocio"), "log look", "a view", "a screen"),
    }
    return recipes[kind]


@pytest.mark.parametrize(
    "version", [*(pytest.param(version, marks=pytest.mark.slow) for version in OIIOTOOLS[:-1]), OIIOTOOLS[-1]]
)
@pytest.mark.parametrize(
    ("kind", "with_config"),
    [
        ("LUT", False),
        ("LUT", True),  # a config that OCIO names looks for LUTs in its own folder
        ("baked", True),
        ("spaces", False),
        ("view", True),
        *(
            pytest.param(*pair, marks=pytest.mark.slow)
            for pair in (("baked", False), ("spaces", True), ("view", False))
        ),
    ],
)
def test_the_lines_give_the_pixels_of_apply(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, with_config: bool, version: str
) -> None:
    """From another folder than that in which they were printed, and where OCIO names a config of a studio."""
    tool = oiiotool(version)
    monkeypatch.chdir(tmp_path)
    recipe = recipe_of(kind, tmp_path)
    (tmp_path / "in").mkdir()
    sources = [Path("in", name) for name in ("it's #1 {a}.png", "b.exr", "c.tif", "d.jpg", "%04d.png")]
    write_picture(sources[0], (60, 80), "uint16", channels=4, oiio_UnassociatedAlpha=1)
    write_picture(sources[1], (60, 80), "half", 16, channels=4)
    write_picture(sources[2], (60, 80), "uint8", Orientation=6)
    ramps = np.stack(np.meshgrid(np.linspace(0.1, 0.9, 80), np.linspace(0.2, 0.8, 64)), -1)
    smooth = np.concatenate([ramps, ramps[..., :1]], -1).astype(np.float32)  # decoders of JPEG differ beside edges
    write_picture(sources[3], pixels=smooth)
    write_picture(sources[4], (60, 80))
    here = apply_batch(recipe, sources, tmp_path / "here")
    assert not here.failed
    lines = list(oiiotool_commands(recipe, plan_jobs(sources, Path("farm")), Path("farm", "luts")))
    assert all(isinstance(line, str) for line in lines), lines

    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    studio = elsewhere / "studio.ocio"
    studio.write_text(OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1").serialize())
    environment = {name: value for name, value in os.environ.items() if name != "OCIO"}
    environment |= {"PATH": f"{tool.parent}:{os.environ['PATH']}"} | ({"OCIO": str(studio)} if with_config else {})
    script = "set -e\n" + "\n".join(map(str, lines))
    ran = subprocess.run(
        ["bash", "-c", script], env=environment, cwd=elsewhere, timeout=100, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    for done in here.done:
        mine, theirs = read_image(done.target), read_image(tmp_path / "farm" / done.target.name)
        assert theirs.spec.format == mine.spec.format
        assert theirs.spec.get_string_attribute("Software") == "LutForge"
        assert theirs.spec.channelnames == mine.spec.channelnames
        step = {"uint8": 1 / 255, "uint16": 1 / 65535, "half": 1e-3}[str(mine.spec.format)]
        difference = np.abs(mine.pixels - theirs.pixels)
        if done.target.suffix == ".jpg":  # a coefficient that is rounded the other way changes a block by some codes
            assert difference.max() <= 4.5 * step
            assert difference.mean() <= 0.25 * step
            continue
        assert difference.max() <= 1.01 * step, done.target
        # A value between two codes is rounded to either, where it differs by some units of the last place of a float.
        assert (difference > 0.01 * step).mean() < max(0.01, 8 * 2.0**-23 / step), done.target
    luts = list((tmp_path / "farm" / "luts").glob("*.clf")) if kind == "baked" else []
    assert len(luts) == (kind == "baked")


def test_what_oiiotool_cannot_do_is_said(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.png")
    jobs = plan_jobs([tmp_path / "a.png"], tmp_path / "out")
    (line,) = oiiotool_commands(LutRecipe(write_cube(tmp_path / "l$HOME.cube")), jobs, tmp_path)
    assert isinstance(line, Failure)
    assert "variables" in line.reason


def test_apply_through_a_view_of_a_config(tmp_path: Path, lutforge: CommandLine, refused: Refused) -> None:
    """The view's pixels, its name whatever its case, on the first display without another; else one line."""
    config = small_config()
    (tmp_path / "config.ocio").write_text(config.serialize())
    pixels = write_picture(tmp_path / "a.exr", kind="float")
    command = ("apply", "config.ocio", "a.exr", "--from", "log look", "-o", "seen")
    lutforge(*command, "--view", "A View", "--display", "a screen", cwd=tmp_path)
    expected = pixels.copy()
    forward = OCIO.TRANSFORM_DIR_FORWARD
    config.getProcessor("log look", "a screen", "a view", forward).getDefaultCPUProcessor().applyRGB(expected)
    np.testing.assert_allclose(read_image(tmp_path / "seen" / "a.exr").pixels, expected, atol=1e-6)
    lutforge("apply", "config.ocio", "a.exr", "--from", "scene", "--view", "Raw", "-o", "first", cwd=tmp_path)
    np.testing.assert_array_equal(read_image(tmp_path / "first" / "a.exr").pixels, pixels)

    plain_profile("X").save(tmp_path / "camera.npz")
    for says, *words in (
        ("known: a view", "--view", "film", "--display", "a screen"),
        ("known: sRGB, a screen", "--view", "a view", "--display", "television"),
        ("goes without --to", "--view", "a view", "--to", "scene"),
        ("goes with --view", "--display", "a screen", "--to", "scene"),
    ):
        assert says in refused(tmp_path, *command, *words)
    assert "--from" in refused(tmp_path, "apply", "config.ocio", "a.exr", "--view", "Raw", "-o", "seen")
    assert "with a config" in refused(tmp_path, "apply", "camera.npz", "a.exr", "--view", "Raw", "-o", "seen")
