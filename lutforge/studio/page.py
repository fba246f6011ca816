"""The page of one visitor, its looks, and its server: one session a visitor, on this computer alone unless told."""

import gc
import secrets
import socket
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote, urlsplit

import panel as pn
import panel_material_ui as pmui
from panel.custom import JSComponent
from panel.io.resources import LOCAL_DIST
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import ErrorHandler, OutputTransform

from lutforge.errors import LutForgeError
from lutforge.studio import ui
from lutforge.studio.jobs import warm_up
from lutforge.studio.kept_sessions import KeptSessions
from lutforge.studio.opening import Folders
from lutforge.studio.session import Session
from lutforge.studio.ui import HERE

State = Literal["to do", "done", "stale"]
STEPS = ("Shots", "Samples", "Model", "Look", "Export")
ICONS = {"done": "check_circle", "to do": "radio_button_unchecked", "stale": "sync_problem"}


class Page:
    """Steps are made when they are first looked at, and drawn again when the session has changed since."""

    def __init__(self, folders: Folders, inputs: tuple[Path, ...], session: Session | None = None) -> None:
        """Make the page of a visitor.

        session: one that goes on, whose own page is closed.
        """
        goes_on = session is not None
        self.session = Session(folders) if session is None else session
        if goes_on:
            self.session.attach()
        self.pages: dict[str, Any] = {}
        self.shown = self.session.step
        self._stale = set(STEPS)
        self.session.on_change, self.session.on_look = lambda: self._refresh(*STEPS), self._tell
        self.steps = pmui.StepperMenu(non_linear=True, sizing_mode="stretch_width", margin=(6, 12))
        self.session.watch(lambda: self.show(STEPS[self.steps.active]), self.steps, of="active")
        self.undo = self.session.button("Undo", self.session.undo, variant="text")
        self.redo = self.session.button("Redo", self.session.redo, variant="text")
        self.next = ui.text(margin=(6, 12))
        self.offer = ui.text(visible=False)
        keys = Keys(self)
        bar = pn.Row(self.steps, sizing_mode="stretch_width")
        what = pn.Row(self.next, self.undo, self.redo, keys, sizing_mode="stretch_width")
        status = self.session.status
        news = pn.Row(status.pane, status.progress, self.session.cancel, sizing_mode="stretch_width", height=40)
        self.controls = pn.Column(sizing_mode="stretch_width")
        self.body = pn.Column(**ui.FILL)
        watchers = _watchers_of_busy()
        self.layout = pmui.Page(
            title="LutForge studio", header=[bar], sidebar=[self.controls],
            main=[pn.Column(self.offer, what, news, self.body, **ui.FILL)], sidebar_variant="permanent",
            sidebar_width=290, sidebar_resizable=False, busy_indicator=None, theme="dark", theme_toggle=False,
            theme_config=THEME, template=TEMPLATE, stylesheets=[BESIDE],
        )  # fmt: skip
        for watcher in _watchers_of_busy() - watchers:  # by which Panel would keep each page for ever
            pn.state.param.unwatch(watcher)
        self.show(self.shown)
        if inputs and not goes_on:
            self.session.guarded(self.session.open)(inputs)

    def show(self, name: str) -> None:
        """Look at a step."""
        self.shown = self.session.step = name
        self.session.forget_error()
        if name not in self.pages:  # imported here: the first paint does not wait for what only later steps draw
            module = import_module(f"lutforge.studio.{name.lower()}_page")
            self.pages[name] = getattr(module, f"{name}Page")(self.session)
        shown = self.pages[name]
        self.controls[:], self.body[:] = shown.controls, [shown.main]
        if self.steps.active != STEPS.index(name):
            self.steps.active = STEPS.index(name)
        self._refresh()

    def _refresh(self, *stale: str) -> None:
        """Draw what is shown, if it has changed since, and note the steps that have."""
        self._stale.update(stale)
        self._tell()
        if self.shown in self._stale or self.shown == "Export":
            self._stale.discard(self.shown)
            with self.session.setting():
                self.pages[self.shown].refresh()

    def _tell(self) -> None:
        """The steps' states, and what to do in this one."""
        states = states_of(self.session)
        self.steps.items = [{"label": f"{step}: {states[step]}", "icon": ICONS[states[step]]} for step in STEPS]
        self.offer.visible = self.offer.visible and self.session.is_empty
        self.next.object = ui.html("<b>{}.</b> {}", self.shown, NEXT[self.shown])
        last, following = self.session.history.last(self.shown), self.session.history.next(self.shown)
        self.undo.param.update(disabled=last is None, label="Undo" if last is None else f"Undo {last.name}"[:70])
        self.redo.param.update(
            disabled=following is None, label="Redo" if following is None else f"Redo {following.again}"[:70]
        )

    def offer_to_continue(self, left: Session | None) -> None:
        """Ask whether to go on with a session that was left, where there is one and nothing is open here."""
        if left is not None and left is not self.session and self.session.is_empty:
            self.offer.param.update(object=offer_of(left), visible=True)

    def reset(self, name: str) -> None:
        """Set a slider of the step that is seen, by its name, to what it was made with."""
        for widget in self.controls.select(pmui.FloatSlider):
            if widget.label and name.startswith(widget.label) and not widget.disabled and hasattr(widget, "usual"):
                widget.value = widget.usual


