"""The grading of images by LUTs, camera profiles and OpenColorIO configs, one by one or as a batch."""
