"""The camera as physical stages: response, matrix, white balance, gamut map (thesis, chapters 3 and 4)."""
