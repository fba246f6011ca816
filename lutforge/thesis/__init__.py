"""The method of the thesis, in a room of its own: its stages, its gamut map, its lattices, its tables."""
