"""Kits: for each program, the files that make it show the camera's look, and the steps that its user follows."""
