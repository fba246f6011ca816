"""Read a LUT file back and measure how far it is from what it should be.

OpenColorIO reads the file, or our own reader where it does not know the format, with the interpolation asked for. Files
are compared at the same points every time, of which more lie where the LUT bends.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.interpolation import Interpolation
from lutforge.luts.axes import node_levels
from lutforge.luts.check import Colour
from lutforge.luts.formats import spi
from lutforge.luts.ops import Cube, Matrix
from lutforge.luts.processor import evaluate
from lutforge.luts.reading import file_processor, read_lut
from lutforge.luts.sequence import Lut, own_reader
from lutforge.model.transform import ColourFunction
from lutforge.sobol import sobol


def sample_points(lut: Lut, count: int = 32768) -> Array:
    """Points (n, 3) of a LUT's domain, dense where it bends.

    A Sobol sequence, the same squeezed towards the node levels, nodes and both sides of them, the grey axis, and the
    corners of the cube; behind a matrix of a scene-linear space also what is beyond the domain. `count` (a power of
    two) is the length of the sequence.
    """
    first = lut.ops[0]
    matrix = first if isinstance(first, Matrix) else Matrix(np.eye(3))
    low, high = (0.0, 1.0) if lut.shaper is None else (lut.shaper.low, lut.shaper.high)
    axes = (np.linspace(low, high, 33),) * 3 if lut.cube is None else node_levels(lut.shaper, lut.cube)
    sequence = sobol(count)
    spread = np.stack([np.interp(sequence[:, c], np.linspace(0, 1, len(axes[c])), axes[c]) for c in range(3)], axis=1)
    nodes = np.stack([axes[c][(sequence[: count // 4, c] * len(axes[c])).astype(np.intp)] for c in range(3)], axis=1)
    step = (high - low) / 65535
    bends = np.clip(np.concatenate([spread, nodes, nodes + step, nodes - step]), low, high)
    grey = np.repeat(np.linspace(0.0, 1.0, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    even = np.concatenate([sequence, grey, corners])
    back = np.linalg.inv(matrix.matrix)
    if not matrix.is_diagonal:
        x = (np.concatenate([low + even * (high - low), bends]) - matrix.offset) @ back.T
        return np.concatenate([x, 2 * x[::8]])  # and what the camera clips
    reach = np.maximum((high - matrix.offset) * np.diag(back), 1.0)
    return np.concatenate([even * reach, (bends - matrix.offset) * np.diag(back)])


@dataclass(frozen=True)
class FileError:
    """How far a file is from a reference, on `samples` fixed points of the input cube.

    mean, p99, max: Euclidean norm of the RGB difference (1 = full scale).
    mean_de00, max_de00: CIEDE2000 with both taken for encoded sRGB; None for outputs that are not for a
    display. worst: the input (r, g, b) at which the difference is the largest.
    """

    mean: float
    p99: float
    max: float
    mean_de00: float | None
    max_de00: float | None
    samples: int
    worst: Colour

    def __str__(self) -> str:
        text = f"mean {self.mean:.2g}, 99 % {self.p99:.2g}, max {self.max:.2g}"
        if self.mean_de00 is not None and self.max_de00 is not None:
            text += f"; ΔE00 mean {self.mean_de00:.2g}, max {self.max_de00:.2g}"
        return text


def verify(
    path: str | Path,
    reference: ColourFunction,
    lut: Lut | None = None,
    interpolation: Interpolation | None = None,
    display_referred: bool = True,
) -> FileError:
    """Compare the file, as a reader evaluates it in float32, with a reference.

    lut: the LUT that was written: points near its nodes, and its interpolation; without it, those of the file, and
    tetrahedral. interpolation overrides: what the file's consumer will use. Raises LutError.
    """
    path = Path(path)
    method = interpolation or (lut.interpolation if lut is not None else "tetrahedral")
    # Rounded to float32 first: both sides get the very same input.
    x = sample_points(lut or read_lut(path)).astype(np.float32).astype(np.float64)
    got = _read_back(path, method)(x)
    return compare(x, got, reference(x), display_referred)


def _files(path: Path) -> list[Path]:
    """The file, or the pair that it belongs to, in the order in which they are used."""
    pair = [path.with_suffix(end) for end in spi.PAIR]
    return pair if path.suffix.lower() in spi.PAIR and all(file.is_file() for file in pair) else [path]


def _read_back(path: Path, method: Interpolation) -> Callable[[Array], Single]:
    """What a reader of the file makes of colours (n, 3)."""
    if own_reader(path) is None:
        processors = [file_processor(file, method) for file in _files(path)]

        def values_of(x: Array) -> Single:
            y = x.astype(np.float32)
            for processor in processors:
                y = evaluate(processor, y)
            return y

        return values_of
    lut = read_lut(path)
    ops = tuple(replace(op, interpolation=method) if isinstance(op, Cube) else op for op in lut.ops)
    as_read = replace(lut, ops=ops)
    return lambda x: as_read(x).astype(np.float32)


def compare(x: Array, got: Single, wanted: Array, display_referred: bool = True) -> FileError:
    """Figures of the difference of two outputs (n, 3) for the inputs x (n, 3)."""
    norm = np.linalg.norm(got - wanted, axis=1)
    de00 = delta_e_2000(got.astype(np.float64), wanted) if display_referred else None
    r, g, b = (float(v) for v in x[int(np.argmax(norm if de00 is None else de00))])
    return FileError(
        mean=float(norm.mean()),
        p99=float(np.quantile(norm, 0.99)),
        max=float(norm.max()),
        mean_de00=None if de00 is None else float(de00.mean()),
        max_de00=None if de00 is None else float(de00.max()),
        samples=len(got),
        worst=(r, g, b),
    )
