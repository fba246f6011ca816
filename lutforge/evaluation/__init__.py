"""How good a calibration is: held-out errors, tables, baselines, learning curves, next shots."""
