"""The history of a session: changes that can be undone, by the step in which they were made, each with a name."""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MOST_CHANGES = 200


class Undoable(Protocol):
    """A state whose changes can be undone one by one, whatever has changed since."""

    def exchanged(self, old: Self, new: Self) -> Self:
        """This state with what differs between two others, as the second of them has it."""


AnyState = TypeVar("AnyState", bound=Undoable)
Record = TypeVar("Record", bound="DataclassInstance")


@dataclass(frozen=True, eq=False)
class Change(Generic[AnyState]):
    """One change of a state. step: where it was made; before, after: the whole states.

    name, again: as Undo and Redo offer it; key: of the control that was moved, which its further moves share; whole:
    everything was replaced, so that no change of any step before it can be undone alone.
    """

    step: str
    before: AnyState
    after: AnyState
    name: str = ""
    again: str = ""
    key: str = ""
    whole: bool = False


class History(Generic[AnyState]):
    """Changes, oldest first. `undo` takes back the last one of a step, and leaves what other steps have changed."""

    def __init__(self) -> None:
        self.past: list[Change[AnyState]] = []
        self.future: list[Change[AnyState]] = []  # the next one last

    def add(self, change: Change[AnyState]) -> None:
        """Note a change; what was undone in its step is gone. Moves of one control are one change."""
        self.future = [undone for undone in self.future if undone.step != change.step]
        if change.whole:
            self.past, self.future = [], []
        before = self.before_move(change.step, change.key, change.before)
        if before is not change.before:
            self.past[-1] = replace(change, before=before)
        else:
            self.past = [*self.past[1 - MOST_CHANGES :], change]

    def before_move(self, step: str, key: str, now: AnyState) -> AnyState:
        """The state before the move of a control that is under way; `now` where none is, of which this is the first."""
        last = self.past[-1] if self.past else None
        return last.before if key and last is not None and (last.step, last.key) == (step, key) else now

    def end_move(self) -> None:
        """Let the next move of a control be a change of its own."""
        if self.past and self.past[-1].key:
            self.past[-1] = replace(self.past[-1], key="")

    def last(self, step: str) -> Change[AnyState] | None:
        """The change that `undo` takes back in a step."""
        return next((change for change in reversed(self.past) if change.step == step), None)

    def next(self, step: str) -> Change[AnyState] | None:
        """The change that `redo` makes again in a step."""
        return next((change for change in reversed(self.future) if change.step == step), None)

    def undo(self, step: str, now: AnyState) -> AnyState:
        """The state without the last change of a step."""
        change = self.last(step)
        if change is None:
            return now
        if change.whole:
            self.past, self.future = [], [replace(change, after=now)]
            return change.before
        self.past.remove(change)
        self.future.append(change)
        return now.exchanged(change.after, change.before)

    def redo(self, step: str, now: AnyState) -> AnyState:
        """The state with the change that was undone last in a step."""
        change = self.next(step)
        if change is None:
            return now
        if change.whole:
            self.past, self.future = [change], []
            return change.after
        self.future.remove(change)
        self.past.append(change)
        return now.exchanged(change.before, change.after)


def exchanged(now: Record, old: Record, new: Record) -> Record:
    """A record with what differs between two others of its class, field by field, as the second of them has it."""
    if now is old:
        return new
    moved: dict[str, Any] = {
        field.name: getattr(new, field.name)
        for field in fields(now)
        if getattr(old, field.name) is not getattr(new, field.name)
    }
    return replace(now, **moved)
