"""The forms of LUTs: which sequences of operations a file format can hold."""

from typing import Literal, get_args

Form = Literal["full", "shaper", "plain"]
"""The sequences that a format holds: "full" any, "shaper" a curve per channel and a cube, "plain" a cube alone."""

FORMS: tuple[Form, ...] = get_args(Form)

HELD: dict[Form, str] = {
    "full": "any sequence of operations",
    "shaper": "one curve per channel and one cube after it",
    "plain": "one cube",
}
"""The forms in words, for messages."""

MAX_SIZE = 129
"""Most nodes per axis that OpenColorIO reads."""
