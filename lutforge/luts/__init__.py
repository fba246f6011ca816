"""A baked transform: a 1D shaper per axis in front of a uniform cube, and the files that hold it."""
