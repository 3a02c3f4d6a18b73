"""The page of a campaign in the output of a cell of a notebook, with the server of the command line."""

from __future__ import annotations

import asyncio
from html import escape
from pathlib import Path
from urllib.parse import urlencode

from receptance.app.server import page_server
from receptance.errors import ReceptanceError

HEIGHT = 900
"""Height of the page in a cell, in pixels."""


class NotebookPage:
    """The page of a campaign, served by the kernel of a notebook until `close` or the end of the kernel.

    Attributes
    ----------
    address : str
        Address of the page, which the machine of the kernel can open.
    """

    def __init__(self, file: Path, *, threads: int | None = None) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            raise ReceptanceError(
                f"a page is shown by a notebook, and this is none; in a terminal: receptance open {file.parent}"
            ) from None
        # It does not end with its last tab: notebooks remove outputs that are scrolled away, and show them again.
        self._server, address = page_server(file.parent, ended=lambda: None, threads=threads)
        self.address = f"{address}?{urlencode({'file': file.name})}"

    def close(self) -> None:
        """End the server; the page stays as it is and answers no more."""
        self._server.stop()

    def _repr_mimebundle_(self, **options: object) -> dict[str, str]:
        # What IPython.display.IFrame shows, without the need of IPython.
        frame = f'<iframe src="{escape(self.address)}" title="receptance" width="100%" height="{HEIGHT}"></iframe>'
        return {"text/html": frame, "text/plain": repr(self)}

    def __repr__(self) -> str:
        return f"NotebookPage({self.address!r})"
