"""The calibration interface in the browser (thesis, appendix A): optional, needs `lutforge[studio]`."""
