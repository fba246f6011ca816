"""Shots: files by dropping, by a list or by their path; what each shot gave; brackets and their responses."""

from base64 import b64encode
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from numpy.typing import NDArray
from PIL import Image

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.vignetting import vignetting_of
from lutforge.pipeline.response import Bracket, FittedResponse
from lutforge.pipeline.response_request import ResponseRequest
from lutforge.pipeline.sampling import file_notes
from lutforge.reports.figures import bracket_figure
from lutforge.reports.tables import exposure_time, response_table
from lutforge.samples.chart import chart_names
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet
from lutforge.studio import ui
from lutforge.studio.opening import OPENED_SUFFIXES
from lutforge.studio.results import open_files, take_response
from lutforge.studio.session import Session
from lutforge.studio.workspace import Workspace, WorkspaceError

EMPTY = (
    "No shots yet. To calibrate a camera takes five photographs or more, each as RAW with its JPEG, inside the RAW "
    "file or beside it; without RAW, JPEGs of one scene at several exposures."
)
CARDS = """
:host > div > div { display: grid !important; grid-template-columns: repeat(auto-fill, minmax(min(100%, 24rem), 1fr));
  gap: 12px; padding: 6px; }
"""
"""Cards beside each other, as many as have room, which fill the width; the box is the one inside of Panel's."""

FIT = "Name the chart, if the pictures show one, and press Fit response; untick a picture to leave it out."


