"""The use cases, one file for each step on the way of the data: each reads, does its work, and returns a record.

shots → samples → calibration → camera profile → transform → baked LUT → OpenColorIO config → graded images

All rules about options live here; the command line and the studio parse words, call these functions, and draw.
"""
