"""Read a LUT file back and measure how far it is from what it should be.

Through OpenColorIO; formats that it does not read by our own reader and the interpolation that is asked for.
colour-science reads the same file where it can: two readers that disagree are an error.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.interpolation import Interpolation
from lutforge.luts.formats import spi
from lutforge.luts.ops import Cube
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.programs import OCIO_READS
from lutforge.luts.read import read_lut
from lutforge.luts.sample_points import sample_points
from lutforge.luts.second_reader import disagreement
from lutforge.luts.sequence import Lut
from lutforge.model.transform import ColourFunction


@dataclass(frozen=True)
class FileError:
    """How far a file is from a reference, on `samples` fixed points of the input cube.

    mean, p99, max: Euclidean norm of the RGB difference (1 = full scale). worst_input: where the largest is.
    mean_de00, max_de00: CIEDE2000 with both taken for encoded sRGB; None for outputs that are not for a
    display. second: the largest difference of a channel between two readers of the file; None where there is one only.
    """

    mean: float
    p99: float
    max: float
    worst_input: tuple[float, float, float]
    mean_de00: float | None
    max_de00: float | None
    samples: int
    second: float | None = None

    def __str__(self) -> str:
        text = f"mean {self.mean:.2g}, 99 % {self.p99:.2g}, max {self.max:.2g}"
        if self.mean_de00 is not None and self.max_de00 is not None:
            text += f"; dE00 mean {self.mean_de00:.2g}, max {self.max_de00:.2g}"
        if self.second is not None:
            text += f"; colour-science agrees within {self.second:.1g}"
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
    second = disagreement(_files(path), x, got.astype(np.float64), method)
    return replace(compare(got, reference(x), x, display_referred), second=second)


def _files(path: Path) -> list[Path]:
    """The file, or the pair that it belongs to, in the order in which they are used."""
    pair = [path.with_suffix(end) for end in spi.PAIR]
    return pair if path.suffix.lower() in spi.PAIR and all(file.is_file() for file in pair) else [path]


def _read_back(path: Path, method: Interpolation) -> Callable[[Array], Single]:
    """What a reader of the file makes of colours (n, 3)."""
    if path.suffix.lower() in OCIO_READS:
        processors = [file_processor(file, method) for file in _files(path)]

        def through(x: Array) -> Single:
            y = x.astype(np.float32)
            for processor in processors:
                y = evaluate(processor, y)
            return y

        return through
    lut = read_lut(path)
    ops = tuple(replace(op, interpolation=method) if isinstance(op, Cube) else op for op in lut.ops)
    as_read = replace(lut, ops=ops)
    return lambda x: as_read(x).astype(np.float32)


def compare(
    got: Single,
    wanted: Array,
    x: Array,
    display_referred: bool = True,
) -> FileError:
    """Figures of the difference of two outputs (n, 3) at the inputs x (n, 3)."""
    norm = np.linalg.norm(got - wanted, axis=1)
    worst = x[int(np.argmax(norm))]
    de00 = delta_e_2000(got.astype(np.float64), wanted) if display_referred else None
    return FileError(
        mean=float(norm.mean()),
        p99=float(np.quantile(norm, 0.99)),
        max=float(norm.max()),
        worst_input=(float(worst[0]), float(worst[1]), float(worst[2])),
        mean_de00=None if de00 is None else float(de00.mean()),
        max_de00=None if de00 is None else float(de00.max()),
        samples=len(x),
    )
