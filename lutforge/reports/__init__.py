"""Plots and tables of what was calibrated."""

import logging

# Where there is no home to keep its caches in, matplotlib says so in lines of its own.
logging.getLogger("matplotlib").setLevel(logging.ERROR)
