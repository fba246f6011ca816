"""Sessions that outlive their tabs: kept by visitor, and offered when one comes back."""

from collections.abc import Callable
from dataclasses import dataclass

from lutforge.studio.session import Session

MOST_KEPT = 3


@dataclass(eq=False)
class _Held:
    """A session. is_shown: whether a browser is connected to its page."""

    visitor: str
    session: Session
    is_shown: Callable[[], bool]


class KeptSessions:
    """All sessions of a server that are shown, and of those whose tab is closed the last few with anything in them."""

    def __init__(self) -> None:
        self._held: list[_Held] = []

    def add(self, visitor: str, session: Session, is_shown: Callable[[], bool]) -> None:
        """Hold a session that a new page of a visitor shows."""
        self._held = [held for held in self._held if held.session is not session]
        self._held.append(_Held(visitor, session, is_shown))

    def left_by(self, visitor: str) -> Session | None:
        """The last session of a visitor that has something in it and that no tab shows."""
        left = (held for held in reversed(self._held) if held.visitor == visitor and not held.is_shown())
        return next((held.session for held in left if not held.session.is_empty), None)

    def leave(self, session: Session, is_shown: Callable[[], bool]) -> None:
        """Keep a session whose page is gone, unless another page shows it by now."""
        held = next((held for held in self._held if held.session is session), None)
        if held is None or held.is_shown is not is_shown:
            return
        session.detach()
        held.is_shown = lambda: False
        left = [each for each in self._held if not each.is_shown()]
        empty = [each for each in left if each.session.is_empty]
        full = [each for each in left if not each.session.is_empty]
        for old in (*empty, *full[:-MOST_KEPT]):
            old.session.close()
            self._held.remove(old)
