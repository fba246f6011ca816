"""The part of a session that Undo and Redo change."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from lutforge.pipeline.looks import ChosenLook
from lutforge.pipeline.response import FittedResponse
from lutforge.pipeline.response_request import ResponseRequest
from lutforge.studio.history import exchanged
from lutforge.studio.opening import Opened
from lutforge.studio.workspace import Workspace


@dataclass(frozen=True, eq=False)
class UndoableState:
    """The part of a session that Undo and Redo change, all of it in one record.

    opened: where the samples, the bracket and a profile that is not of this visit come from; chosen: the look that is
    shown, None before; look_chosen: whether the visitor chose it; look_controls: the values of the controls of Look, by
    name; pictures_out: the names of the pictures of a bracket that take no part; response: what was asked for and
    fitted to them.
    """

    workspace: Workspace | None = None
    opened: Opened = field(default_factory=Opened)
    chosen: ChosenLook | None = None
    look_chosen: bool = False
    look_controls: Mapping[str, Any] = field(default_factory=dict)
    pictures_out: tuple[str, ...] = ()
    response: tuple[ResponseRequest, FittedResponse] | None = None

    def exchanged(self, old: "UndoableState", new: "UndoableState") -> "UndoableState":
        """This state with what differs between two others, as the second of them has it.

        A workspace changes field by field, and Look control by control: what else they hold stays as it is here.
        """
        state = exchanged(self, old, new)
        moved = {name: value for name, value in new.look_controls.items() if old.look_controls.get(name) != value}
        state = replace(state, look_controls={**self.look_controls, **moved})
        if self.workspace is None or old.workspace is None or new.workspace is None:
            return state
        return replace(state, workspace=exchanged(self.workspace, old.workspace, new.workspace))
