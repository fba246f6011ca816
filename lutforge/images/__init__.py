"""Pixels in and out: image files through OpenImageIO, RAW files through rawpy."""
