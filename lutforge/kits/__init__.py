"""Kits, one module per program: what it feeds to a LUT, and the files that make it show the camera's look."""
