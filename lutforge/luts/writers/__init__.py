"""Writers of LUT files, a format a file. Each takes a LUT whose form has been checked."""
