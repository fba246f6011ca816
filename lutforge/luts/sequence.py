"""A LUT: a sequence of operations, which is read, written, applied and printed as such."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass
from pathlib import Path

from lutforge.luts import formats
from lutforge.luts.op_sequence import OpSequence


@dataclass(frozen=True, eq=False, repr=False)
class Lut(OpSequence):
    """Operations in the order in which they are applied, and the title and comments of their file.

    title, comments: for people; formats keep what they can of them. metadata: what is known of the file that it was
    read from, and what a writer is to state. Raises LutError where there is no operation.
    """

    def write(self, path: str | Path) -> Path:
        """Write the sequence to a file, atomically and exactly, in the format that the suffix names; return the path.

        Nothing is fitted or sampled here. Raises LutError, with the form that the file needs, where its format cannot
        hold the sequence; `lutforge.bake(transform, path)` bakes to the form of a file.
        """
        return formats.write(self, Path(path))
