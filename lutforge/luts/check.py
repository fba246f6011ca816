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
SHOWN_COMMENTS = 20
"""Most comments that a report shows: more than the files that LutForge writes have."""
CODES = {255.0: 8, 1023.0: 10, 4095.0: 12, 65535.0: 16}
"""The highest code of integers, and their bits."""
LEAST_HIGHEST_CODE, LEAST_MEDIAN_SHARE = 64.0, 0.2
"""Numbers are codes if the highest is at least the first of these, and they are whole, or the median is at least that
share of the highest. A matrix that doubles the exposure gives whole numbers, too: 0 and 2."""


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
    findings = _Findings(
        path=path,
        lut=lut,
        domain=_domain(lut),
        outputs=_outputs_of_last_table(lut),
        falling=_falling_share(lut.cube),
        stated=read_input_and_output(lut.comments),
        other_half=other_half(path),
    )
    black, white = (colour_of(colour) for colour in lut(np.array(findings.domain)))
    return LutReport(
        path=path,
        lut=lut,
        dialect=_dialect(lut),
        domain=findings.domain,
        lowest=float(findings.outputs.min()),
        highest=float(findings.outputs.max()),
        clipped=findings.clipped,
        falling=findings.falling,
        black=black,
        white=white,
        problems=tuple(_problems(findings)),
        readers=_readers(findings),
    )


@dataclass(frozen=True, eq=False)
class _Findings:
    """The findings in a LUT file, from which its problems and readers follow.

    domain, falling: as in `LutReport`; outputs: (…, 3), of the last table; stated: the input and output that its
    comments state, or None; other_half: the other file of a pair of .spi1d and .spi3d, or None.
    """

    path: Path
    lut: Lut
    domain: tuple[Colour, Colour]
    outputs: Array
    falling: float
    stated: InputAndOutput | None
    other_half: Path | None

    @property
    def clipped(self) -> float | None:
        """The share of the nodes with a channel at 0 or 1; None where outputs lie beyond these."""
        if self.outputs.min() < -1e-6 or self.outputs.max() > 1 + 1e-6:
            return None
        return float(np.mean(np.any((self.outputs <= 0) | (self.outputs >= 1), axis=-1)))

    @property
    def takes_raw(self) -> bool:
        """True where the comments state that its input is camera RAW."""
        return self.stated is not None and self.stated.takes_raw


def _dialect(lut: Lut) -> str:
    """The kind of tables in a text file; "" for other files."""
    if lut.metadata.format not in TEXTS:
        return ""
    if lut.cube is None:
        return "1D"
    return "3D" if lut.shaper is None else "1D shaper + 3D"


def _outputs_of_last_table(lut: Lut) -> Array:
    """The entries (…, 3) of the last table after all operations that follow it; without tables of black and white."""
    outputs = np.array([[0.0] * 3, [1.0] * 3])
    for op in lut.ops:
        match op:
            case Curve():
                outputs = _entries(op)
            case Cube():
                outputs = op.values
            case _:
                outputs = op(outputs)
    return outputs


def _falling_share(cube: Cube | None) -> float:
    """The share of steps along a channel's own axis that go down by an alarming amount; 0 without a cube."""
    if cube is None:
        return 0.0
    steps = [np.diff(cube.values[..., channel], axis=channel) for channel in range(3)]
    return float(np.mean([np.mean(step < -ALARMING_FALL / max(step.shape)) for step in steps]))


def _readers(findings: _Findings) -> dict[str, str]:
    """The verdicts on a file, by program or programs."""
    lut, half = findings.lut, findings.other_half
    by_ocio = "OpenColorIO, Nuke"
    if half is not None:
        pair = " and then ".join(findings.path.with_suffix(suffix).name for suffix in SPI_PAIR)
        readers = {
            "one half of a pair": f"{pair} are the LUT, the shaper and its cube, in an OpenColorIO config",
            by_ocio: "reads it",
        }
    elif is_read_by_ocio(findings.path, lut):
        warnings = "; ".join(lut.metadata.warnings)
        readers = {by_ocio: f"reads it; it warns: {warnings}" if warnings else "reads it"}
    else:
        readers = {by_ocio: "cannot read it"}

    readers |= readers_of(lut, findings.domain)
    if findings.takes_raw:
        readers |= {"darktable, RawTherapee, ART, Lightroom": "feed no camera RAW to a LUT: use `lutforge kit`"}
    return readers


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
    lines += [f"  comment   {one_line(text, 160)}" for text in lut.comments[:SHOWN_COMMENTS] if text.strip()]
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


def _entries(curve: Curve) -> Array:
    """The entries (m, 3) of a curve; of a curve over all half floats, those of inputs between 0 and 1."""
    if curve.inputs is None or curve.inputs.max() < HALF_MAX:
        return curve.outputs
    return curve.outputs[np.all((curve.inputs >= 0) & (curve.inputs <= 1), axis=1)]


def _problems(findings: _Findings) -> Iterator[str]:
    """The problems of a LUT, in words."""
    metadata = findings.lut.metadata
    if metadata.problems:
        yield "; ".join(metadata.problems)
    yield from _problems_of_curves(findings.lut)
    if findings.lut.cube is not None:
        yield from _problems_of_cube(findings, findings.lut.cube)
    yield from _problems_of_inputs(findings)
    yield from _problems_of_outputs(findings)
    if metadata.bits == 8:
        yield "8 bits per channel: gradients will show bands; 16 are usual"


