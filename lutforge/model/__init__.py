"""What a calibrated camera is: its evaluation and its files. The fits are in lutforge.calibration."""
