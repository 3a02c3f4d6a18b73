"""The view "Model": the assembly to scale, the records with the model, and the sliders that move it."""

from __future__ import annotations

from bokeh.layouts import column, row

from receptance.app import look
from receptance.app.controls import Controls
from receptance.app.records_view import RecordsView
from receptance.app.view import PageOfView


class ModelView:
    """The view "Model"."""

    title = "Model"

    def __init__(self, page: PageOfView) -> None:
        self._session = page.session
        self._misfit = look.status()
        self._controls = Controls(page.session, page.say, page.later)
        self._records = RecordsView(page.session, page.remember, page.query.get("quantity", ""))
        self.layout = row(
            self._controls.layout,
            column(self._misfit, self._records.layout, sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )
        self._session.on("document", "identified", call=self._reset)
        self._session.on("trial", call=self._show)
        self._reset()

    def _reset(self) -> None:
        self._controls.reset()
        self._records.reset()
        self._show_misfit()

    def _show(self) -> None:
        self._controls.show()
        self._records.show()
        self._show_misfit()

    def _show_misfit(self) -> None:
        trial = self._session.trial
        if trial is None or trial.misfit is None:
            self._misfit.text = ""
            return
        self._misfit.text = f"misfit {trial.misfit:.3g} (1 is the noise)"
