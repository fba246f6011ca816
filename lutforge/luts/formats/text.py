"""What text LUT formats share.

They have plain ASCII comments and fixed-point numbers.
"""

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
"""A number below this, times ten to the power of DIGITS, is a whole number that float64 holds."""


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
    """Return title and comments as lines that begin with "# "; empty ones are left out."""
    return [f"# {plain(line)}" for line in (title, *comments) if plain(line)]


def rows(values: ArrayLike) -> str:
    """Numbers (n, 3), a row per line, rounded to DIGITS decimals, never "-0"."""
    numbers = np.asarray(values, dtype=np.float64)
    if np.abs(numbers).max(initial=0.0) < EXACT:
        return _fixed_point(np.ascontiguousarray(numbers), DIGITS, False).tobytes().decode("ascii")
    numbers = np.round(numbers, DIGITS) + 0.0
    return (f"%.{DIGITS}f %.{DIGITS}f %.{DIGITS}f\n" * len(numbers)) % tuple(numbers.ravel().tolist())


def short_rows(values: Array, decimals: int) -> str:
    """Return numbers (n, m) below EXACT, a row per line, rounded to so many decimals, without idle zeros: ".5", "0"."""
    return _fixed_point(np.ascontiguousarray(values), decimals, True).tobytes().decode("ascii")


@compiled()
def _fixed_point(numbers: Array, decimals: int, short: bool) -> NDArray[np.uint8]:
    """The text of numbers (n, m) as bytes: twenty times as fast as Python's own formatting."""
    longest = 20  # characters of such a number, sign, point and what follows it included
    text = np.empty(numbers.size * longest, dtype=np.uint8)
    digits = np.empty(longest, dtype=np.uint8)
    at = 0
    for n in range(numbers.shape[0]):
        for c in range(numbers.shape[1]):
            left = np.int64(np.rint(abs(numbers[n, c]) * 10.0**decimals))
            if left > 0 and numbers[n, c] < 0:
                text[at] = 45  # -
                at += 1
            idle = 0
            while short and idle < decimals and left % 10 == 0:
                left //= 10
                idle += 1
            count = idle
            while left > 0 or count < decimals or (count == decimals and (idle == decimals or not short)):
                digits[count] = 48 + left % 10
                left //= 10
                count += 1
            for place in range(count - 1, idle - 1, -1):
                if place == decimals - 1:
                    text[at] = 46  # .
                    at += 1
                text[at] = digits[place]
                at += 1
            text[at] = 10 if c == numbers.shape[1] - 1 else 32
            at += 1
    return text[:at]


def cube_of_rows(table: Array, size: tuple[int, int, int]) -> Array:
    """Rows whose red index advances first → (N_r, N_g, N_b, 3)."""
    r, g, b = size
    return np.ascontiguousarray(table.reshape(b, g, r, 3).transpose(2, 1, 0, 3))


def rows_of_cube(values: Array) -> Array:
    """Node values (N_r, N_g, N_b, 3) as rows (n, 3) whose red index advances first."""
    return np.ascontiguousarray(values.transpose(2, 1, 0, 3)).reshape(-1, 3)
