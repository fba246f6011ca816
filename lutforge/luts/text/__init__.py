"""Checks of the text of LUT files before a reader gets it: encoding, numbers, number of rows, dialect."""
