"""Sessions that outlive their tabs: kept by visitor, and offered when one comes back."""

from collections.abc import Callable
from dataclasses import dataclass

from lutforge.studio.session import Session

MOST_KEPT = 3


def _never() -> bool:
    return False


@dataclass(eq=False)
class _KeptSession:
    """A session. is_shown: whether a browser is connected to its page; was_shown: whether one ever was."""

    visitor: str
    session: Session
    is_shown: Callable[[], bool]
    was_shown: bool = False


class KeptSessions:
    """The sessions of a server: those that are shown, and the last few with anything in them whose tab is closed."""

    def __init__(self) -> None:
        self._kept: list[_KeptSession] = []

    def add(self, visitor: str, session: Session, is_shown: Callable[[], bool]) -> None:
        """Keep a session that a new page of a visitor will show."""
        was_shown = any(kept.was_shown for kept in self._kept if kept.session is session)
        self._kept = [kept for kept in self._kept if kept.session is not session]
        self._kept.append(_KeptSession(visitor, session, is_shown, was_shown))

    def show(self, session: Session) -> None:
        """Note that a browser has loaded the page of a session."""
        for kept in self._kept:
            kept.was_shown = kept.was_shown or kept.session is session

    def left_by(self, visitor: str) -> Session | None:
        """The last session of a visitor that has something in it and that no tab shows any more."""
        abandoned = [
            kept.session
            for kept in self._kept
            if kept.visitor == visitor and kept.was_shown and not kept.is_shown() and not kept.session.is_empty
        ]
        return abandoned[-1] if abandoned else None

    def leave(self, session: Session, is_shown: Callable[[], bool]) -> None:
        """Keep a session whose page is gone, unless another page shows it by now, or will."""
        kept = next((entry for entry in self._kept if entry.session is session), None)
        if kept is None or kept.is_shown is not is_shown:
            return
        session.detach()
        kept.is_shown = _never
        gone = [entry for entry in self._kept if entry.is_shown is _never]
        full = [entry for entry in gone if entry.was_shown and not entry.session.is_empty]
        for old in gone:
            if old not in full[-MOST_KEPT:]:
                old.session.close()
                self._kept.remove(old)
