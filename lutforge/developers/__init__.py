"""Programs that develop RAW files, run without a window: their neutral picture is what they feed to a LUT."""
