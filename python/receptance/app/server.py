"""The server of a page: on this machine only, behind a random address, as long as a page is open.

The address has a random token as its first part; every other path is answered with 404, and websockets of other origins
are refused. Scripts come from the installed Bokeh, so that nothing is loaded from a network.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import Handler
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.document import Document as Page
from bokeh.events import DocumentReady
from bokeh.server.server import Server
from bokeh.server.urls import per_app_patterns
from bokeh.server.views.ws import WSHandler
from tornado.ioloop import IOLoop

from receptance.app.page import CampaignPage

HOST = "127.0.0.1"
LARGEST_UPLOAD = 100 << 20
"""Largest message of a browser in bytes: files that are dropped arrive in one."""
_UNOPENED_MS, _CHECKED_MS = 60_000, 500
"""Time that a browser has to load the page and connect, and between two checks, in ms."""
_RELOAD_S = 1.5
"""Time in s that a reload may take before the server of the last tab ends."""


class _AtOnce(WSHandler):  # type: ignore[misc]
    """A websocket that sends at once, and ends its session when it closes."""

    def open(self) -> None:
        self.set_nodelay(True)  # Nagle's algorithm delays each answer to a slider by 40 ms
        super().open()

    def on_close(self) -> None:
        if self.connection is not None:
            self.connection.session.request_expiration()  # those that wait for their browser have more time
        super().on_close()


class _Tabs(Handler):  # type: ignore[misc]
    """Makes the page of each tab, and calls `ended` after the last one is closed."""

    def __init__(self, folder: Path, ended: Callable[[], None], threads: int | None) -> None:
        super().__init__()
        self._folder, self._ended, self._threads = folder, ended, threads
        self._pages: dict[str, CampaignPage] = {}
        self._was_shown = False
        """Whether a browser has shown a page: one that only asked for it, such as a preview of links, ends nothing."""

    def modify_document(self, doc: Page) -> None:
        """Fill the page of a new tab."""
        context = doc.session_context
        arguments = {} if context is None else context.request.arguments
        query = {name: values[0].decode(errors="replace") for name, values in arguments.items() if values}
        page = CampaignPage(doc, self._folder, query, threads=self._threads)
        if context is not None:
            self._pages[str(context.id)] = page
        doc.on_event(DocumentReady, self._shown)

    def _shown(self, event: DocumentReady) -> None:
        self._was_shown = True

    async def on_session_destroyed(self, session_context: Any) -> None:
        """End the calculations of a tab, and the server with the last one."""
        page = self._pages.pop(str(session_context.id), None)
        if page is not None:
            page.close()
        if self._was_shown and not self._pages:
            IOLoop.current().call_later(_RELOAD_S, lambda: None if self._pages else self._ended())


def page_server(
    folder: Path, *, ended: Callable[[], None], port: int = 0, threads: int | None = None
) -> tuple[Server, str]:
    """Return a server of a folder in the running event loop, and the address of its page.

    Parameters
    ----------
    folder : Path
        The folder: no file outside of it is read or written.
    ended : callable
        Called after the last tab was closed.
    port : int, optional
        Port; by default a free one.
    threads : int, optional
        As in `Campaign.load`.
    """
    # Parts of a view that have nothing to show yet, and sources of figures that have no columns yet.
    silence(EMPTY_LAYOUT, True)
    logging.getLogger("bokeh.core.validation.check").setLevel(logging.CRITICAL)
    token = secrets.token_urlsafe(24)
    per_app_patterns[:] = [(path, _AtOnce if view is WSHandler else view) for path, view in per_app_patterns]
    tabs = _Tabs(folder, ended, threads)
    server = Server(
        {"/": Application(tabs)},
        io_loop=IOLoop.current(),
        address=HOST,
        port=port,
        prefix=token,
        session_token_expiration=60,
        websocket_max_message_size=LARGEST_UPLOAD,
        check_unused_sessions_milliseconds=_CHECKED_MS,
        unused_session_lifetime_milliseconds=_UNOPENED_MS,
        keep_alive_milliseconds=5000,
    )
    # Bokeh allows localhost by default; only the address that is printed is meant. With a free port it is known now.
    server._tornado._websocket_origins = {f"{HOST}:{server.port}"}
    server.start()
    return server, f"http://{HOST}:{server.port}/{token}/"


def serve(folder: Path, shown: Callable[[str], None], *, port: int = 0, threads: int | None = None) -> None:
    """Serve the page of a folder until its last tab is closed or Ctrl-C; `shown` gets the address."""

    async def served() -> None:
        ended = asyncio.Event()
        server, address = page_server(folder, ended=ended.set, port=port, threads=threads)
        try:
            shown(address)
            await ended.wait()
        finally:
            server.stop()

    with suppress(KeyboardInterrupt):
        asyncio.run(served())
