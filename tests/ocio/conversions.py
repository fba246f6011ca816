"""Run by the Python of another OpenColorIO: converts the colours of a JSON file by a config, and prints them as JSON.

CONFIG COLOURS.json; the file holds colours, and ways: pairs of spaces, a look in its space, or a display and view.
"""

import json
import sys
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

config = OCIO.Config.CreateFromFile(sys.argv[1])
config.validate()  # without NumPy, which the distribution's need not have
asked = json.loads(Path(sys.argv[2]).read_text())
converted = []
for kind, *names in asked["ways"]:
    if kind == "spaces":
        transform = OCIO.ColorSpaceTransform(src=names[0], dst=names[1])
    elif kind == "look":
        transform = OCIO.LookTransform(src=names[0], dst=names[0], looks=names[1])
    else:
        transform = OCIO.DisplayViewTransform(src=names[0], display=names[1], view=names[2])
    converted.append(config.getProcessor(transform).getDefaultCPUProcessor().applyRGB(asked["colours"]))
paths = [config.getColorSpaceFromFilepath(path)[0] for path in asked["paths"]]
json.dump({"version": OCIO.__version__, "converted": converted, "paths": paths}, sys.stdout)
