"""OpenColorIO configs that contain calibrated cameras."""
