"""Is this what a camera makes? Causes that spoil a whole set of samples, told by name (one file each)."""
