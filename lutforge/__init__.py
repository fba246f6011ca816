"""LutForge: calibrate a camera from its RAW and JPEG files, and bake its rendering into LUTs and OCIO configs."""

__version__ = "0.1.0"
