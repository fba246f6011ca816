"""Recognize black-and-white picture styles, and linearize them by inverting the grey axis of their rendering.

Their JPEGs tell how bright a colour was, not which. What linearizes a neutral code g is therefore the neutral light t
with render(t, t, t) = g; off the grey axis, where no such JPEG lies, the same curve holds for each channel.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import LatticeOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, grid, snapped, uniform_levels


def is_monochrome(balanced: Array, encoded: Array) -> bool:
    """Tell whether a style made neutral JPEG values (n, 3) of colourful balanced RAW (n, 3), all unclipped, n > 0.

    Neutral values differ by two codes at most. Colourful is RAW of which a tenth would differ by 16 codes, had the
    style rendered each channel by its tones. The tones match the ranks of brightness, so that noise of dark greys
    counts as little as it shows.
    """
    if np.ptp(encoded, axis=1).max() > 2 / 255:
        return False
    in_colour = np.interp(balanced, np.sort(balanced.mean(axis=1)), np.sort(encoded.mean(axis=1)))
    return bool(np.percentile(np.ptp(in_colour, axis=1), 90) >= 16 / 255)


def monochrome_note(style: str) -> str:
    """What a profile says of such a style."""
    return (
        f'style "{style}" is black and white: its JPEGs hold no colour, so linearize gives neutral light of the same '
        "brightness"
    )


def inverse_of_greys(render: Lattice, options: LatticeOptions) -> Lattice:
    """The lattice that takes each channel's code to the neutral light which `render` (Tw E → I) gives that code.

    Rising; 0 stays 0, and the code of white becomes the least light that renders so.
    """
    light = np.linspace(0.0, 1.0, 4097) ** 2  # even steps would pass over the darkest codes
    grey = np.clip(render(np.repeat(light[:, None], 3, axis=1)).mean(axis=1), 0.0, 1.0)
    code, first = np.unique(np.maximum.accumulate(grey), return_index=True)
    if options.nonuniform:
        levels = snapped(_levels(code, light[first], options.size), options.shaper_size)
    else:
        levels = uniform_levels(options.size)
    return Lattice(levels, np.interp(grid(levels), code, light[first]), options.interpolation)


def _levels(code: Array, light: Array, size: int) -> Levels:
    """Choose the `size` node levels whose straight chords miss the curve by the fewest codes."""
    steps = 1024  # of codes, on which the nodes may lie
    at = np.linspace(0.0, 1.0, steps + 1)
    exact = np.interp(at, code, light)
    low, high, nodes = 0.0, 1.0, [0, steps]
    for _ in range(16):  # halves the range to 1/256 of a code
        tolerance = (low + high) / 2.0
        chords = _longest_chords(exact, code, light, tolerance, size)
        if chords[-1] == steps:
            high, nodes = tolerance, chords
        else:
            low = tolerance
    while len(nodes) < size:
        widest = int(np.argmax(np.diff(nodes)))
        nodes.insert(widest + 1, (nodes[widest] + nodes[widest + 1]) // 2)
    axis = at[nodes]
    return (axis, axis.copy(), axis.copy())


def _longest_chords(exact: Array, code: Array, light: Array, tolerance: float, size: int) -> list[int]:
    """Return the ends of at most size − 1 chords, begun at black, each as long as its error is within the tolerance."""
    exact_codes = np.interp(exact, light, code)
    nodes, last = [0], len(exact) - 1
    while nodes[-1] < last and len(nodes) < size:
        start, low, high = nodes[-1], nodes[-1] + 1, last
        while low < high:
            end = (low + high + 1) // 2
            chord = np.linspace(exact[start], exact[end], end - start + 1)
            error = np.abs(np.interp(chord, light, code) - exact_codes[start : end + 1]).max()
            low, high = (end, high) if error <= tolerance else (low, end - 1)
        nodes.append(low)
    return nodes
