"""Run inside Blender: makes a file with textures, or reads what the scene sees of the textures of one.

make FILE.blend PICTURE SPACE…; read FILE.blend FOLDER, which gets an EXR file for each texture, in the scene's space.
"""

import sys
from pathlib import Path
from typing import Any

import bpy  # type: ignore[import-not-found]  # it exists inside Blender only


def make(file: str, picture: str, *spaces: str) -> None:
    """Save a file with the picture in each of the colour spaces."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for space in spaces:
        image = bpy.data.images.load(picture)
        image.name = space
        image.use_fake_user = True
        image.colorspace_settings.name = space
    bpy.ops.wm.save_as_mainfile(filepath=file)


def read(file: str, folder: str) -> None:
    """Send each texture through the compositor, which takes it to the scene's space."""
    bpy.ops.wm.open_mainfile(filepath=file)
    scene: Any = bpy.context.scene
    scene.use_nodes = True
    nodes, links = scene.node_tree.nodes, scene.node_tree.links
    nodes.clear()
    texture, output = nodes.new("CompositorNodeImage"), nodes.new("CompositorNodeComposite")
    links.new(texture.outputs[0], output.inputs[0])
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    for image in [image for image in bpy.data.images if image.source == "FILE"]:
        texture.image = image
        scene.render.filepath = str(Path(folder, f"{image.name}.exr"))
        bpy.ops.render.render(write_still=True)


action, *words = sys.argv[sys.argv.index("--") + 1 :]
if action == "make":
    make(*words)
else:
    read(*words)
