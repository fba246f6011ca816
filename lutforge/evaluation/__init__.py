"""How good a calibration is: held-out errors, tables, baselines, next shots."""
