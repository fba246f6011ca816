"""The lattice fit of the thesis preset. Its physical stages are in `physical/`, with `preset == "thesis"`."""
