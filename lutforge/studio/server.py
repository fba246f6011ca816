"""Serve the studio: one session a visitor, on this computer alone unless told otherwise."""

import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel as pn
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.web import ErrorHandler, OutputTransform

from lutforge.errors import LutForgeError
from lutforge.studio.folders import Folders
from lutforge.studio.jobs import warm_up
from lutforge.studio.page import Page
from lutforge.studio.theme import CSS

LOCAL = "127.0.0.1"
EVERYWHERE = "0.0.0.0"


def origins(address: str, port: int) -> list[str]:
    """The hosts under whose names the page may be asked for, and whose pages may open its websocket."""
    names = [address]
    if address in (LOCAL, "localhost"):
        names = [LOCAL, "localhost"]
    elif address == EVERYWHERE:
        own = socket.gethostname()
        names = [LOCAL, "localhost", own, socket.getfqdn(), *socket.gethostbyname_ex(own)[2]]
    return [f"{name.lower()}:{port}" for name in dict.fromkeys(names)]


def _refuse_other_hosts(application: Any, hosts: list[str]) -> None:
    """Answer nobody who calls this server by another name: a foreign page may have its own name resolve to here."""
    find = application.find_handler

    def find_handler(request: Any, **options: Any) -> Any:
        if request.host.lower() not in hosts:
            return application.get_handler_delegate(request, ErrorHandler, {"status_code": 403})
        return find(request, **options)

    application.find_handler = find_handler


class ContentSecurityPolicy(OutputTransform):
    """Lets a page run its own scripts alone: no script that stands in a name, and nothing from another place.

    Bokeh's and Panel's own code is made of strings ('unsafe-eval') and modules of blobs; its scripts in the page get
    the page's number (nonce), which no text that is shown can know. https://www.w3.org/TR/CSP3/
    """

    def __init__(self, request: HTTPServerRequest) -> None:
        self.host = request.host

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        """Number the scripts of a page, and state the policy."""
        number = secrets.token_urlsafe(16)
        if headers.get("Content-Type", "").startswith("text/html"):
            chunk = chunk.replace(b"<script", f'<script nonce="{number}"'.encode())
            if "Content-Length" in headers:
                headers["Content-Length"] = str(len(chunk))
        headers["Content-Security-Policy"] = "; ".join(
            (
                "default-src 'self'",
                f"script-src 'self' 'unsafe-eval' blob: 'nonce-{number}'",
                "style-src 'self' 'unsafe-inline'",
                "img-src 'self' data: blob:",
                "font-src 'self' data:",
                f"connect-src 'self' ws://{self.host} blob: data:",
                "worker-src 'self' blob:",
                "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
            )
        )
        return status_code, headers, chunk


def _free_port(address: str) -> int:
    with socket.socket() as probe:
        probe.bind((address, 0))
        return int(probe.getsockname()[1])


def serve(
    folders: Folders,
    inputs: tuple[Path, ...],
    address: str,
    port: int,
    show: bool,
    ready: Callable[[str], None] = lambda url: None,
) -> None:
    """Serve until interrupted.

    inputs: opened in each new session; port: 0 for any that is free; ready: is told the address of the page.

    Raises LutForgeError where the address or port cannot be had.
    """
    pn.extension(raw_css=[CSS], notifications=False, theme="dark")

    def page() -> Any:
        made = Page(folders, inputs)
        if pn.state.curdoc is not None:
            pn.state.curdoc.on_session_destroyed(lambda context: made.session.close())
        return made.layout

    try:
        port = port or _free_port(address)
        server = pn.serve(
            {"/": page},
            address=address,
            port=port,
            websocket_origin=origins(address, port),
            show=False,
            start=False,
            verbose=False,
            title="LutForge studio",
            websocket_max_message_size=64 << 20,
        )
    except OSError as error:
        raise LutForgeError(
            f"{address}:{port}: cannot serve here ({error.strerror or error}); choose another --port"
        ) from error
    _refuse_other_hosts(server._tornado, origins(address, port))
    server._tornado.transforms.append(ContentSecurityPolicy)
    warm_up()
    url = f"http://{address}:{server.port}/"
    server.io_loop.add_callback(lambda: ready(url))
    if show:
        server.io_loop.add_callback(lambda: server.show("/"))
    server.run_until_shutdown()
