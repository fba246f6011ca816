"""Sessions that outlive their tabs: kept by visitor, and offered when one comes back."""

from collections.abc import Callable
from dataclasses import dataclass

from lutforge.studio.session import Session

MOST_KEPT = 3


def _never() -> bool:
    return False


@dataclass(eq=False)
class _Held:
    """A session. is_shown: whether a browser is connected to its page; was_shown: whether one ever was."""

    visitor: str
    session: Session
    is_shown: Callable[[], bool]
    was_shown: bool = False


class KeptSessions:
    """The sessions of a server: those that are shown, and the last few with anything in them whose tab is closed."""

    def __init__(self) -> None:
        self._held: list[_Held] = []

    def add(self, visitor: str, session: Session, is_shown: Callable[[], bool]) -> None:
        """Hold a session that a new page of a visitor will show."""
        was_shown = any(held.was_shown for held in self._held if held.session is session)
        self._held = [held for held in self._held if held.session is not session]
        self._held.append(_Held(visitor, session, is_shown, was_shown))

    def show(self, session: Session) -> None:
        """Note that a browser has loaded the page of a session."""
        for held in self._held:
            held.was_shown = held.was_shown or held.session is session

    def left_by(self, visitor: str) -> Session | None:
        """The last session of a visitor that has something in it and that no tab shows any more."""
        left = [
            held.session
            for held in self._held
            if held.visitor == visitor and held.was_shown and not held.is_shown() and not held.session.is_empty
        ]
        return left[-1] if left else None

    def leave(self, session: Session, is_shown: Callable[[], bool]) -> None:
        """Keep a session whose page is gone, unless another page shows it by now, or will."""
        held = next((held for held in self._held if held.session is session), None)
        if held is None or held.is_shown is not is_shown:
            return
        session.detach()
        held.is_shown = _never
        gone = [held for held in self._held if held.is_shown is _never]
        full = [held for held in gone if held.was_shown and not held.session.is_empty]
        for old in gone:
            if old not in full[-MOST_KEPT:]:
                old.session.close()
                self._held.remove(old)
