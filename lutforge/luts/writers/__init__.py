"""Writers of LUT files, one file for each format. Each takes a LUT whose form has been checked."""
