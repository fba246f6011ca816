"""Numerical solvers: lattice regression, constrained and robust least squares, Gauss–Newton."""
