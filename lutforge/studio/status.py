"""The line of a page that says what happens: news, errors, and how far work has come."""

from html import escape
from typing import Any

from lutforge.studio import ui


class StatusLine:
    """News and errors as text, whatever they hold; `share` of the work under way.

    News replace news. An error stays above them until the visitor has acted since, or its job runs again.
    """

    def __init__(self) -> None:
        self.pane = ui.text(margin=(0, 12), height=40)
        self.progress = ui.text(visible=False, sizing_mode="fixed", width=200, height=24, margin=(4, 8))
        self._news = ""
        self._errors: dict[str, str] = {}  # by the title of the job, "" of what the visitor did

    @property
    def object(self) -> Any:
        """The HTML that is shown."""
        return self.pane.object

    def say(self, message: str, wrong: bool = False, job: str = "") -> None:
        """Show news, or what is wrong. job: the title of the job that failed; "" for an act of the visitor."""
        line = " ".join(message.split())[:400]
        if wrong:
            self._errors.pop(job, None)
            self._errors[job] = line
            self._news = ""
        else:
            self._news = line
        self._draw()

    def take(self, line: "StatusLine") -> None:
        """Show what another line has said last."""
        self._news = line._news
        self._errors = dict(line._errors)
        self._draw()

    def forget_errors(self, *jobs: str) -> None:
        """Take away the errors of jobs by their titles, "" for those of what the visitor did; by default all."""
        self._errors = {job: error for job, error in self._errors.items() if jobs and job not in jobs}
        self._draw()

    def _draw(self) -> None:
        """Show the last error, and below it the news."""
        error = next(reversed(self._errors.values()), "")
        style = "color:var(--mui-palette-error-main);font-weight:600"
        wrong = f'<div role="alert" style="{style}">{escape(error)}</div>' if error else ""
        self.pane.object = f'{wrong}<div role="status">{escape(self._news)}</div>'

    def show_share(self, share: float) -> None:
        """Show how far the work under way has come, 0 … 1."""
        bar = "<progress aria-label='done' value='{}' style='width:100%'></progress>"
        self.progress.object = ui.html(bar, f"{share:.2f}")
