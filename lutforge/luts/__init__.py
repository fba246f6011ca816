"""LUTs: sequences of operations, the files that hold them, and the fit of a transform to them."""

import lutforge.luts.formats  # noqa: F401 - makes the formats known to `Lut.write` and `read_lut`
