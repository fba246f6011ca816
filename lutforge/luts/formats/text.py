"""The lines that text LUT formats share: plain ASCII comments and fixed-point numbers."""

import unicodedata
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.compiled import compiled

DIGITS = 10
"""Decimals of a number: float32 values on [0, 1] survive, and no reader has to know exponents."""

EXACT = 9e5
"""Below it, a number times ten to the power of DIGITS is a whole number that float64 holds."""
LONGEST = 20
"""Most characters of such a number, sign, point and what follows it included."""


def write_text(path: Path, text: str, encoding: str = "ascii") -> None:
    """Write a text file atomically, with line feeds on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding=encoding, newline="\n")


def plain(text: str, limit: int = 200) -> str:
    """One line of printable ASCII without double quotes, at most `limit` characters."""
    decomposed = unicodedata.normalize("NFKD", " ".join(text.split()))
    kept = "".join(c for c in decomposed if not unicodedata.combining(c))
    return kept.replace('"', "'").encode("ascii", "replace").decode()[:limit]


def comment_lines(title: str, comments: tuple[str, ...]) -> list[str]:
    """Comment lines, each "# …"."""
    return [f"# {plain(line)}" for line in (title, *comments) if plain(line)]


def rows(values: ArrayLike) -> str:
    """Numbers (n, 3), a row per line, rounded to DIGITS decimals, never "-0"."""
    numbers = np.asarray(values, dtype=np.float64)
    if np.abs(numbers).max(initial=0.0) < EXACT:
        return _fixed_point(np.ascontiguousarray(numbers)).tobytes().decode("ascii")
    numbers = np.round(numbers, DIGITS) + 0.0
    return (f"%.{DIGITS}f %.{DIGITS}f %.{DIGITS}f\n" * len(numbers)) % tuple(numbers.ravel().tolist())


@compiled()
def _fixed_point(numbers: Array) -> NDArray[np.uint8]:
    """The text of numbers (n, 3) as bytes: twenty times as fast as Python's own formatting."""
    text = np.empty(numbers.size * LONGEST, dtype=np.uint8)
    digits = np.empty(LONGEST, dtype=np.uint8)
    at = 0
    for n in range(numbers.shape[0]):
        for c in range(3):
            left = np.int64(np.rint(abs(numbers[n, c]) * 10.0**DIGITS))
            if left > 0 and numbers[n, c] < 0:
                text[at] = 45  # -
                at += 1
            count = 0
            while left > 0 or count <= DIGITS:
                digits[count] = 48 + left % 10
                left //= 10
                count += 1
            for place in range(count - 1, -1, -1):
                text[at] = digits[place]
                at += 1
                if place == DIGITS:
                    text[at] = 46  # .
                    at += 1
            text[at] = 10 if c == 2 else 32
            at += 1
    return text[:at]
