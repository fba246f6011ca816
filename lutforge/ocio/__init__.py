"""OpenColorIO configs that carry a calibrated camera."""
