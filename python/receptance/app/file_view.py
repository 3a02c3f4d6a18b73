"""The text of the campaign file with its mistakes, to be mended in place."""

from __future__ import annotations

from html import escape

from bokeh.layouts import column, row
from bokeh.models import TextAreaInput

from receptance.app import look
from receptance.app.view import PageOfView


class FileView:
    """The view "File"."""

    title = "File"

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        self._text = TextAreaInput(
            title="Campaign file", rows=34, cols=110, max_length=10_000_000, sizing_mode="stretch_width",
            css_classes=["mono"],
        )  # fmt: skip
        self._mistakes = look.text(role="status")
        self.layout = column(
            self._mistakes,
            row(look.button("Check", self._check, primary=True), look.button("Revert", self._revert)),
            self._text,
            sizing_mode="stretch_width",
        )
        # The browser sends the text when the input is left, also by a click on "Save".
        self._text.on_change("value", lambda attr, old, new: self._check())
        self._session.on("document", call=self.show)
        self.show()

    def show(self) -> None:
        """Show text and mistakes of the document."""
        document = self._session.document
        self._text.value = "" if document is None else document.text
        mistakes = () if document is None else document.mistakes
        if not mistakes:
            self._mistakes.text = ""
            return
        count = f"{len(mistakes)} mistake{'' if len(mistakes) == 1 else 's'}"
        self._mistakes.text = f"<b>{escape(count)}</b>{look.items(map(str, mistakes))}"

    def _check(self) -> None:
        document = self._session.document
        if document is not None and self._text.value != document.text:
            self._session.edit(document.with_text(self._text.value))
            if self._session.campaign is not None:
                self._page.say("the file has no mistakes")

    def _revert(self) -> None:
        document = self._session.document
        if document is not None:
            self._session.edit(document.with_text(document.saved))
