"""What all figures share: channel colours that do not rest on hue alone, colour scales, and how a figure is saved."""

from io import StringIO
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from lutforge.atomic_write import atomic_path

CHANNELS = (("R", "#c23b22", "-"), ("G", "#2e8b57", "--"), ("B", "#2f5fb3", ":"))
"""Name, colour and line style: the line style tells the channels apart where the colours do not."""
MAP = "cividis"
"""The colour scale of maps: even in lightness, the same to colour-blind eyes."""
ERROR_SCALE = 0.1
"""The error that is drawn brightest, as a norm of RGB, 1 = full scale."""


def save_png(figure: Figure, path: str | Path, dpi: float = 100) -> None:
    """Write a figure as PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")


def to_svg(figure: Figure) -> str:
    """A figure as an <svg> element, without an XML head, the same bytes each time."""
    # Text stays text, and ids are made from the content alone.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "lutforge"}), StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=144)
        text = buffer.getvalue()
    return text[text.index("<svg") :]
