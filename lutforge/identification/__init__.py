"""Which camera, picture style and white balance rendered a picture that does not tell (thesis, 7.2)."""
