"""What text LUT formats share.

Those that are written have plain ASCII comments and fixed-point numbers. Those that are read come from strangers: there
are limits, and errors name file, line and text.
"""

import unicodedata
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.compiled import compiled
from lutforge.errors import LutError

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


MOST_NODES = 256
"""Most nodes per axis of a cube that is looked at."""
MOST_ENTRIES = 1 << 20
"""Most entries of a curve."""
LARGEST = 1e30
"""The largest number that is read: near the end of what float32 holds, so that interpolation would overflow."""


class Lines:
    """The lines of a file that are neither empty nor comments: texts, and their line numbers from 1; comments apart."""

    def __init__(self, path: Path, data: bytes, longest: int = 1024) -> None:
        self.path = path
        if b"\x00" in data[: 1 << 16]:
            raise LutError(f"{path}: not a text file, as a LUT with the suffix {path.suffix} is")
        text = data.decode("utf-8-sig", "replace").replace("\r\n", "\n").replace("\r", "\n")
        self.all = text.split("\n")
        self.numbers: list[int] = []
        self.texts: list[str] = []
        self.comments: list[str] = []
        for number, line in enumerate(self.all, 1):
            if len(line) > longest:
                raise self.error(number, line, f"a line of {len(line)} characters; no LUT has such")
            stripped = line.strip()
            if stripped.startswith("#"):
                self.comments.append(stripped.lstrip("# "))
            elif stripped:
                self.numbers.append(number)
                self.texts.append(stripped)

    def __len__(self) -> int:
        return len(self.texts)

    def error(self, number: int, text: str, cause: str) -> LutError:
        """One line with file, line number, the offending text, and the cause."""
        shown = "".join(c if c.isprintable() else "?" for c in text.strip()[:60])
        return LutError(f'{self.path}, line {number}: {cause}: "{shown}"')

    def at(self, index: int, what: str) -> str:
        """A line that must be there."""
        if index >= len(self.texts):
            raise LutError(f"{self.path}, line {len(self.all)}: the file ends before {what}")
        return self.texts[index]

    def wrong(self, index: int, cause: str) -> LutError:
        """Return the error that names a line, its text and a cause."""
        return self.error(self.numbers[index], self.texts[index], cause)

    def integers(self, index: int, words: list[str], low: int, high: int, what: str) -> list[int]:
        """Words of a line as integers within limits."""
        values = []
        for word in words:
            if not word.isascii() or not word.removeprefix("-").isdigit() or len(word) > 9:
                raise self.wrong(index, f"{what}: expected a whole number")
            if not low <= int(word) <= high:
                raise self.wrong(index, f"{what}: {word} is not within {low} to {high}")
            values.append(int(word))
        return values

    def floats(self, index: int, words: list[str], count: int, what: str) -> list[float]:
        """Words of a line as finite numbers."""
        if len(words) != count:
            raise self.wrong(index, f"{what}: expected {count} numbers, found {len(words)}")
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self.wrong(index, f"{what}: expected {count} numbers") from None
        if not np.all(np.isfinite(values)) or max(map(abs, values), default=0.0) > LARGEST:
            raise self.wrong(index, f"{what}: a number is not finite, or absurdly large")
        return values

    def table(self, start: int, count: int, width: int, what: str) -> Array:
        """`count` rows of `width` finite numbers from line index `start`: (count, width)."""
        rows = self.texts[start : start + count]
        try:
            if len(rows) < count:
                raise ValueError("too few")
            table = np.loadtxt(rows, dtype=np.float64, ndmin=2, comments=None)
            if table.shape == (count, width) and np.all(np.isfinite(table)) and np.abs(table).max() <= LARGEST:
                return table
        except (ValueError, OverflowError):
            pass
        for index in range(start, start + len(rows)):  # slowly, for the line at fault
            self.floats(index, self.texts[index].split(), width, what)
        raise LutError(
            f"{self.path}, line {len(self.all)}: {what}: expected {count} rows of {width} numbers, found {len(rows)}"
        )

    def codes(self, start: int, count: int, top: float, what: str) -> Array:
        """`count` rows of three whole numbers from 0 to `top` from line index `start`: (count, 3)."""
        table = self.table(start, count, 3, what)
        wrong = np.any((table < 0) | (table > top) | (table != np.rint(table)), axis=1)
        if wrong.any():
            limit = f" to {top:g}" if np.isfinite(top) else ""
            raise self.wrong(
                start + int(np.flatnonzero(wrong)[0]), f"a {self.path.suffix.lower()} holds whole numbers from 0{limit}"
            )
        return table


def cube_of_rows(table: Array, size: tuple[int, int, int]) -> Array:
    """Rows whose red index advances first → (N_r, N_g, N_b, 3)."""
    r, g, b = size
    return np.ascontiguousarray(table.reshape(b, g, r, 3).transpose(2, 1, 0, 3))


def rows_of_cube(values: Array) -> Array:
    """Node values (N_r, N_g, N_b, 3) as rows (n, 3) whose red index advances first."""
    return np.ascontiguousarray(values.transpose(2, 1, 0, 3)).reshape(-1, 3)


def is_numeric(text: str) -> bool:
    """True where a line begins like a number."""
    return not text.endswith("{") and (text[0] in "+-.0123456789" or text[:3].lower() in ("nan", "inf"))
