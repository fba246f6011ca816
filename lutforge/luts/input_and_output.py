"""The input and the output of a LUT: which values it expects, and which it returns.

To apply a LUT to the wrong kind of pixels is the usual mistake, and no format has a field for the kind. The files that
LutForge writes state it in their comments.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterable
from dataclasses import dataclass

from lutforge.colour.rgb_spaces import rgb_space

ENCODED = "the camera's JPEG, encoded, 0 to 1"
ADOBE_RGB = "the camera's JPEG in Adobe RGB, encoded, 0 to 1"
CAMERA_RAW = "linear camera RAW, black 0, saturation 1, before white balance"


@dataclass(frozen=True)
class InputAndOutput:
    """Input and output of a LUT.

    Each is ENCODED, ADOBE_RGB, CAMERA_RAW, or "scene-linear" or "scene-referred" with the name of the colour space.
    """

    input: str
    output: str

    @property
    def takes_raw(self) -> bool:
        """True where the input is camera RAW before white balance."""
        return self.input.startswith(CAMERA_RAW)

    @property
    def are_linear(self) -> tuple[bool, bool]:
        """True where the input is linear, and True where the output is."""
        takes_linear, gives_linear = (
            side == CAMERA_RAW or side.startswith("scene-linear") for side in (self.input, self.output)
        )
        return takes_linear, gives_linear

    @property
    def comments(self) -> tuple[str, ...]:
        """The comment lines of a file: "KEY: VALUE" for `read_input_and_output`, and advice for people."""
        takes_linear, gives_linear = self.are_linear
        advice = ["not for JPEGs"] if takes_linear else []
        if gives_linear:
            advice.append("keep its output in half or float files, 8 bits would show bands")
        return f"input: {self.input}", f"output: {self.output}", *([f"use: {'; '.join(advice)}"] if advice else [])


def input_and_output_of(kind: str, space: str, encoded: str = ENCODED) -> InputAndOutput:
    """The input and the output of a transform. kind: "render", "linearize", or any other, from JPEG to JPEG.

    space: of the scene's values, "raw" or a name; encoded: the encoding of the input JPEG, ENCODED or ADOBE_RGB.
    """
    linear = space == "raw" or rgb_space(space).is_linear
    scene = CAMERA_RAW if space == "raw" else f"scene-{'linear' if linear else 'referred'} {space}"
    return InputAndOutput(scene if kind == "render" else encoded, scene if kind == "linearize" else ENCODED)


def read_input_and_output(comments: Iterable[str]) -> InputAndOutput | None:
    """The input and output that the comments of a LUT file state; None where they do not."""
    fields = dict(comment.split(": ", 1) for comment in comments if ": " in comment)
    return InputAndOutput(fields["input"], fields["output"]) if {"input", "output"} <= fields.keys() else None
