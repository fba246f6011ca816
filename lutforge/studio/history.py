"""The history of a session: changes that can be undone, by the step in which they were made, each with a name."""

from dataclasses import dataclass, fields, replace
from typing import Any

MOST_CHANGES = 200


@dataclass(frozen=True, eq=False)
class Change:
    """One change of a state. step: where it was made; name: as the way back is offered; key: of the control moved.

    before, after: the whole states, records of one class; those of a control that is moved on share a key.
    whole: everything was replaced, so that no change of any step before it can be undone alone.
    """

    step: str
    before: Any
    after: Any
    name: str = ""
    again: str = ""
    key: str = ""
    whole: bool = False


class History:
    """Changes, oldest first. `undo` takes back the last one of a step, and leaves what other steps have changed."""

    def __init__(self) -> None:
        self.past: list[Change] = []
        self.future: list[Change] = []  # the next one last

    def add(self, change: Change) -> None:
        """Note a change; what was undone in its step is gone. Moves of one control are one change."""
        self.future = [undone for undone in self.future if undone.step != change.step]
        if change.whole:
            self.past, self.future = [], []
        last = self.past[-1] if self.past else None
        if change.key and last is not None and (last.step, last.key) == (change.step, change.key):
            self.past[-1] = replace(change, before=last.before)
        else:
            self.past = [*self.past[1 - MOST_CHANGES :], change]

    def end_move(self) -> None:
        """Let the next move of a control be a change of its own."""
        if self.past and self.past[-1].key:
            self.past[-1] = replace(self.past[-1], key="")

    def last(self, step: str) -> Change | None:
        """The change that `undo` takes back in a step."""
        return next((change for change in reversed(self.past) if change.step == step), None)

    def next(self, step: str) -> Change | None:
        """The change that `redo` makes again in a step."""
        return next((change for change in reversed(self.future) if change.step == step), None)

    def undo(self, step: str, now: Any) -> Any:
        """The state without the last change of a step."""
        change = self.last(step)
        if change is None:
            return now
        if change.whole:
            self.past, self.future = [], [replace(change, after=now)]
            return change.before
        self.past.remove(change)
        self.future.append(change)
        return exchanged(now, change.after, change.before)

    def redo(self, step: str, now: Any) -> Any:
        """The state with the change that was undone last in a step."""
        change = self.next(step)
        if change is None:
            return now
        if change.whole:
            self.past, self.future = [change], []
            return change.after
        self.future.remove(change)
        self.past.append(change)
        return exchanged(now, change.before, change.after)


def exchanged(now: Any, old: Any, new: Any) -> Any:
    """A record with what differs between two records of its class, field by field, as in the second of them."""
    if now is old:
        return new
    moved = {
        field.name: getattr(new, field.name)
        for field in fields(now)
        if getattr(old, field.name) is not getattr(new, field.name)
    }
    return replace(now, **moved)