def _problems_of_curves(lut: Lut) -> Iterator[str]:
    """Curves that fall or are constant."""
    for number, op in enumerate(lut.ops, 1):
        if not isinstance(op, Curve):
            continue
        name = "curve" if len(lut.ops) == 1 else f"curve (operation {number})"
        falls = np.any(np.diff(op.outputs, axis=0) < -FALL, axis=1)
        if falls.any():
            entry = f"entry {int(np.argmax(falls)) + 2} of {len(op.outputs)}"
            yield f"the {name} falls at {entry}: it cannot be undone there"
        constant = np.ptp(op.outputs, axis=0) < 1e-6
        if constant.any():
            channels = [word for word, flat in zip(("red", "green", "blue"), constant, strict=True) if flat]
            of_channels = "" if constant.all() else f" of {' and '.join(channels)}"
            yield f"the {name}{of_channels} is constant: all inputs become one"


def _problems_of_cube(findings: _Findings, cube: Cube) -> Iterator[str]:
    """Greys and channels that fall, a cube of one colour, and channels that are exchanged."""
    lut = findings.lut
    lowest, highest = findings.domain

    # Equal numbers of RAW before white balance are no grey, and half of a LUT need not keep greys in order.
    if not findings.takes_raw and findings.other_half is None:
        share = np.linspace(0.0, 1.0, 257)[:, None]
        grey = lut((1.0 - share) * max(lowest) + share * min(highest) + np.zeros(3)).mean(axis=1)
        falls_steeply = np.min(np.diff(grey)) < -ALARMING_FALL / 256
        if falls_steeply or np.max(np.maximum.accumulate(grey) - grey) > 1 / 255:
            yield "grey becomes darker somewhere where the input becomes lighter"

    # In cameras a few channels fall: where strong colours are mapped into the gamut.
    if findings.falling > 0.1:
        steps = f"{findings.falling:.1%} of the steps"
        yield f"a channel falls while its own input rises at {steps}: banding or solarization"
    if np.ptp(cube.values) < 1e-6:
        yield "all colours become one"

    # Per output channel of the whole LUT, the input channel with which it changes most, on average.
    colours = lut(np.array(lowest) + grid(uniform_levels(9)) * np.subtract(highest, lowest))
    changes = [np.abs(np.take(colours, -1, axis) - np.take(colours, 0, axis)) for axis in range(3)]
    follows = tuple(np.argmax([change.reshape(-1, 3).mean(axis=0) for change in changes], axis=0).tolist())
    if sorted(follows) == [0, 1, 2] and follows != (0, 1, 2):
        pairs = ", ".join(f"{'RGB'[out]} follows {'RGB'[axis]}" for out, axis in enumerate(follows) if out != axis)
        yield f"channels are exchanged: {pairs}; rows in the wrong order, or BGR for RGB"


def _problems_of_inputs(findings: _Findings) -> Iterator[str]:
    """A domain in codes, where most programs expect 0 to 1."""
    highest = max(findings.domain[1])
    if highest in CODES:
        yield (
            f"its inputs run to {highest:g}, as codes of {CODES[highest]} bits: pictures from 0 to 1 fall on its first "
            "nodes; write a domain from 0 to 1"
        )


def _problems_of_outputs(findings: _Findings) -> Iterator[str]:
    """Outputs beyond 0 to 1, which most programs expect, or nearly all at these limits."""
    outputs, clipped, stated = findings.outputs, findings.clipped, findings.stated
    metadata_bits = findings.lut.metadata.bits
    highest = float(outputs.max())
    are_whole = bool(np.all(outputs == np.rint(outputs)))
    # Scene-linear light reaches as high, and in nits higher, but half of such a table is dark.
    are_bright = float(np.median(outputs)) > LEAST_MEDIAN_SHARE * highest and stated is None
    if highest >= LEAST_HIGHEST_CODE and clipped is None and (are_whole or are_bright):
        are = "are whole and run" if are_whole else "run"
        yield (
            f"its numbers {are} to {highest:g}, as codes, where 0 to 1 are meant: all is white; divide them by "
            f"{_code_of_white(highest)}"
        )
    elif clipped is None:
        in_floats = findings.lut.metadata.format in FLOAT_FORMATS
        gives_linear = stated is not None and stated.are_linear[1]
        if not in_floats and not gives_linear:
            yield "outputs leave [0, 1]: programs with integers clip them, others pass them on"
    if clipped is not None and metadata_bits is not None:
        yield from _problem_of_lower_codes(highest, metadata_bits)
    if clipped is not None and clipped > 0.9995 and len(outputs.reshape(-1, 3)) > 8:
        yield "100 % of the nodes are at a limit, 0 or 1: its numbers are cut, or are codes of other than 0 to 1"


def _code_of_white(highest: float) -> str:
    """The code of white of a table whose highest number is this, which in video range is 0.92 of it."""
    near = [code for code in CODES if 0.9 * code <= highest <= code]
    return f"{near[0]:g}" if near else "the code of white, such as 255 or 1023"


def _problem_of_lower_codes(highest: float, bits: int) -> Iterator[str]:
    """A table of integers of so many bits whose white, `highest` in 0 to 1, is that of fewer bits, or is 1."""
    top = 2**bits - 1
    kinds = {1.0: "as numbers from 0 to 1"} | {code: f"as codes of {depth} bits" for code, depth in CODES.items()}
    for code, kind in kinds.items():
        if code < top and abs(highest * top - code) < 1e-3:
            factor = f"{top / code:.6g}"
            yield f"its numbers run to {code:g}, {kind}, where {top} is white: all is dark; multiply them by {factor}"


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
