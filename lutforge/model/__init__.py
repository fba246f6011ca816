"""What a calibrated camera is: evaluation only; the fits are in lutforge.calibration."""
