"""The compact text of a config's LUT files is what OpenColorIO would write."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from lutforge.luts.formats import clf
from lutforge.luts.ops import Cube, Curve, Matrix, Range
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import Lut
from lutforge.ocio.renderings import compact_text


def lut(size: int = 5) -> Lut:
    """A sequence with every kind of array: of one curve and of three, of matrices with and without offsets, a cube."""
    even, rng = np.linspace(0.0, 1.0, 4096)[:, None].repeat(3, axis=1), np.random.default_rng(1)
    bent = Curve(even ** [2.0, 1.5, 1.0], -0.5, 2.0)
    ops = (
        Matrix(2.0 * np.eye(3)),
        Range(),
        Curve(even**2),
        bent,
        Matrix(np.eye(3)),
        Cube(rng.random((size,) * 3 + (3,))),
    )
    return Lut(ops, "of all kinds", ("told",))


def test_the_compact_text_is_that_of_opencolorio(tmp_path: Path) -> None:
    own, compact = clf.text_of(lut()), compact_text(lut())
    empty = (re.sub(r">[^<]*</Array>", "></Array>", text) for text in (compact, own))
    ours, theirs = (ElementTree.canonicalize(text) for text in empty)
    assert ours == theirs  # the identifier and the sizes of arrays too
    for name, text in (("compact", compact), ("own", own)):
        (tmp_path / f"{name}.clf").write_text(text)
    read, expected = (read_lut(tmp_path / f"{name}.clf").ops for name in ("compact", "own"))
    for op, wanted in zip(read, expected, strict=True):
        for name, numbers in vars(wanted).items():
            if isinstance(numbers, np.ndarray):
                np.testing.assert_allclose(getattr(op, name), numbers, rtol=0, atol=1.1e-6)