class ShotsPage:
    """The page of the first step: files to open, shots as cards, brackets and their responses."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._drawn: tuple[object, ...] | None = None
        self.papers: dict[str, pmui.Paper] = {}  # by shot: its box and its card
        self.drop = pmui.FileInput(label="Drop RAW and JPEG files here", multiple=True, sizing_mode="stretch_width")
        self.drop.param.watch(session.page.guarded(lambda event: self._take()), "value")
        self.listed = ui.select("Folder or file", ui.NOTHING)
        self.path = ui.entry("or its path")
        self.notes = ui.text()
        self.grid = pn.FlexBox(sizing_mode="stretch_width", stylesheets=[CARDS])
        session.page.watch(lambda: self.path.param.update(value="", value_input=""), self.listed)
        session.page.watch(self._open, self.path, of="enter_pressed")
        sample = session.page.button("Sample", self._open, variant="contained", **ui.FULL_WIDTH)
        again = session.page.button("List again", self.list_files, variant="text", **ui.FULL_WIDTH)
        self.chart = ui.select("Chart in the pictures", {"none": "", **{name: name for name in chart_names()}})
        self.light = ui.entry("Light on the chart", value="D50")
        self.corners = ui.entry("Its corners, where it is not found", placeholder="x,y x,y x,y x,y")
        self.times = ui.entry("Exposure times, where not stated", placeholder="1/60,1/30,1/15")
        self.all_colours = ui.checkbox("Count saturated colours, too")
        session.page.watch(self._enable, self.chart)
        fit = session.page.button("Fit response", self._fit, variant="contained", **ui.FULL_WIDTH)
        self.bracket = pn.Column(
            self.chart, self.light, self.corners, self.times, self.all_colours, fit, visible=False, **ui.TOGETHER
        )
        self.controls = [self.drop, self.listed, self.path, sample, again, self.bracket, self.notes]
        self.remembered = (self.listed, self.path, self.chart, self.light, self.corners, self.times, self.all_colours)
        self.curves = ui.Figures()
        self.findings = ui.text(**ui.SCROLLED)
        self.response = pn.Row(self.curves.layout, self.findings, visible=False, **{**ui.FILL, "min_height": 260})
        self.main = pn.Column(self.response, pn.Column(self.grid, **ui.SCROLLED), **ui.FILL)
        self._enable()
        self.list_files()

    def list_files(self) -> None:
        """The folders with shots, and the files that can be opened, as they are now."""
        folders = self.session.folders
        shots = folders.with_shots()
        files = folders.files(OPENED_SUFFIXES)
        named = {f"{folders.roots[0].name}, this folder" if name == "." else name: name for name in (*shots, *files)}
        chosen = self.listed.value
        with self.session.page.setting():
            self.listed.options = {**ui.NOTHING, **named}
            self.listed.value = chosen if chosen in named.values() else "." if "." in shots else ""

    def _open(self) -> None:
        named = ui.written(self.path) or self.listed.value
        dropped = self.session.dropped.folder("shots") if not named else None
        open_files(self.session, (dropped or self.session.folders.inside(named),))

    def _take(self) -> None:
        """Keep what was dropped in a folder of this visit, and sample it."""
        names: Any = self.drop.filename
        if not self.drop.value or not names:
            return
        dropped = self.session.dropped.keep("shots", names, self.drop.value)
        with self.session.page.setting():
            self.listed.value = ""
            self.path.param.update(value="", value_input="")
        open_files(self.session, (dropped[0].parent,))

    def _enable(self) -> None:
        self.light.disabled = self.corners.disabled = not self.chart.value
        self.all_colours.disabled = bool(self.chart.value)

    def _fit(self) -> None:
        bracket = self.session.opened.bracket
        assert bracket is not None
        files = tuple(file for file in bracket.files if file.name not in self.session.state.pictures_out)
        chart = self.chart.value
        times = ui.written(self.times)
        light, corners = (ui.written(line) if chart else "" for line in (self.light, self.corners))
        request = ResponseRequest(files, times, "", not chart and self.all_colours.value, chart, light, corners)
        if len(files) < 2:
            raise WorkspaceError("a response needs two pictures or more: take some in again")

        def done(fitted: FittedResponse) -> None:
            if self.session.opened.bracket is bracket:
                take_response(self.session, request, fitted)

        self.session.work.start("response", done, ResponseRequest.fit, request, None)

    def refresh(self) -> None:
        """Draw what the session has opened."""
        session = self.session
        bracket = self.session.opened.bracket
        workspace = session.workspace
        profile = session.profile
        self.bracket.visible = bracket is not None
        self.response.visible = session.response is not None
        if session.response is not None and profile is not None:
            fit = session.response[1].fit
            self.curves.show(bracket_figure(fit))
            notes = ui.paragraphs(*dict.fromkeys((*fit.statements, fit.verdict.words, *profile.notes)))
            self.findings.object = ui.html("{}{}", notes, ui.table(response_table(fit)))
        drawn = (bracket, None if workspace is None else workspace.samples, profile)
        if drawn != self._drawn:
            self._drawn = drawn
            if bracket is not None:
                self._draw(dict(self._cards_of_bracket(bracket)))
            else:
                self._draw({} if workspace is None else dict(self._cards(workspace, profile)))
        left_out = (
            set(session.state.pictures_out) if bracket is not None else workspace.left_out_shots if workspace else set()
        )
        for name, paper in self.papers.items():
            with session.page.setting():
                paper[0].value = name not in left_out
        unused = (f"not used: {line}" for line in session.opened.left_out[:20])
        untick = "Untick a shot to leave it out. " if self.papers else ""
        known = "" if profile is not None or workspace is None else "The vignetting is known once a model is computed."
        hint = untick + known if bracket is None else f"{bracket}. {FIT}"
        self.notes.object = ui.paragraphs(hint, *file_notes(session.opened.accounts), *unused)

    def _draw(self, cards: dict[str, ui.Html]) -> None:
        """A card a shot: a box to take it in or leave it out, its pictures, and what is known of it.

        A shot keeps its box and its card, of which the text alone changes: no click falls into their redrawing.
        """
        papers = {}
        for name, card in cards.items():
            if name in self.papers:
                self.papers[name][1].object = card
                papers[name] = self.papers[name]
            else:
                box = ui.checkbox(name, True)
                self.session.page.watch(lambda: self.session.page.on_change(), box, take=self._leave_out)
                papers[name] = pmui.Paper(box, ui.text(card), variant="outlined", sizing_mode="stretch_width", margin=0)
        if not papers or list(papers) != list(self.papers):
            self.grid[:] = list(papers.values()) or [ui.text(ui.paragraphs(EMPTY))]
        self.papers = papers

    def _leave_out(self, ticked: bool) -> None:
        out = frozenset(name for name, paper in self.papers.items() if not paper[0].value)
        if self.session.opened.bracket is not None:
            self.session.state = replace(self.session.state, pictures_out=tuple(out))
        if self.session.workspace is not None and out != self.session.workspace.left_out_shots:
            news = f"{len(out)} shots left out" if out else "all shots take part"
            self.session.commit_workspace(replace(self.session.workspace, left_out_shots=out), news)
            self.session.page.say(news)

    def _cards(self, workspace: Workspace, profile: CameraProfile | None) -> Iterator[tuple[str, ui.Html]]:
        accounts = {account.shot: account for account in self.session.opened.accounts}
        for name, samples in workspace.samples.by_shot():
            account = accounts.get(name)
            cells = None if account is None else account.cells
            pictures = {} if cells is None else {"JPEG": cells.picture, "RAW": cells.raw}
            yield name, card_of(name, pictures, facts_of(name, samples, account, profile))

    def _cards_of_bracket(self, bracket: Bracket) -> Iterator[tuple[str, ui.Html]]:
        """A card a picture: its exposure as stated and as it was."""
        fitted = None if self.session.response is None else self.session.response[1]
        least = np.nanmin([*bracket.exposure_s, np.inf])
        for file, exposure in zip(bracket.files, bracket.exposure_s, strict=True):
            known = f"exposure × {exposure / least:.4g}, as stated"
            facts = [known if np.isfinite(exposure) else "exposure not stated"]
            if fitted is not None:
                errors = fitted.fit.exposure_error
                facts += [f"true / stated: {errors[file.name]:.3f}"] if file.name in errors else []
                facts += ["chart found here"] if file.name in fitted.found else []
                facts += [f"white beside the chart: {fitted.level[file.name]:.3g}"] if file.name in fitted.level else []
            yield file.name, card_of(file.name, {}, facts)


def card_of(name: str, pictures: dict[str, NDArray[np.uint8]], facts: list[str]) -> ui.Html:
    """Pictures (h, w, 3) by title beside each other, above what is known."""
    images = []
    for title, picture in pictures.items():
        buffer = BytesIO()
        Image.fromarray(np.ascontiguousarray(picture)).save(buffer, format="JPEG", quality=92)
        url = "data:image/jpeg;base64," + b64encode(buffer.getvalue()).decode("ascii")
        image = ui.html("<img src='{}' alt='{} of {}'>", url, title, name)
        images.append(ui.html("<figure>{}<figcaption>{}</figcaption></figure>", image, title))
    shown = ui.html("<div class=pictures>{}</div>", ui.Html("".join(images))) if images else ui.Html("")
    return ui.html("{}{}", shown, ui.paragraphs(*facts))


def facts_of(name: str, samples: SampleSet, account: ShotSamples | None, profile: CameraProfile | None) -> list[str]:
    """Facts of a shot, a line each: settings, samples and vignetting."""
    time = float(samples.exposure_s[0])
    balance = samples.white_balance[0]
    seconds = f", {exposure_time(time)}" if np.isfinite(time) else ""
    facts = [f"{samples.style[0]}/{balance}{seconds}", f"{len(samples):,} samples"]
    if account is not None:
        facts = [facts[0], account.summary.removeprefix(f"{account.shot}: ")]
    if profile is not None:
        lens = vignetting_of(
            profile.vignettings, str(samples.lens[0]), float(samples.focal_mm[0]), float(samples.aperture[0])
        )
        facts += [f"vignetting: corners {lens.corner_ev:+.2f} EV"] if lens is not None else []
    return facts
