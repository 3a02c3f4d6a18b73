"""The view "Model": sliders beside the records with the model, and the assembly to scale with its mode shapes."""

from __future__ import annotations

from bokeh.layouts import column, row
from bokeh.models import TabPanel, Tabs

from receptance.app import look
from receptance.app.assembly_view import AssemblyView
from receptance.app.controls import Controls
from receptance.app.records_view import RecordsView
from receptance.app.view import PageOfView

_FOLLOW_MS = 60
"""Time after a move at which modes, shapes and the drawing follow; moves until then are shown together."""
_PARTS = ("records", "assembly")


class ModelView:
    """The view "Model"."""

    title = "Model"

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        self._misfit = look.status()
        self._controls = Controls(page.session, page.say, page.later)
        self._records = RecordsView(page)
        self._assembly = AssemblyView(page)
        panels = [
            TabPanel(title="Records", child=self._records.layout),
            TabPanel(title="Assembly", child=self._assembly.layout),
        ]
        shown = page.query.get("show", _PARTS[0])
        self._tabs = Tabs(
            tabs=panels, active=_PARTS.index(shown) if shown in _PARTS else 0, sizing_mode="stretch_width"
        )
        self._tabs.on_change("active", lambda attr, old, new: self._turn(new))
        self._tabs.js_on_change("active", look.labels())
        self._is_following = False
        self.layout = row(
            self._controls.layout,
            column(self._misfit.layout, self._tabs, sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )
        self._session.on("document", "identified", call=self._reset)
        self._session.on("trial", call=self._show)
        self._reset()

    def _turn(self, part: int) -> None:
        self._page.remember(show="" if part == 0 else _PARTS[part])
        self._follow()

    def _reset(self) -> None:
        self._controls.reset()
        self._records.reset()
        self._assembly.reset()
        self._show_misfit()

    def _show(self) -> None:
        self._controls.show()
        self._records.show()
        self._show_misfit()
        if not self._is_following:
            self._is_following = True
            self._page.later(self._follow, _FOLLOW_MS)

    def _follow(self) -> None:
        """Show modes, or drawing and shapes, whichever is visible."""
        self._is_following = False
        (self._assembly.show if self._tabs.active else self._records.show_modes)()

    def _show_misfit(self) -> None:
        trial = self._session.trial
        if trial is None or trial.misfit is None:
            self._misfit.show("")
            return
        self._misfit.show(f"misfit {trial.misfit:.3g} (1 is the noise)")
