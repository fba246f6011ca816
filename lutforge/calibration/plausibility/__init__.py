"""Checks whether a camera can have made a set of samples; each names a likely cause where it cannot (one file each)."""
