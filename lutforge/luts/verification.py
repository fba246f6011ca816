"""The error of a LUT file against the transform that was baked: the file is read back and evaluated as its reader does.

OpenColorIO reads the file, or LutForge's reader where it does not know the format, with the interpolation of the target
program. The points of the comparison are fixed, and denser where the LUT bends.
"""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, ColourFunction, Real, Single
from lutforge.colour.srgb import delta_e_2000
from lutforge.interpolation import Interpolation
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Matrix
from lutforge.luts.reading import has_own_reader, read_lut, trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import node_levels
from lutforge.luts.writers.spi import SPI_PAIR
from lutforge.sobol import sobol

Colour = tuple[float, float, float]
"""Red, green and blue."""


@dataclass(frozen=True)
class FileError:
    """The difference between a file and a reference, at `samples` fixed points of the input cube.

    mean, p99, max: Euclidean norm of the RGB difference (1 = full scale). mean_de00, max_de00: CIEDE2000, with both
    read as encoded sRGB; None for outputs that are not for a display. worst: the input of the largest difference.
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
    scenes: bool = False,
) -> FileError:
    """Compare the file, as a reader evaluates it in float32, with a reference.

    lut: the LUT that was written, whose nodes and interpolation are used; without it, the nodes are the file's, and the
    interpolation is tetrahedral. interpolation: of the file's reader, if it is another. scenes: the input is
    scene-linear, with values below 0 and above the file's domain.
    """
    path = Path(path)
    method = interpolation or (lut.interpolation if lut is not None else "tetrahedral")
    # Rounded to float32 first, so that the file and the reference get the same input.
    x = sample_points(lut or read_lut(path))
    x = (np.concatenate([x, scene_points(float(x.max()))]) if scenes else x).astype(np.float32).astype(np.float64)
    if not has_own_reader(path):
        pair = [path.with_suffix(end) for end in SPI_PAIR]  # in the order in which they are used
        is_pair = path.suffix.lower() in SPI_PAIR and all(file.is_file() for file in pair)
        read = x.astype(np.float32)
        for file in pair if is_pair else [path]:
            read = evaluate(trusted_processor(file, method), read)
    else:
        lut = read_lut(path)
        ops = tuple(replace(op, interpolation=method) if isinstance(op, Cube) else op for op in lut.ops)
        read = replace(lut, ops=ops)(x).astype(np.float32)
    return compare(x, read, reference(x), display_referred)


def sample_points(lut: Lut) -> Array:
    """Points (n, 3) of a LUT's domain, denser where it bends.

    A LUT of scene-linear inputs begins with a matrix that mixes channels, and gets points beyond the domain, too.
    """
    count = 32768
    first = lut.ops[0]
    matrix = first if isinstance(first, Matrix) else Matrix(np.eye(3))
    low, high = (0.0, 1.0) if lut.shaper is None else (lut.shaper.low, lut.shaper.high)
    axes = (np.linspace(low, high, 33),) * 3 if lut.cube is None else node_levels(lut.shaper, lut.cube)
    sequence = sobol(count)

    # Points evenly many in each cell, the nodes, and points one step of a 16-bit shaper away from them.
    spread = np.stack([np.interp(sequence[:, c], np.linspace(0, 1, len(axes[c])), axes[c]) for c in range(3)], axis=1)
    nodes = np.stack([axes[c][(sequence[: count // 4, c] * len(axes[c])).astype(np.intp)] for c in range(3)], axis=1)
    step = (high - low) / 65535
    bends = np.clip(np.concatenate([spread, nodes, nodes + step, nodes - step]), low, high)

    # Points evenly over the domain, greys and corners.
    grey = np.repeat(np.linspace(0.0, 1.0, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    even = np.concatenate([sequence, grey, corners])

    inverse = np.linalg.inv(matrix.matrix)
    if not matrix.is_diagonal:
        x = (np.concatenate([low + even * (high - low), bends]) - matrix.offset) @ inverse.T
        return np.concatenate([x, 2 * x[::8]])  # some of these the camera clips
    highest = np.maximum((high - matrix.offset) * np.diag(inverse), 1.0)
    return np.concatenate([even * highest, (bends - matrix.offset) * np.diag(inverse)])


def scene_points(highest: float) -> Array:
    """Scene-linear colours (n, 3) from −0.1 to beyond a domain's end, greys, and ramps of each channel alone."""
    low = -0.1
    high = 1.25 * highest
    ramp = np.linspace(low, high, 1025)[:, None]
    single_channels = np.concatenate([ramp * np.eye(3)[channel] for channel in range(3)])
    return np.concatenate([low + (high - low) * sobol(4096), np.repeat(ramp, 3, axis=1), single_channels])


def compare(x: Array, read: Single, exact: Array, display_referred: bool = True) -> FileError:
    """The difference of two outputs (n, 3) for the inputs x (n, 3), in figures."""
    norm = np.linalg.norm(read - exact, axis=1)
    de00 = delta_e_2000(read.astype(np.float64), exact) if display_referred else None
    mean_de00, max_de00 = (None, None) if de00 is None else (float(de00.mean()), float(de00.max()))
    worst = colour_of(x[int(np.argmax(norm if de00 is None else de00))])
    mean, p99, most = float(norm.mean()), float(np.quantile(norm, 0.99)), float(norm.max())
    return FileError(mean, p99, most, mean_de00, max_de00, len(read), worst)


def colour_of(colour: Real) -> Colour:
    """A colour (3,) as numbers."""
    r, g, b = (float(v) for v in colour)
    return r, g, b
