"""One file per LUT format or dialect."""
