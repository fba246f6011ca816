"""Calibrated cameras: their models, the evaluation of these, and their files. The fits are in lutforge.calibration."""
