"""Buttons that begin calculations, with what the campaign lacks for them, and one that stops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM

from receptance.app import look
from receptance.app.view import PageOfView


class Commands:
    """Buttons of commands by the names that `Session.missing` has for them: labels, and what they begin."""

    def __init__(self, page: PageOfView, commands: Mapping[str, tuple[str, Callable[[], None]]], stop: str) -> None:
        self._page, self._session = page, page.session
        self._buttons = {
            name: look.button(label, partial(self._begin, call), primary=True)
            for name, (label, call) in commands.items()
        }
        self._stop = look.button(stop, page.session.stop, width=210 if len(stop) > len("Diagnose") else 110)
        self._missing = look.text()
        self.layout: LayoutDOM = column(
            row(*self._buttons.values(), self._stop), self._missing, sizing_mode="stretch_width"
        )
        page.session.on("document", "work", call=self.show)
        self.show()

    def _begin(self, call: Callable[[], None]) -> None:
        try:
            call()
        except ValueError as error:
            self._page.say(str(error))

    def show(self) -> None:
        """Show what can be begun, what is missing, and whether something can be stopped."""
        session = self._session
        runs, missing = session.work is not None, session.missing
        for name, button in self._buttons.items():
            button.disabled = runs or session.campaign is None or bool(missing.get(name))
        self._stop.disabled = not runs
        lacking = {name: missing.get(name, "") for name in self._buttons}
        self._missing.text = look.items(f"{name}: {text}" for name, text in lacking.items() if text)
        self._missing.visible = bool(self._missing.text)
