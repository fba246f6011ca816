"""A physically based camera of known truth, that writes real DNG and JPEG files."""
