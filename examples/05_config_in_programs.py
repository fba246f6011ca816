"""A config of ocio_configs/ as programs use it: oiiotool, ocioconvert, OpenColorIO's display processor, Blender.

    python examples/05_config_in_programs.py OUTPUT_FOLDER

Programs that are not installed are left out, and said to be.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_05").absolute()
folder.mkdir(parents=True, exist_ok=True)
path = Path(__file__).parents[1] / "ocio_configs" / "nikon_d40" / "config.ocio"
config = OCIO.Config.CreateFromFile(str(path))

photo = folder / "photo.tif"
pixels = np.random.default_rng(1).uniform(0.05, 0.95, (32, 48, 3)).astype(np.float32)
oiio.ImageBuf(pixels).write(str(photo), oiio.UINT16)
taken, wanted = "Nikon D40 JPEG standard tungsten", "Nikon D40 JPEG standard daylight"


def mean(name: str) -> float:
    """Of all values of an image."""
    return float(np.mean(np.asarray(oiio.ImageBuf(str(folder / name)).get_pixels(oiio.FLOAT))))


def program(name: str) -> str | None:
    """Where a program is, beside this Python or on the path; says so where it is not."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    if not found:
        print(f"{name}: not installed, left out")
    return found


def oiiotool(output: str, *actions: str) -> None:
    """oiiotool on the photograph, whose colour space it is told."""
    if tool := program("oiiotool"):
        command = [tool, "--colorconfig", str(path), str(photo), "--iscolorspace", taken, *actions]
        subprocess.run([*command, "-d", "float", "-o", str(folder / output)], check=True)
        print(f"oiiotool {actions[0]}: {output}, mean {mean(output):.4f}")


oiiotool("linear.exr", "--colorconvert", taken, "ACEScg")
oiiotool("daylight.tif", "--ociolook", "Nikon D40 scene tungsten → daylight")
oiiotool("refinish.tif", "--colorconvert", taken, wanted)
oiiotool("p3.tif", "--ociodisplay", "Display P3 - Display", "Nikon D40 standard")
oiiotool("lut.tif", "--ociofiletransform", str(path.parent / "luts" / "nikon_d40_standard_linearize.clf"))

if tool := program("ocioconvert"):  # the one of the Python package takes EXR files only, of any encoding
    oiio.ImageBuf(pixels).write(str(folder / "encoded.exr"), oiio.FLOAT)
    output = str(folder / "ocioconvert.exr")
    command = [tool, "--iconfig", str(path), str(folder / "encoded.exr"), taken, output, "ACEScg"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    print("ocioconvert: ocioconvert.exr, mean", f"{mean('ocioconvert.exr'):.4f}")

# What ociodisplay and every viewer build: any scene-linear footage seen through the camera.
viewed = np.full((1, 3), 0.18, dtype=np.float32)
transform = OCIO.DisplayViewTransform(src="ACEScg", display="sRGB - Display", view="Nikon D40 standard")
config.getProcessor(transform).getDefaultCPUProcessor().applyRGB(viewed)
print("scene-linear grey 0.18 through the camera:", np.round(viewed[0], 3))

# Blender reads the config that OCIO names; here it shows a scene-linear plane through the camera.
BLENDER = f"""
import bpy
scene = bpy.context.scene
scene.display_settings.display_device = "sRGB - Display"
scene.view_settings.view_transform = "Nikon D40 standard"
image = bpy.data.images.new("grey", 8, 8, float_buffer=True)
image.pixels[:] = [0.18, 0.18, 0.18, 1.0] * 64
image.file_format = "PNG"
scene.render.image_settings.file_format = "PNG"
image.save_render({str(folder / "blender.png")!r}, scene=scene)
"""
if tool := program("blender"):
    command = [tool, "--background", "--factory-startup", "--python-exit-code", "1", "--python-expr", BLENDER]
    run = subprocess.run(
        command, env=os.environ | {"OCIO": str(path)}, capture_output=True, text=True, timeout=120, check=False
    )
    if run.returncode:
        sys.exit(f"blender: {run.stderr[-500:]}")
    print("Blender: the same grey", np.round(oiio.ImageBuf(str(folder / "blender.png")).getpixel(4, 4)[:3], 3))
