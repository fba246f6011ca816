"""Colour spaces, differences and temperatures, over colour-science."""
