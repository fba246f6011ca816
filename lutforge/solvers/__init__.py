"""Numerical solvers: lattice regression with its multigrid, constrained and robust least squares, Gauss-Newton."""