class Keys(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """Keys that work in every step: Ctrl+Z, Ctrl+Shift+Z; and the double click that resets a slider."""

    _esm = (HERE / "keys.js").read_text(encoding="utf-8")

    def __init__(self, page: "Page") -> None:
        super().__init__(width=0, height=0, margin=0)
        undo, redo, reset = (
            page.session.guarded(action) for action in (page.session.undo, page.session.redo, page.reset)
        )
        self._undo, self._redo, self._reset = undo, redo, reset

    def _handle_msg(self, data: Any) -> None:
        """Do what a key of the page asks for."""
        match data:
            case {"do": "undo"}:
                self._undo()
            case {"do": "redo"}:
                self._redo()
            case {"do": "reset", "name": str(name)}:
                self._reset(name)


def _watchers_of_busy() -> set[Any]:
    return set(pn.state.param.watchers.get("busy", {}).get("value", ()))


def offer_of(left: Session) -> ui.Html:
    """The question whether to continue a session, with the link that does."""
    return ui.html("<p><b><a href='?continue'>Continue where you were</a></b>: {}</p>", str(left))


NEXT = {
    "Shots": "Drop RAW files with their JPEGs here, or choose a folder; then press Sample.",
    "Samples": "Keep saturated and clipped colours from the response by the filters, or mark samples with the lasso.",
    "Model": "Press Compute: the lattice is what most want; or fit stage by stage.",
    "Look": "Choose a photograph, and the style and white balance that you want.",
    "Export": "Write what your program needs: a kit, a LUT, a config. Each line can be run again as a command.",
}
"""What to do in each step."""


def states_of(session: Session) -> dict[str, State]:
    """Each step's state."""
    workspace, profile, stale = session.workspace, session.profile, session.is_stale
    old = any(map(session.is_old, session.written.values()))
    seen = session.look_chosen and not session.is_unseen and profile is not None
    return {
        "Shots": "to do" if workspace is None and profile is None else "done",
        "Samples": "to do" if workspace is None else "done",
        "Model": "stale" if stale else "to do" if profile is None else "done",
        "Look": "to do" if not seen else "stale" if stale else "done",
        "Export": "to do" if not session.written else "stale" if old else "done",
    }  # fmt: skip


# --- The page's looks: neutral greys, in which colours can be judged --------------------------------------------------


def _root(**style: Any) -> dict[str, Any]:
    return {"styleOverrides": {"root": style}}


# On the border of its field at any size of letters; the toolkit's own 9 px are for letters of 16.
OUTLINED = {"&.MuiInputLabel-shrink": {"transform": "translate(14px, -0.5625rem) scale(0.75)"}}
BAR = {"boxShadow": "none", "borderBottom": "1px solid #4a4a4a", "backgroundImage": "none"}
WHITE = {"color": "#e6e6e6 !important"}
THEME = {
    "typography": {"fontFamily": "system-ui, sans-serif", "fontSize": 13, "h3": {"fontSize": "0.95rem"}},
    "shape": {"borderRadius": 4},
    "components": {
        "MuiButton": {**_root(textTransform="none", transition="none"), "defaultProps": {"disableElevation": True}},
        "MuiToggleButton": _root(textTransform="none", color="inherit", whiteSpace="nowrap"),
        "MuiInputLabel": {"styleOverrides": {"root": {"transition": "none", "color": "inherit"}, "outlined": OUTLINED}},
        "MuiSlider": {"styleOverrides": {"thumb": {"transition": "none"}, "track": {"transition": "none"}}},
        "MuiLinearProgress": {"defaultProps": {"aria-label": "Busy"}},
        "MuiAppBar": _root(backgroundColor="#1c1c1c", color="#e6e6e6", **BAR),
        "MuiDrawer": {"styleOverrides": {"paper": {"width": "max(280px, 17rem) !important"}}},
        "MuiStepLabel": {"styleOverrides": {"label": WHITE, "iconContainer": {"& .MuiIcon-root": WHITE}}},
    },
    "palette": {
        "primary": {"main": "#e6e6e6", "contrastText": "#1c1c1c"},
        "text": {"primary": "#e6e6e6", "secondary": "#bdbdbd", "disabled": "#a0a0a0"},
        "background": {"default": "#1c1c1c", "paper": "#262626"},
        "error": {"main": "#ff8a80"},
    },
}

CSS = (HERE / "page.css").read_text(encoding="utf-8")

BESIDE = """
.sidebar { padding-top: 0.5rem; }
nav { width: max(290px, 17.6rem) !important; }
main.main { width: calc(100% - max(290px, 17.6rem)) !important; }
"""
"""The page beside its controls, whose width grows with the letters."""

TEMPLATE = (HERE / "page.html").read_text(encoding="utf-8")
"""The page as served: its scripts wait, so that something is painted before they are read."""


# --- The server -------------------------------------------------------------------------------------------------------

LOCAL = "127.0.0.1"
EVERYWHERE = "0.0.0.0"


def origins(address: str, port: int) -> list[str]:
    """The hosts under whose names the page may be asked for, and whose pages may open its websocket."""
    names = [address]
    if address in (LOCAL, "localhost"):
        names = [LOCAL, "localhost"]
    elif address == EVERYWHERE:
        host = socket.gethostname()
        names = [LOCAL, "localhost", host, socket.getfqdn(), *socket.gethostbyname_ex(host)[2]]
    return [f"{name.lower()}:{port}" for name in dict.fromkeys(names)]


COOKIE = "lutforge_visitor"
"""The name of the cookie that says which sessions are a visitor's own."""

MOST_UNCONNECTED = 4
"""Pages that were asked for and that no browser has connected to yet; the oldest of more are ended."""


def refused(request: HTTPServerRequest, hosts: Sequence[str]) -> int | None:
    """The HTTP status by which a request is refused, None where it is answered.

    Pages of other places may neither load the studio nor embed it, whatever they call this computer; and no path is
    read that no file system has. https://www.w3.org/TR/fetch-metadata/
    """
    if request.host.lower() not in hosts:
        return 403
    origin = request.headers.get("Origin")
    if origin is not None and urlsplit(origin).netloc.lower() not in hosts:
        return 403
    if request.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
        return 403
    path = unquote(request.path)
    if "\0" in path or path.rstrip("/").endswith("/autoload.js"):
        return 404
    return None


def discard_unconnected(application: Any) -> None:
    """End the sessions of pages that no browser connected to, but for the newest."""
    for context in application._applications.values():
        waiting = [session for session in context.sessions if not session.connection_count]
        waiting.sort(key=lambda session: session.milliseconds_since_last_unsubscribe)
        for session in waiting[MOST_UNCONNECTED:]:
            session.request_expiration()
    IOLoop.current().add_callback(application._cleanup_sessions)


class ContentSecurityPolicy(OutputTransform):
    """Lets a page run its own scripts alone: no script that stands in a name, and nothing from another place.

    Bokeh's and Panel's own code is made of strings ('unsafe-eval') and modules of blobs; its scripts in the page get
    the page's number (nonce), which no text that is shown can know. https://www.w3.org/TR/CSP3/
    """

    def __init__(self, request: HTTPServerRequest) -> None:
        self.host = request.host
        self.new_visitor = getattr(request, "new_visitor", "")

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        """Number the scripts of a page, and state the policy."""
        number = secrets.token_urlsafe(16)
        if headers.get("Content-Type", "").startswith("text/html"):
            chunk = chunk.replace(b"<script", f'<script nonce="{number}"'.encode())
            if "Content-Length" in headers:
                headers["Content-Length"] = str(len(chunk))
            if self.new_visitor:
                headers.add("Set-Cookie", f"{COOKIE}={self.new_visitor}; Path=/; HttpOnly; SameSite=Strict")
        headers["Content-Security-Policy"] = (
            f"default-src 'self'; script-src 'self' 'unsafe-eval' blob: 'nonce-{number}'; "
            "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
            f"connect-src 'self' ws://{self.host} blob: data:; worker-src 'self' blob:; "
            "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        return status_code, headers, chunk


def serve(
    folders: Folders,
    inputs: tuple[Path, ...],
    address: str,
    port: int,
    show: bool,
    ready: Callable[[str], None] = lambda url: None,
) -> None:
    """Serve until interrupted. Raises LutForgeError where the address or port cannot be had.

    inputs: opened in each new session; port: 0 for any that is free; ready: is told the address of the page.
    """
    pn.extension(raw_css=[CSS], notifications=False, theme="dark")

    kept = KeptSessions()

    def page() -> Any:
        document = pn.state.curdoc
        if document is None:
            return Page(folders, inputs).layout
        # A page that is slow to load comes back to a session of its own, for which Panel would name another server.
        document.template_variables["dist_url"] = LOCAL_DIST
        visitor = pn.state.cookies.get(COOKIE, "")
        goes_on = kept.left_by(visitor) if "continue" in pn.state.session_args else None
        made = Page(folders, inputs, goes_on)
        # A tab that is loaded again leaves its session only once this page has come.
        pn.state.onload(made.session.guarded(lambda: made.offer_to_continue(kept.left_by(visitor))))

        def is_shown() -> bool:
            context = document.session_context
            session = None if context is None else context.session
            return session is not None and bool(session.connection_count)

        kept.add(visitor, made.session, is_shown)
        document.on_session_destroyed(lambda context: kept.leave(made.session, is_shown))
        return made.layout

    try:
        if not port:
            with socket.socket() as probe:
                probe.bind((address, 0))
                port = int(probe.getsockname()[1])
        server = pn.serve(
            {"/": page}, address=address, port=port, websocket_origin=origins(address, port), show=False, start=False,
            verbose=False, title="LutForge studio", websocket_max_message_size=64 << 20,
        )  # fmt: skip
    except OSError as error:
        raise LutForgeError(
            f"{address}:{port}: cannot serve here ({error.strerror or error}); choose another --port"
        ) from error
    hosts, application = origins(address, port), server._tornado
    find = application.find_handler

    def find_handler(request: HTTPServerRequest, **options: Any) -> Any:
        if (status := refused(request, hosts)) is not None:
            return application.get_handler_delegate(request, ErrorHandler, {"status_code": status})
        if COOKIE not in request.cookies:  # of this visitor alone, whose sessions it names
            request.new_visitor = secrets.token_urlsafe(16)  # type: ignore[attr-defined]  # read by the policy below
            request.cookies[COOKIE] = request.new_visitor  # type: ignore[attr-defined]
        if request.path == "/":
            discard_unconnected(application)
        return find(request, **options)

    application.find_handler = find_handler
    application.transforms.append(ContentSecurityPolicy)
    warm_up()
    gc.collect()
    gc.freeze()  # what is loaded stays, and need not be searched each time a page ends
    url = f"http://{address}:{server.port}/"
    server.io_loop.add_callback(lambda: ready(url))
    if show:
        server.io_loop.add_callback(lambda: server.show("/"))
    server.run_until_shutdown()
