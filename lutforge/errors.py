"""Every exception that LutForge raises on purpose, in one tree.

The message is one line for the person who caused it: what is wrong, where (path, line, row), what to do.
The command line prints it and exits with status 2.
"""


class LutForgeError(Exception):
    """The root: catch this to catch everything that LutForge raises on purpose."""


class SettingsError(LutForgeError):
    """A style, white balance or exposure selector that cannot be understood, or that the profile does not know."""


class ImageError(LutForgeError):
    """An image or RAW file that cannot be read or written."""


class ShotError(LutForgeError):
    """A RAW file that is not usable as a RAW/JPEG pair."""


class SampleError(LutForgeError):
    """A sample table that is malformed, or holds values that no camera can produce."""


class CalibrationError(LutForgeError):
    """Samples from which the wanted model cannot be fitted."""


class ProfileError(LutForgeError):
    """A camera profile that cannot be read, or does not hold what is asked of it."""


class LutError(LutForgeError):
    """A LUT that cannot be baked, written or read."""


class ConfigError(LutForgeError):
    """An OpenColorIO config that cannot be built or read."""
