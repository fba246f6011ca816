"""LUTs: sequences of operations, the files that hold them, and the fit of a transform to them."""
