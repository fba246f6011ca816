"""The report on a LUT file: what is in it, which programs read it, and what will go wrong."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import one_line
from lutforge.luts.input_and_output import InputAndOutput, read_input_and_output
from lutforge.luts.ops import Cube, Curve, Matrix
from lutforge.luts.readers import readers_of
from lutforge.luts.reading import is_read_by_ocio, read_lut
from lutforge.luts.sequence import Lut
from lutforge.luts.text.checked_text import TEXTS
from lutforge.luts.verification import Colour, colour_of
from lutforge.luts.writers.spi import SPI_PAIR
from lutforge.model.lattice import grid, uniform_levels

FALL = 1e-5
"""The least step downwards, of outputs that should rise, that is more than rounding."""
HALF_MAX = 65504.0
"""The largest half float."""
ALARMING_FALL = 0.1
"""The least fall that is a problem, as a share of the rise of the input: a tenth of a code for each code."""
FLOAT_FORMATS = (".clf", ".ctf", ".spi1d", ".spi3d", ".spimtx", ".cc", ".ccc", ".cdl")
"""Formats whose readers all compute in floats, and clip nothing."""
CODES = {255.0: 8, 1023.0: 10, 4095.0: 12, 65535.0: 16}
"""The highest code of integers, and their bits."""
LEAST_HIGHEST_CODE, LEAST_MEDIAN_SHARE = 64.0, 0.2
"""Numbers that are not whole are codes, too, if the highest is at least the first of these, and the median is at least
that share of the highest."""


@dataclass(frozen=True, eq=False)
class LutReport:
    """A LUT file in figures and words.

    dialect: which kind of its format. domain: lowest and highest input. lowest, highest: of all outputs of the last
    table; clipped: the share of its nodes with a channel at 0 or 1, None where outputs lie beyond these; falling: the
    share of steps along a channel's own axis that go down. black, white: outputs of the ends of the domain. problems:
    in words; readers: verdicts, by program.
    """

    path: Path
    lut: Lut
    dialect: str
    domain: tuple[Colour, Colour]
    lowest: float
    highest: float
    clipped: float | None
    falling: float
    black: Colour
    white: Colour
    problems: tuple[str, ...]
    readers: dict[str, str]


def check_lut(path: str | Path) -> LutReport:
    """Read any LUT file and say what is in it. Raises LutError, one line, where it cannot be read."""
    path = Path(path)
    lut = read_lut(path)
    half = other_half(path)
    cube = lut.cube
    domain = _domain(lut)
    dialect = ""
    if lut.metadata.format in TEXTS:
        dialect = "1D" if cube is None else "3D" if lut.shaper is None else "1D shaper + 3D"

    # The outputs of the last table after all operations that follow it; of black and white where there is no table.
    outputs = np.array([[0.0] * 3, [1.0] * 3])
    for op in lut.ops:
        outputs = _outputs(op) if isinstance(op, Curve) else op.values if isinstance(op, Cube) else op(outputs)
    beyond = bool(outputs.min() < -1e-6 or outputs.max() > 1 + 1e-6)
    states = read_input_and_output(lut.comments)
    falling = 0.0
    if cube is not None:
        steps = [np.diff(cube.values[..., channel], axis=channel) for channel in range(3)]
        falling = float(np.mean([np.mean(step < -ALARMING_FALL / max(step.shape)) for step in steps]))

    readers = {"OpenColorIO, Nuke": "cannot read it"}
    if is_read_by_ocio(path, lut):
        warnings = "; ".join(lut.metadata.warnings)
        readers["OpenColorIO, Nuke"] = f"reads it; it warns: {warnings}" if warnings else "reads it"
    if half is not None:
        order = " and then ".join(path.with_suffix(end).name for end in SPI_PAIR)
        readers = {"one half of a pair": f"{order} are the LUT, the shaper and its cube, in an OpenColorIO config"}
        readers["OpenColorIO, Nuke"] = "reads it"
    readers |= readers_of(lut, domain)
    if states is not None and states.takes_raw:
        readers |= {"darktable, RawTherapee, ART, Lightroom": "feed no camera RAW to a LUT: use `lutforge kit`"}

    black, white = (colour_of(colour) for colour in lut(np.array(domain)))
    clipped = None if beyond else float(np.mean(np.any((outputs <= 0) | (outputs >= 1), axis=-1)))
    problems = tuple(_problems(lut, domain, falling, outputs, clipped, states, half is not None))
    lowest, highest = float(outputs.min()), float(outputs.max())
    return LutReport(path, lut, dialect, domain, lowest, highest, clipped, falling, black, white, problems, readers)


def other_half(path: Path) -> Path | None:
    """The .spi3d of a .spi1d, or the .spi1d of a .spi3d, that is in the same folder; else none."""
    suffix = path.suffix.lower()
    if suffix not in SPI_PAIR:
        return None
    half = path.with_suffix(SPI_PAIR[1 - SPI_PAIR.index(suffix)])
    return half if half.is_file() else None


def report_lines(report: LutReport) -> list[str]:
    """The report as lines of text."""
    lut = report.lut
    dialect = f", {report.dialect}" if report.dialect else ""
    lines = [f"{report.path}: {lut.metadata.format or 'LUT'}{dialect}"]
    if lut.title:
        lines.append(f"  title     {one_line(lut.title, 160)}")
    lines += [f"  comment   {one_line(text, 160)}" for text in lut.comments[:8] if text.strip()]
    lines += [f"  {number}. {op}" for number, op in enumerate(lut.ops, 1)]
    low, high = report.domain
    if (low, high) != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
        lines.append(f"  domain    {' '.join(f'{v:g}' for v in low)} to {' '.join(f'{v:g}' for v in high)}")
    limits = "" if report.clipped is None else f", {report.clipped:.1%} of the nodes at a limit"
    lines.append(f"  outputs   {report.lowest:.6g} to {report.highest:.6g}{limits}")
    for name, colour in (("black", report.black), ("white", report.white)):
        lines.append(f"  {name}     {' '.join(f'{v:.5f}' for v in colour)}")
    lines += [f"  problem   {text}" for text in report.problems]
    programs_by_verdict: dict[str, list[str]] = {}
    for program, verdict in report.readers.items():
        programs_by_verdict.setdefault(verdict, []).append(program)
    lines += [f"  {', '.join(programs)}: {verdict}" for verdict, programs in programs_by_verdict.items()]
    return lines


def _outputs(curve: Curve) -> Array:
    """The entries of a curve; of a curve over all half floats, those of inputs between 0 and 1."""
    if curve.inputs is None or curve.inputs.max() < HALF_MAX:
        return curve.outputs
    return curve.outputs[np.all((curve.inputs >= 0) & (curve.inputs <= 1), axis=1)]


def _problems(
    lut: Lut,
    domain: tuple[Colour, Colour],
    falling: float,
    outputs: Array,
    clipped: float | None,
    states: InputAndOutput | None,
    is_half: bool,
) -> list[str]:
    """What is wrong with a LUT. falling, outputs, clipped: as in `check_lut`; states: by its comments.

    is_half: it is a .spi1d or .spi3d whose other file is in the same folder.
    """
    problems = ["; ".join(lut.metadata.problems)] if lut.metadata.problems else []
    for number, op in enumerate(lut.ops, 1):
        if isinstance(op, Curve):
            name = "curve" if len(lut.ops) == 1 else f"curve (operation {number})"
            falls = np.any(np.diff(op.outputs, axis=0) < -FALL, axis=1)
            if falls.any():
                entry = f"entry {int(np.argmax(falls)) + 2} of {len(op.outputs)}"
                problems.append(f"the {name} falls at {entry}: it cannot be undone there")
            constant = np.ptp(op.outputs, axis=0) < 1e-6
            if constant.any():
                channels = [word for word, flat in zip(("red", "green", "blue"), constant, strict=True) if flat]
                of_channels = "" if constant.all() else f" of {' and '.join(channels)}"
                problems.append(f"the {name}{of_channels} is constant: all inputs become one")

    if lut.cube is not None:
        values = lut.cube.values
        share = np.linspace(0.0, 1.0, 257)[:, None]
        grey = lut((1.0 - share) * max(domain[0]) + share * min(domain[1]) + np.zeros(3))
        takes_raw = states is not None and states.takes_raw  # equal numbers of RAW before white balance are no grey
        mean = grey.mean(axis=1)
        falls = np.min(np.diff(mean)) < -ALARMING_FALL / 256 or np.max(np.maximum.accumulate(mean) - mean) > 1 / 255
        if falls and not takes_raw and not is_half:
            problems.append("grey becomes darker somewhere where the input becomes lighter")

        # In cameras a few channels fall: where strong colours are mapped into the gamut.
        if falling > 0.1:
            steps = f"{falling:.1%} of the steps"
            problems.append(f"a channel falls while its own input rises at {steps}: banding or solarization")
        if np.ptp(values) < 1e-6:
            problems.append("all colours become one")

        # Per output channel of the whole LUT, the input channel with which it changes most, on average.
        colours = lut(np.array(domain[0]) + grid(uniform_levels(9)) * np.subtract(domain[1], domain[0]))
        changes = [np.abs(np.take(colours, -1, axis) - np.take(colours, 0, axis)) for axis in range(3)]
        follows = tuple(np.argmax([change.reshape(-1, 3).mean(axis=0) for change in changes], axis=0).tolist())
        if sorted(follows) == [0, 1, 2] and follows != (0, 1, 2):
            pairs = ", ".join(f"{'RGB'[out]} follows {'RGB'[axis]}" for out, axis in enumerate(follows) if out != axis)
            problems.append(f"channels are exchanged: {pairs}; rows in the wrong order, or BGR for RGB")

    problems += _problems_of_range(domain, outputs, clipped, states, lut.metadata.format in FLOAT_FORMATS)
    if lut.metadata.bits == 8:
        problems.append("8 bits per channel: gradients will show bands; 16 are usual")
    return problems


def _problems_of_range(
    domain: tuple[Colour, Colour],
    outputs: Array,
    clipped: float | None,
    states: InputAndOutput | None,
    in_floats: bool,
) -> Iterator[str]:
    """What is wrong with the range of a LUT's inputs and outputs, which most programs expect to be 0 to 1.

    in_floats: all programs that read the file compute in floats.
    """
    highest = float(outputs.max())
    if max(domain[1]) in CODES:
        yield (
            f"its inputs run to {max(domain[1]):g}, as codes of {CODES[max(domain[1])]} bits: pictures from 0 to 1 "
            "fall on its first nodes; write a domain from 0 to 1"
        )
    whole = bool(np.all(outputs == np.rint(outputs)))
    # Scene-linear light reaches as high, and in nits higher, but half of such a table is dark.
    codes = (
        highest >= LEAST_HIGHEST_CODE and float(np.median(outputs)) > LEAST_MEDIAN_SHARE * highest and states is None
    )
    if highest > 1 and clipped is None and (whole or codes):
        top = next((code for code in CODES if code >= highest), highest)
        are = "are whole and run" if whole else "run"
        yield (
            f"its numbers {are} to {highest:g}, as codes, where 0 to 1 are meant: all is white; divide them by {top:g}"
        )
    elif clipped is None and not in_floats and not (states is not None and states.are_linear[1]):
        yield "outputs leave [0, 1]: programs with integers clip them, others pass them on"
    if clipped is not None and clipped > 0.9995 and len(outputs.reshape(-1, 3)) > 8:
        yield "100 % of the nodes are at a limit, 0 or 1: its numbers are cut, or are codes of other than 0 to 1"


def _domain(lut: Lut) -> tuple[Colour, Colour]:
    """The lowest and the highest input of the first table.

    They are 0 and 1 after a matrix that mixes channels, and for a curve over all half floats.
    """
    low, high = np.zeros(3), np.ones(3)
    matrix = Matrix(np.eye(3))
    for op in lut.ops:
        if isinstance(op, Matrix):
            matrix = Matrix(op.matrix @ matrix.matrix, op.matrix @ matrix.offset + op.offset)
        elif isinstance(op, Curve):
            if op.inputs is None:
                low, high = low + op.low, 0 * high + op.high
            elif op.inputs.max() < HALF_MAX:
                low, high = op.inputs[0], op.inputs[-1]
            break
        elif isinstance(op, Cube):
            break
    scale = np.diag(matrix.matrix)
    if not matrix.is_diagonal or np.any(scale <= 0):
        return (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    limits = ((end - matrix.offset) / scale for end in (low, high))
    first, last = (colour_of(np.round(end, 9) + 0.0) for end in limits)
    return first, last
