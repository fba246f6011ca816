"""The camera as one lattice per direction: targets, node levels, smoothness, fit (thesis, chapter 5, and beyond)."""
