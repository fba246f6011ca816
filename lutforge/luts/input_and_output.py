"""What goes into a LUT and what comes out.

A LUT on the wrong pixels is the usual mistake, and no format has a word for it. The files that LutForge writes say it
in their comments.
"""

import re
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

from lutforge.colour.rgb_spaces import rgb_space

ENCODED = "the camera's JPEG, encoded, 0 to 1"
RAW = "linear camera RAW, black 0, saturation 1, before white balance"


@dataclass(frozen=True)
class InputAndOutput:
    """Input and output of a LUT in words: ENCODED, RAW, or scene-linear or scene-referred and the space's name.

    title: what else its file says at its beginning, its title among it.
    """

    input: str
    output: str
    title: str = field(default="", compare=False)

    @property
    def takes_linear(self) -> bool:
        """True where the input is linear light."""
        return _is_linear(self.input)

    @property
    def gives_linear(self) -> bool:
        """True where the output is linear light."""
        return _is_linear(self.output)

    @property
    def comments(self) -> tuple[str, str]:
        """The two comment lines of a file, for people and for `read_input_and_output`."""
        taken = f"{self.input}; not for JPEGs" if self.takes_linear else self.input
        given = (
            f"{self.output}; keep it in half or float files, 8 bits would show bands"
            if self.gives_linear
            else self.output
        )
        return f"input: {taken}", f"output: {given}"


def _is_linear(end: str) -> bool:
    return end == RAW or end.startswith("scene-linear")


def input_and_output_of(kind: str, space: str) -> InputAndOutput:
    """Name input and output of a render, linearize, refinish or match; space: of the scene's side, "raw" or a name."""
    linear = space == "raw" or rgb_space(space).is_linear
    scene = RAW if space == "raw" else f"scene-{'linear' if linear else 'referred'} {space}"
    return InputAndOutput(scene if kind == "render" else ENCODED, scene if kind == "linearize" else ENCODED)


def read_input_and_output(path: Path) -> InputAndOutput | None:
    """What a LUT file says of itself; None where it does not, or is not there."""
    try:
        with path.open("rb") as file:
            head = file.read(1 << 14).decode("utf-8", "replace")  # comments stand at the beginning
    except OSError:
        return None
    found = [re.search(rf"\b{end}: ([^;\n<]+)", unescape(head)) for end in ("input", "output")]
    if "LutForge" not in head or found[0] is None or found[1] is None:
        return None
    return InputAndOutput(found[0][1].strip(), found[1][1].strip(), head.partition(found[0][0])[0])
