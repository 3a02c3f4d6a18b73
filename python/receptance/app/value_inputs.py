"""The values of an element of the campaign file as inputs, with their mistakes at the key."""

from __future__ import annotations

from functools import partial
from html import escape

from bokeh.layouts import column, row
from bokeh.models import Div, LayoutDOM, TextInput

from receptance.app import look
from receptance.app.view import PageOfView
from receptance.session.values import FileValue, values_of

_WIDTH = 240
"""Width of an input in pixels."""


class ValueInputs:
    """Inputs of an element; what is typed changes the text of the document, and the file when it is saved."""

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        self._inputs: dict[FileValue, tuple[TextInput, Div]] = {}
        self._is_shown = False
        self._mistakes = look.text(role="status")
        self._groups = column(sizing_mode="stretch_width")
        self.layout = column(self._mistakes, self._groups, sizing_mode="stretch_width")

    def choose(self, assembly: str, element: str) -> None:
        """Show the values of an element of an assembly; inputs of the same keys stay, with their focus."""
        document = self._session.document
        values = [] if document is None else values_of(document, assembly, element)
        old = {value.path: pair for value, pair in self._inputs.items()}
        if list(old) == [value.path for value in values]:
            self._inputs = {value: old[value.path] for value in values}
        else:
            self._inputs = {value: self._input(value) for value in values}
            self._groups.children = self._grouped()
        self._show()

    def _input(self, value: FileValue) -> tuple[TextInput, Div]:
        made = TextInput(title=value.key, value=value.text, width=_WIDTH)
        made.on_change("value", lambda attr, old, new: self._typed(value, new))
        mistake = Div(text="", width=_WIDTH, margin=(0, 5, 0, 5), html_attributes={"role": "status"})
        return made, mistake

    def _grouped(self) -> list[LayoutDOM]:
        groups: dict[str, list[LayoutDOM]] = {}
        for value, pair in self._inputs.items():
            groups.setdefault(value.owner, []).append(column(*pair, width=_WIDTH + 10))
        children: list[LayoutDOM] = []
        for owner, inputs in groups.items():
            inner = row(*inputs, sizing_mode="stretch_width", css_classes=["wrap"])
            children += [look.text(f"<h2>{escape(owner)}</h2>"), inner]
        return children

    def _show(self) -> None:
        document = self._session.document
        self._is_shown = True
        at_keys: set[str] = set()
        for value, (made, mistake) in self._inputs.items():
            made.value = value.text
            issues = [] if document is None else value.mistakes(document)
            at_keys.update(map(str, issues))
            mistake.text = "".join(f'<p class="bad">{escape(issue.text)}</p>' for issue in issues)
            mistake.visible = bool(issues)
        others = [] if document is None else [str(issue) for issue in document.mistakes if str(issue) not in at_keys]
        self._mistakes.text = f'<div class="bad">{look.items(others)}</div>' if others else ""
        self._is_shown = False

    def _typed(self, value: FileValue, text: str) -> None:
        document = self._session.document
        if self._is_shown or document is None:
            return
        try:
            changed = document.with_value(value.path, value.parsed(text))
        except ValueError as error:
            self._page.say(str(error))
            return
        self._page.later(partial(self._session.edit, changed))
