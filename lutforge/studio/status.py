"""The line of a page that says what happens: news, errors, and how far work has come."""

from html import escape
from typing import Any

from lutforge.studio import ui


class StatusLine:
    """News and errors as text, whatever they hold; `share` of the work under way."""

    def __init__(self) -> None:
        self.pane = ui.text(margin=(2, 12), height=22)
        self.progress = ui.text(visible=False, sizing_mode="fixed", width=200, height=24, margin=(4, 8))
        self._wrong = False

    @property
    def object(self) -> Any:
        """The HTML that is shown."""
        return self.pane.object

    def say(self, message: str, wrong: bool = False) -> None:
        """Show one line."""
        self._wrong = wrong
        role = "alert" if wrong else "status"
        style = ' style="color:var(--mui-palette-error-main);font-weight:600"' if wrong else ""
        self.pane.object = f'<div role="{role}"{style}>{escape(" ".join(message.split())[:400])}</div>'

    def take(self, line: "StatusLine") -> None:
        """Show what another line has said last."""
        self._wrong = line._wrong
        self.pane.object = line.pane.object

    def forget_error(self) -> None:
        """Take away what was wrong, as the visitor does something else."""
        if self._wrong:
            self.say("")

    def show_share(self, share: float) -> None:
        """Show how far the work under way has come, 0 … 1."""
        bar = "<progress aria-label='done' value='{}' style='width:100%'></progress>"
        self.progress.object = ui.html(bar, f"{share:.2f}")
