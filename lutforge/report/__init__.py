"""Plots and tables of what was calibrated."""
