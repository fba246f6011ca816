"""The two directions of a camera: RAW → JPEG, and back."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar, get_args

Direction = Literal["render", "linearize"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Both(Generic[Value]):
    """One thing of each direction. render: white-balanced RAW → JPEG; linearize: JPEG → white-balanced RAW."""

    render: Value
    linearize: Value

    def __getitem__(self, direction: Direction) -> Value:
        return self.render if direction == "render" else self.linearize

    def __iter__(self) -> Iterator[Value]:
        return iter((self.render, self.linearize))

    def items(self) -> tuple[tuple[Direction, Value], ...]:
        """Each with its direction."""
        return (("render", self.render), ("linearize", self.linearize))
