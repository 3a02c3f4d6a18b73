"""The view "Ask": identification, prediction and diagnosis, with progress, and what the campaign lacks for them."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import LayoutDOM, RadioGroup

from receptance.app import look, results
from receptance.app.commands import Commands
from receptance.app.records_view import RecordsView
from receptance.app.view import PageOfView
from receptance.diagnosis.model import UndecidableError
from receptance.diagnosis.presentation import held_out_table
from receptance.diagnosis.verdict import CandidateCause
from receptance.errors import ReceptanceError
from receptance.report import Result
from receptance.report.html import table_html
from receptance.session.state import Topic

_NAME = "ask"
_TITLES: dict[Topic, str] = {"verdict": "Diagnosis", "prediction": "Prediction", "identified": "Identification"}
_MOST_CAUSES = 10
"""Most causes whose curves can be chosen."""
_BASE = "none: the model as it is"


class AskView:
    """The view "Ask"."""

    title = "Ask"

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        session = self._session
        commands = {
            "identify": ("Identify", session.identify),
            "predict": ("Predict", session.predict),
            "diagnose": ("Diagnose", lambda: session.diagnose()),
        }
        self._commands = Commands(page, commands, "Stop with the answer so far")
        self._accepted = look.result()
        self._accepted.visible = False
        self._diagnosis = _Diagnosis(page, self._accept)
        self._prediction, self._identified = look.result(), look.result()
        self._choice = RadioGroup(labels=[], active=None, inline=True, visible=False)
        self._choice.on_change("active", lambda attr, old, new: self._choose())
        self._newest: list[Topic] = []
        exports = results.export_buttons
        self._parts: dict[Topic, LayoutDOM] = {
            "verdict": self._diagnosis.layout,
            "prediction": column(exports(session, lambda: session.prediction, page.say), self._prediction,
                                 sizing_mode="stretch_width"),
            "identified": column(exports(session, lambda: session.identified, page.say), self._identified,
                                 sizing_mode="stretch_width"),
        }  # fmt: skip
        self.layout = column(
            self._commands.layout, self._accepted, self._choice,
            *self._parts.values(), sizing_mode="stretch_width",
        )  # fmt: skip
        session.on("verdict", call=self._show_verdict)
        session.on("prediction", call=self._show_prediction)
        session.on("identified", call=self._show_identified)
        for topic in _TITLES:
            self._show(topic, None)

    def _show(self, topic: Topic, result: Result | None) -> None:
        """Show a new result, or remove one; the others can be chosen."""
        self._newest = [*([] if result is None else [topic]), *(other for other in self._newest if other != topic)]
        self._choice.visible = len(self._newest) > 1
        self._choice.active = None
        self._choice.labels = [_TITLES[shown] for shown in self._newest]
        self._choice.active = 0 if self._newest else None
        self._choose()

    def _choose(self) -> None:
        active = self._choice.active
        chosen = None if active is None else self._newest[active]
        for topic, layout in self._parts.items():
            layout.visible = topic == chosen

    def _show_verdict(self) -> None:
        verdict = self._session.verdict
        if verdict is not None:
            self._accepted.visible = False
        self._diagnosis.reset()
        self._show("verdict", verdict)

    def _show_prediction(self) -> None:
        result = self._session.prediction
        if result is not None:
            self._prediction.text = results.answer(result) + results.figure(result) + results.details(result)
        self._show("prediction", result)

    def _show_identified(self) -> None:
        result = self._session.identified
        if result is not None:
            self._identified.text = results.answer(result) + results.details(result)
        self._show("identified", result)

    def _accept(self) -> None:
        verdict = self._session.verdict
        try:
            document = self._session.accept()
        except (ValueError, ReceptanceError) as error:
            self._page.say(str(error))
            return
        self._session.edit(document)
        table = None if verdict is None else held_out_table(verdict).without_empty()
        gains = table_html(table) if table is not None and table.rows else ""
        self._accepted.text = f"<h2>{escape(document.file.name)}</h2>{gains}"
        self._accepted.visible = True
        self._page.say(f"{document.file.name} is open and not saved")


class _Diagnosis:
    """The verdict as a card, and the records with the causes that lead."""

    def __init__(self, page: PageOfView, accept: Callable[[], None]) -> None:
        self._page, self._session = page, page.session
        self._answer, self._details = look.result(), look.result()
        self._accept = look.button("Accept", accept, primary=True)
        self._causes = RadioGroup(
            labels=[], active=None, width=300, tags=["hover"], html_attributes={"aria-label": "cause"},
        )  # fmt: skip
        self._causes.on_change("active", self._choose)
        self._causes.js_on_change("labels", look.labels())
        self._records = RecordsView(page)
        exports = results.export_buttons(page.session, lambda: page.session.verdict, page.say)
        self.layout = column(
            self._answer,
            row(self._accept, exports),
            row(
                column(look.text("<b>Model with this cause</b>"), self._causes, width=310),
                self._records.layout,
                sizing_mode="stretch_width",
            ),
            self._details,
            sizing_mode="stretch_width",
        )
        page.when_shown(_NAME, self._show_records)
        page.session.on("trial", call=self._show_records)

    def reset(self) -> None:
        """Show another verdict, with the curves of its first cause."""
        verdict = self._session.verdict
        if verdict is None:
            return
        self._answer.text, self._details.text = results.answer(verdict), results.details(verdict)
        self._accept.disabled = verdict.explanation is None or not verdict.final
        leading = self._session.leading[:_MOST_CAUSES]
        self._causes.active = None
        self._causes.labels = [_BASE, *map(_label, leading)]
        self._records.reset()
        self._causes.active = 1 if leading else 0

    def _choose(self, attr: str, old: Any, new: int | None) -> None:
        if new is None or self._session.verdict is None:
            return
        try:
            self._session.show_cause(None if new == 0 else self._session.leading[new - 1])
        except (ValueError, ReceptanceError, UndecidableError) as error:
            self._page.say(str(error))

    def _show_records(self) -> None:
        # Curves of a view that is not open would delay those of the sliders.
        if self._session.verdict is not None and self._page.shown == _NAME:
            self._records.show()


def _label(cause: CandidateCause) -> str:
    return cause.title if cause.variant == "all" else f"{cause.title}, {cause.variant}"
