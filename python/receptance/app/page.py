"""The page of one tab: its views, the state in its address, and calculations that it polls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from bokeh.document import Document as BokehDocument
from bokeh.events import DocumentReady
from bokeh.layouts import column, row
from bokeh.models import Button, ColumnDataSource, CustomJS, LayoutDOM, TabPanel, Tabs

from receptance.app import look
from receptance.app.ask_view import AskView
from receptance.app.file_view import FileView
from receptance.app.model_view import ModelView
from receptance.app.start_view import StartView, upload_limit
from receptance.app.use_view import UseView
from receptance.app.view import View
from receptance.session.document import CAMPAIGN_FILE, ConflictError
from receptance.session.state import Session

_POLL_MS = 200
"""Time between two looks at a running calculation in ms."""
_ADDRESS = "history.replaceState(null, '', '?' + cb_obj.data.query[0])"
_ASK_BEFORE_LEAVING = "window.onbeforeunload = cb_obj.disabled ? null : event => event.preventDefault();"
_TURN = """const query = new URLSearchParams(location.search);
query.set('theme', query.get('theme') == 'dark' ? 'light' : 'dark'); location.search = query;"""


class CampaignPage:
    """The views of a tab.

    `query` is the state in the address: the open view, the theme and what the views keep there.
    """

    def __init__(
        self, doc: BokehDocument, folder: Path, query: Mapping[str, str], *, threads: int | None = None
    ) -> None:
        self.doc, self.query = doc, dict(query)
        self.session = Session(folder, threads=threads)
        self.status = look.status()
        self._address = ColumnDataSource({"query": [""]})
        self._address.js_on_change("data", CustomJS(code=_ADDRESS))
        dark = self.query.get("theme") == "dark"
        doc.theme, doc.title, doc.template = look.theme(dark), "receptance", look.template()
        doc.template_variables.update(dark=dark, c=look.palette(dark))
        self._open(self.query.get("file", CAMPAIGN_FILE))
        self._when_shown: dict[str, Callable[[], None]] = {}
        document, trial = self.session.document, self.session.trial
        start = "start" if document is None else "file" if trial is None else "model"
        names = ("start", "model", "ask", "use", "file")
        asked = self.query.get("view", start)
        self.query["view"] = asked if asked in names else start
        views: list[View] = [StartView(self), ModelView(self), AskView(self), UseView(self), FileView(self)]
        self.views = dict(zip(names, views, strict=True))
        panels = [TabPanel(title=view.title, child=view.layout) for view in views]
        self.tabs = Tabs(tabs=panels, active=names.index(self.query["view"]), sizing_mode="stretch_width")
        self.tabs.on_change("active", lambda attr, old, new: self._turn_to(names[new]))
        self.tabs.js_on_change("active", look.labels(), CustomJS(args={"address": self._address}, code=""))
        self.tabs.js_on_change("active", upload_limit())
        doc.js_on_event(DocumentReady, look.labels(), upload_limit())
        doc.add_root(column(self._header(), self.status.layout, self.tabs, sizing_mode="stretch_width"))
        doc.add_periodic_callback(self._poll, _POLL_MS)

    def _open(self, file: str) -> None:
        try:
            self.session.open(file)
        except FileNotFoundError:
            pass  # an empty folder: the page begins with its files
        except (OSError, ValueError) as error:
            self.say(str(error))

    def _header(self) -> LayoutDOM:
        self._name = look.text()
        self._save: Button = look.button("Save", self._saved, primary=True)
        # A reload or a closed tab would lose what is not saved: the browser asks.
        self._save.js_on_change("disabled", CustomJS(code=_ASK_BEFORE_LEAVING))
        turn = Button(label="Light / dark", width=110)
        turn.js_on_click(CustomJS(code=_TURN))
        self.session.on("document", call=self._show_name)
        self._show_name()
        return row(self._name, self._save, turn, sizing_mode="stretch_width")

    def _show_name(self) -> None:
        document = self.session.document
        campaign = self.session.campaign
        title = "receptance" if campaign is None else escape(campaign.title)
        name = "" if document is None else f"{escape(document.file.name)}{', not saved' if document.is_changed else ''}"
        self._name.text = f"<h1>{title} <small>{name}</small></h1>"
        self._save.disabled = document is None or not document.is_changed
        if document is not None and document.file.is_relative_to(self.session.folder):
            file = document.file.relative_to(self.session.folder).as_posix()
            self.remember(file="" if file == CAMPAIGN_FILE else file)

    def _saved(self) -> None:
        try:
            self.session.save()
            self.say("saved")
        except (ConflictError, OSError) as error:
            self.say(str(error))

    def say(self, text: str) -> None:
        """Show a line of text below the header."""
        self.status.show(escape(text))

    def remember(self, **state: str) -> None:
        """Keep state in the address; empty values are left out."""
        self.query = {name: value for name, value in {**self.query, **state}.items() if value}
        self._address.data = {"query": [urlencode(self.query)]}

    def turn_to(self, view: str) -> None:
        """Show another view by its name."""
        self.tabs.active = list(self.views).index(view)

    def later(self, call: Callable[[], Any], milliseconds: int = 0) -> None:
        """Call a function in the next turn of the server's loop, or after a time; threads may call this."""
        if milliseconds:
            self.doc.add_timeout_callback(call, milliseconds)
        else:
            self.doc.add_next_tick_callback(call)

    @property
    def shown(self) -> str:
        """Name of the view that is open."""
        return self.query["view"]

    def when_shown(self, view: str, call: Callable[[], None]) -> None:
        """Call a function when a view is opened."""
        self._when_shown[view] = call

    def _turn_to(self, view: str) -> None:
        self.remember(view=view)
        self._when_shown.get(view, lambda: None)()

    def _poll(self) -> None:
        work = self.session.work
        if work is None:
            return
        if self.session.finish() is None:
            self.say(f"{work.name}: {work.progress} ({work.seconds:.0f} s)")
        elif work.error is not None:
            self.say(f"{work.name}: {work.error}")
        else:
            self.say(f"{work.name}: stopped" if work.stopped else f"{work.name}: done in {work.seconds:.1f} s")

    def close(self) -> None:
        """End what runs, when the tab is closed."""
        self.session.stop()
