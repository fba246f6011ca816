"""The files of a bake with their errors, and the notes on them for the user."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.luts.formats import format_of
from lutforge.luts.sequence import Lut
from lutforge.luts.verification import FileError
from lutforge.model.transform import Purpose
from lutforge.pipeline.bake_plan import Plan


@dataclass(frozen=True)
class BakedFile:
    """A file that was written. summary: its operations; error: of its colours, against the model."""

    path: Path
    summary: str
    error: FileError

    def __str__(self) -> str:
        return f"{self.path}: {self.summary}\n  read back, against the model: {self.error}"


@dataclass(frozen=True, eq=False, repr=False)
class BakedLut(Lut):
    """A LUT, with the files that were written, the most exact first, and notes."""

    files: tuple[BakedFile, ...] = ()
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([super().__str__(), *map(str, self.files), *(f"note: {note}" for note in self.notes)])


def notes_on(plan: Plan, files: Sequence[BakedFile]) -> list[str]:
    """Notes for the user on the files: what they cannot hold, what their input is, and how to load them."""
    notes = []
    for file in files:
        if not plan.purpose.gives_encoded and format_of(file.path).bits is not None:
            loss = "whole numbers band the darks of linear light and lose what is beyond 1; use .clf"
            notes.append(f"{file.path}: {loss}")
        notes += _notes_on_difference(plan.purpose, file)
    if files and plan.input_and_output is not None and plan.purpose.kind.has_scene:
        notes.append("; ".join(plan.input_and_output.comments))
    reader = plan.options.reader
    if files and reader is not None:
        first = files[0].path
        use = reader.advice(first)
        notes.append(f"load {first} in {reader.name}{f': {use}' if use else ''}")
    return notes


def _notes_on_difference(purpose: Purpose, file: BakedFile) -> list[str]:
    """A note on the largest error of a file, if it is visible (above ΔE00 1) and its scene is beyond black or white."""
    error = file.error
    if not purpose.takes_footage or error.max_de00 is None or error.max_de00 <= 1:
        return []
    scene = rgb_space(purpose.space).linearize(np.array(error.worst))
    if scene.max() > 1:
        place = f"{scene.max():.0f} times as bright as white"
    elif scene.min() < 0:
        place = f"{scene.min():.2f}, below black"
    else:
        return []
    return [f"{file.path}: the largest difference is at light {place}; a .clf is closer"]
