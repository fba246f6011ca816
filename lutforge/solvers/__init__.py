"""Lattice regression: the least-squares fit of a nonuniform lattice to scattered data."""
