"""Numbers of text files are those that Python prints."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lutforge.luts.formats.text import DIGITS, EXACT, rows


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-2 * EXACT, 2 * EXACT)] * 3), max_size=4))
def test_numbers_are_written_as_python_does(numbers: list[tuple[float, float, float]]) -> None:
    numbers += [(0.0, -0.0, -1e-12), (1.0, 0.5, -123.25)]
    rounded = np.round(np.array(numbers), DIGITS) + 0.0
    assert rows(numbers) == "".join(f"{r:.10f} {g:.10f} {b:.10f}\n" for r, g, b in rounded.tolist())
