"""Make the pictures of the guide's pages on programs, by the programs themselves.

    python examples/pictures/make_developer_pictures.py FOLDER

FOLDER holds CRW_0101, 0104, 0112, 0117 and 0118.CRW of a Canon PowerShot S40, which are public (CC0,
https://github.com/thorsted/digicam_corpus). darktable, RawTherapee, Blender, ffmpeg and G'MIC are run as installed:
what each makes by itself, what it makes with a kit from the other four photographs, and the camera's JPEG.
"""

import io
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lutforge.images.raw import read_raw
from lutforge.images.read import read_image
from lutforge.kits.darktable import NEUTRAL_SETTINGS
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.kit_checks import compare_with_jpeg
from lutforge.pipeline.kits import write_kit
from lutforge.pipeline.sampling import gather_samples

HERE = Path(__file__).parent
SETTING = "standard/auto"
NAME = "Canon PowerShot S40 standard"

SCENE = """
import bpy
bpy.ops.object.select_all(action='SELECT')
bpy.ops.object.delete()
bpy.ops.mesh.primitive_plane_add(size=40)
colours = [(.6, .04, .03), (.7, .3, .02), (.75, .6, .03), (.05, .35, .06), (.03, .08, .5), (.35, .04, .35)]
for number, colour in enumerate(colours):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=.8, location=(2 * (number % 3) - 2, 2 * (number // 3) - 1, .8))
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new(str(number))
    material.use_nodes = True
    material.node_tree.nodes['Principled BSDF'].inputs['Base Color'].default_value = (*colour, 1)
    bpy.context.object.data.materials.append(material)
bpy.ops.object.light_add(type='SUN', rotation=(.6, .3, 0))
bpy.context.object.data.energy = 2
bpy.ops.object.camera_add(location=(0, -7, 6.2), rotation=(.82, 0, 0))
scene = bpy.context.scene
scene.camera = bpy.context.object
scene.world.node_tree.nodes['Background'].inputs[0].default_value = (.25, .25, .25, 1)
scene.render.engine = 'CYCLES'
scene.cycles.samples = 48
scene.cycles.use_denoising = False
scene.render.resolution_x, scene.render.resolution_y = 400, 300
if VIEW:
    scene.view_settings.view_transform = VIEW
scene.render.filepath = OUTPUT
bpy.ops.render.render(write_still=True)
"""


def picture(pixels: NDArray[np.floating]) -> Image.Image:
    """Encoded pixels (height, width, 3) as a panel."""
    codes = np.rint(255 * np.clip(pixels[..., :3], 0.0, 1.0)).astype(np.uint8)
    return Image.fromarray(codes).resize((400, 300), Image.Resampling.LANCZOS)


def strip(name: str, *panels: Image.Image) -> None:
    """Write panels side by side, with a white gap between them."""
    whole = Image.new("RGB", (408 * len(panels) - 8, 300), "white")
    for number, panel in enumerate(panels):
        whole.paste(panel, (408 * number, 0))
    whole.save(HERE / f"{name}.jpg", quality=90)


def run(*command: object, **more: str) -> None:
    """Run a program; stop where it fails."""
    subprocess.run([str(word) for word in command], check=True, capture_output=True, env={**os.environ, **more})


def main() -> None:
    """Make the pictures, and print how far each is from the camera's JPEG."""
    place = Path(sys.argv[1])
    raw = place / "CRW_0117.CRW"
    others = [place / f"CRW_{number}.CRW" for number in ("0101", "0104", "0112", "0118")]
    preview = read_raw(raw).preview
    assert preview is not None
    jpeg = Image.open(io.BytesIO(preview)).resize((400, 300), Image.Resampling.LANCZOS)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        own = ("--core", "--configdir", work / "config", "--library", ":memory:")
        run("darktable-cli", raw, work / "darktable.tif", "--icc-type", "SRGB", *own)
        settings = {"RT_SETTINGS": str(work / "settings")}
        run("rawtherapee-cli", "-o", work / "rawtherapee.tif", "-d", "-t", "-b16", "-Y", "-c", raw, **settings)
        profile = calibrate(gather_samples(others).samples)
        for program in ("darktable", "rawtherapee"):
            kit = write_kit(profile, SETTING, work / f"{program}-kit", program)
            run(kit / "develop.sh", raw, work / f"{program}-kit.tif")
            shown = [work / f"{program}.tif", work / f"{program}-kit.tif"]
            print(program, *(f"{compare_with_jpeg(raw, path).mean:.2f}" for path in shown))
            strip(program, *(picture(read_image(path).pixels) for path in shown), jpeg)

        neutral_settings = [word for key, value in NEUTRAL_SETTINGS.items() for word in ("--conf", f"{key}={value}")]
        run("darktable-cli", raw, work / "neutral.tif", "--icc-type", "SRGB", *own, *neutral_settings)
        neutral = picture(read_image(work / "neutral.tif").pixels)
        neutral.save(work / "IN.png")
        for program, command in (
            ("ffmpeg", "ffmpeg -y -i {0}/IN.png -vf lut3d=file='{1}':interp=tetrahedral {0}/OUT.png"),
            ("gimp", "gmic {0}/IN.png input_cube '{1}' map_clut[0] [1] keep[0] output {0}/OUT.png"),
        ):
            kit = write_kit(profile, SETTING, work / f"{program}-kit", program)
            (cube,) = kit.glob("*.cube")
            run(*shlex.split(command.format(work, cube)))
            strip(program, neutral, picture(read_image(work / "OUT.png").pixels))

        kit = write_kit(profile, SETTING, work / "blender-kit", "blender")
        for view, blender in (("", "blender"), (NAME, str(kit / "blender.sh"))):
            output = work / f"scene{len(view)}.png"
            script = SCENE.replace("VIEW", repr(view)).replace("OUTPUT", repr(str(output)))
            run(blender, "--background", "--factory-startup", "--python-expr", script, HOME=str(work))
        strip("blender", *(picture(read_image(work / f"scene{len(view)}.png").pixels) for view in ("", NAME)))


if __name__ == "__main__":
    main()
