"""The thesis as it was published, in a room of its own: its stages, its gamut map, its lattices, its tables."""
