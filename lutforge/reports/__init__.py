"""Reports on calibrated cameras: figures, tables and pages."""

import logging

# Without a home folder for its caches, matplotlib would log warnings.
logging.getLogger("matplotlib").setLevel(logging.ERROR)
