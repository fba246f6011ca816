"""The presets exactly as the thesis states them, where they differ from the default."""
