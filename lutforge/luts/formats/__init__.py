"""LUT file formats: each says which sequences of operations a file can hold, and writes them."""

from lutforge.luts.formats import clf, hald, text
from lutforge.luts.sequence import FORMATS

for _known in (clf.CLF, text.CSP, text.CUBE, hald.HALD, text.SPI, text.THREEDL, text.VLT):
    FORMATS.update(dict.fromkeys(_known.suffixes, _known))
