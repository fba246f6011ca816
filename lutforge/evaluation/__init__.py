"""The evaluation of a calibration: held-out errors, tables, baselines, colours to photograph next."""
