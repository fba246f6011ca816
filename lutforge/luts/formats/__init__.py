"""LUT file formats, one module each: it says which sequences of operations a file can hold, and writes them.

To add one, write a module here with `write` and a registered `FileFormat`: every module of this folder is
loaded.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
