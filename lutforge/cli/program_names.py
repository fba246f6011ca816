"""The choices of `--for`, repeated here since the import of the tables that they name takes a second."""

LUT_PROGRAMS = (
    *("resolve", "nuke", "ocio", "oiio", "baselight", "flame", "blender", "photoshop", "lightroom", "premiere"),
    *("aftereffects", "finalcut", "ffmpeg", "mpv", "mlt", "kdenlive", "shotcut", "obs", "darktable", "rawtherapee"),
    *("art", "captureone", "gmic", "gimp", "imagemagick", "graphicsmagick", "pillow", "three", "parse-cube-lut"),
)
"""The choices of `bake --for`: the programs of `lutforge.luts.lut_programs`, in its order."""

KIT_PROGRAMS = (
    *("darktable", "rawtherapee", "blender", "lumix", "art", "lightroom", "captureone", "resolve", "nuke", "ffmpeg"),
    *("gimp", "obs"),
)
"""The choices of `kit --for`: the programs of `lutforge.kits.all_kits`, in its order."""
