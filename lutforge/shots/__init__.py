"""A shot: one RAW file and the JPEG that the camera rendered from it, brought to the same framing."""
