"""The server of the studio: for this computer alone unless told, and closed to pages of other places."""

import gc
import secrets
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import panel as pn
from panel.io.resources import LOCAL_DIST
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import ErrorHandler, OutputTransform

from lutforge.errors import LutForgeError
from lutforge.studio.folders import Folders
from lutforge.studio.jobs import warm_up
from lutforge.studio.kept_sessions import KeptSessions
from lutforge.studio.page import Page
from lutforge.studio.theme import CSS
from lutforge.studio.thumbnails import ROUTE, ThumbnailHandler

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
    """Header that lets a page run the studio's own scripts only: none in a file's name, none of another site.

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
    try:
        port = port or _free_port(address)
        server = pn.serve(
            {"/": lambda: _page_of_visitor(folders, inputs, kept)}, address=address, port=port,
            websocket_origin=origins(address, port), show=False, start=False, verbose=False, title="LutForge studio",
            websocket_max_message_size=64 << 20, extra_patterns=[(ROUTE, ThumbnailHandler, {"folders": folders})],
        )  # fmt: skip
    except OSError as error:
        raise LutForgeError(
            f"{address}:{port}: cannot serve here ({error.strerror or error}); choose another --port"
        ) from error
    _guard(server._tornado, origins(address, port))

    warm_up()
    gc.collect()
    gc.freeze()  # what is loaded stays, and need not be searched each time a page ends
    url = f"http://{address}:{server.port}/"
    server.io_loop.add_callback(lambda: ready(url))
    if show:
        server.io_loop.add_callback(lambda: server.show("/"))
    try:
        server.run_until_shutdown()
    finally:
        gc.unfreeze()  # what is never searched would be reported as leaked by the libraries that it is of


def _free_port(address: str) -> int:
    """Return a port that is free. Raises OSError."""
    with socket.socket() as probe:
        probe.bind((address, 0))
        return int(probe.getsockname()[1])


def _page_of_visitor(folders: Folders, inputs: tuple[Path, ...], kept: KeptSessions) -> Any:
    """The layout of a new page, whose session is kept for the visitor when the page is closed."""
    document = pn.state.curdoc
    if document is None:
        return Page(folders, inputs).layout
    # A page that is slow to load comes back to a session of its own, for which Panel would name another server.
    document.template_variables["dist_url"] = LOCAL_DIST
    visitor = pn.state.cookies.get(COOKIE, "")
    continued = kept.left_by(visitor) if "continue" in pn.state.session_args else None
    shown = Page(folders, inputs, continued)

    def loaded() -> None:
        """Offer what was left: a tab that is loaded again leaves its session only once this page has come."""
        shown.ready()
        kept.show(shown.session)
        shown.offer_to_continue(kept.left_by(visitor))

    pn.state.onload(shown.session.page.guarded(loaded))

    def is_shown() -> bool:
        context = document.session_context
        session = None if context is None else context.session
        return session is not None and bool(session.connection_count)

    kept.add(visitor, shown.session, is_shown)
    document.on_session_destroyed(lambda context: kept.leave(shown.session, is_shown))
    return shown.layout


def _guard(application: Any, hosts: Sequence[str]) -> None:
    """Let an application refuse requests that are not for its hosts, and give each new visitor a cookie."""
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
