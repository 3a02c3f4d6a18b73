"""Sliders of unknowns, overhangs, tolerances, further parameters and causes."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Checkbox, LayoutDOM, Select, Slider, TextInput

from receptance.app import look
from receptance.campaign import Trial
from receptance.diagnosis import CATALOGUE
from receptance.diagnosis.model import UndecidableError
from receptance.errors import ReceptanceError
from receptance.fit import Unknown
from receptance.fit.unknowns import Move
from receptance.session.state import Session

_STEPS = 400
"""Steps of a slider between its bounds."""
_NO_CAUSE = "no cause"
_DIGITS = 4


class _Control:
    """A slider of an unknown with its value and its box "hold"; logarithmic where the unknown is."""

    def __init__(
        self, unknown: Unknown, moved: Callable[[str, float], None], held: Callable[[str, bool], None], *, holds: bool
    ) -> None:
        self.unknown, self._moved = unknown, moved
        self._is_log = unknown.scale == "log"
        low, high = self._scaled(unknown.lower), self._scaled(unknown.upper)
        self._slider = Slider(
            start=low, end=high, value=low, step=(high - low) / _STEPS, show_value=False, title="", name=unknown.name,
            sizing_mode="stretch_width", tooltips=False, margin=(0, 12, 4, 8),
        )  # fmt: skip
        self._label = look.LiveText(classes=["label"])
        self._label.layout.margin = (4, 5, 0, 5)
        self._hold = Checkbox(label="hold", name=f"hold {unknown.name}", active=holds, width=56, margin=(4, 0, 0, 5))
        self._is_shown, self._value = False, math.nan
        self._slider.on_change("value", self._changed)
        self._hold.on_change("active", lambda attr, old, new: held(unknown.name, new))
        self.layout: LayoutDOM = column(
            row(self._label.layout, self._hold, sizing_mode="stretch_width"), self._slider, sizing_mode="stretch_width"
        )

    def _scaled(self, value: float) -> float:
        return math.log10(value) if self._is_log else value

    def _changed(self, attr: str, old: float, new: float) -> None:
        if not self._is_shown:
            value = 10.0**new if self._is_log else new
            self._moved(self.unknown.name, min(max(value, self.unknown.lower), self.unknown.upper))

    def show(self, trial: Trial) -> None:
        """Show the value of a trial, whether it came from the slider or not."""
        value = trial.values[self.unknown.name]
        if value == self._value:
            return
        self._is_shown, self._value = True, value
        scaled = self._scaled(value)
        if abs(scaled - self._slider.value) > 0.5 * self._slider.step:
            self._slider.value = scaled
        text = _value_text(trial, self.unknown)
        self._label.show(f"{escape(self.unknown.name)} <b>{escape(text)}</b>")
        self._slider.tags = [text]  # what a screen reader says
        self._is_shown = False


def _value_text(trial: Trial, unknown: Unknown) -> str:
    """Return a value with its unit: errors of tolerances in standard deviations, and what that changes."""
    value, effect = trial.values[unknown.name], trial.effect(unknown.name)
    change = "" if effect is None else _amount(*effect, sign="+")
    if trial.is_error(unknown.name):
        return f"{value:+.{_DIGITS}g} σ{f' ({change})' if change else ''}"
    return change or _amount(value, unknown.unit)


def _amount(value: float, unit: str, sign: str = "") -> str:
    """Return a value with its unit, lengths in mm."""
    scaled, shown = (1e3 * value, "mm") if unit == "m" else (value, unit)
    return f"{scaled:{sign}.{_DIGITS}g} {shown}".rstrip()


class Controls:
    """All sliders; the newest values are moved together once in each turn of the server's loop."""

    def __init__(
        self, session: Session, say: Callable[[str], None], later: Callable[[Callable[[], None]], Any]
    ) -> None:
        self._session, self._say, self._later = session, say, later
        self._pending: dict[str, float] = {}
        self._controls: dict[str, _Control] = {}
        self._sliders = column(sizing_mode="stretch_width")
        self._sliders.js_on_change("children", look.labels())
        causes = [(_NO_CAUSE, _NO_CAUSE), *((id, cause.title) for id, cause in CATALOGUE.items())]
        self._cause = Select(title="What would this do?", options=causes, value=_NO_CAUSE, sizing_mode="stretch_width")
        self._variant = Select(title="Where", options=[], visible=False, sizing_mode="stretch_width")
        self._address = TextInput(
            title="Another parameter, by its address", placeholder="holder.segment[0].length",
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._cause.on_change("value", self._choose_cause)
        self._variant.on_change("value", self._choose_variant)
        self._address.on_change("value", self._add_address)
        self.layout = column(
            row(look.button("Fit", self._fit, primary=True), look.button("Start values", self._restart)),
            self._cause,
            self._variant,
            self._address,
            self._sliders,
            width=360,
            styles={"max-height": "92vh", "overflow-y": "auto"},
        )

    def reset(self) -> None:
        """Make the sliders of the trial anew, in groups."""
        trial = self._session.trial
        groups = {} if trial is None else _groups(trial)
        self._controls, children = {}, []
        for heading, unknowns in groups.items():
            controls = {
                u.name: _Control(u, self._moved, self._hold, holds=u.name in self._session.held) for u in unknowns
            }
            if controls:
                children += [look.text(f"<h2>{escape(heading)}</h2>"), *(c.layout for c in controls.values())]
            self._controls |= controls
        self._sliders.children = children
        self.show()

    def show(self) -> None:
        """Show the values of the trial; after other unknowns, make the sliders anew."""
        trial = self._session.trial
        names = set() if trial is None else {unknown.name for unknown in trial.unknowns}
        acting = () if trial is None else trial.variants
        self._cause.value = acting[0].cause.id if len(acting) == 1 else _NO_CAUSE
        if names != self._controls.keys():
            self.reset()
        elif trial is not None:
            for control in self._controls.values():
                control.show(trial)

    def _moved(self, name: str, value: float) -> None:
        first = not self._pending
        self._pending[name] = value
        if first:
            self._later(self._move)

    def _move(self) -> None:
        values, self._pending = self._pending, {}
        self._said(partial(self._session.move, values))

    def _said(self, call: Callable[[], Any]) -> None:
        """Call, and show why it cannot be done."""
        try:
            call()
        except (ValueError, ReceptanceError, UndecidableError) as error:
            self._say(str(error))

    def _hold(self, name: str, active: bool) -> None:
        (self._session.held.add if active else self._session.held.discard)(name)

    def _fit(self) -> None:
        self._said(self._session.fit)

    def _restart(self) -> None:
        self._said(self._session.restart)

    def _choose_cause(self, attr: str, old: str, new: str) -> None:
        trial = self._session.trial
        if trial is None or new == (trial.variants[0].cause.id if trial.variants else _NO_CAUSE):
            return
        try:
            variants = [] if new == _NO_CAUSE else trial.variants_of(CATALOGUE[new])
        except UndecidableError as error:
            self._say(f"{CATALOGUE[new].title}: {error}")
            variants = []
        self._variant.visible = len(variants) > 1
        self._variant.options = [variant.name for variant in variants]
        self._variant.value = variants[0].name if variants else ""
        self._said(lambda: self._session.set_trial(trial.with_causes(variants[:1])))

    def _choose_variant(self, attr: str, old: str, new: str) -> None:
        trial = self._session.trial
        if trial is None or not new or [variant.name for variant in trial.variants] == [new]:
            return
        variants = [variant for variant in trial.variants_of(CATALOGUE[self._cause.value]) if variant.name == new]
        self._said(lambda: self._session.set_trial(trial.with_causes(variants)))

    def _add_address(self, attr: str, old: str, new: str) -> None:
        trial = self._session.trial
        if trial is not None and new.strip():
            self._said(lambda: self._session.set_trial(trial.with_parameter(new.strip())))


def _groups(trial: Trial) -> dict[str, list[Unknown]]:
    """Return the unknowns by heading, those of causes first."""
    described = (trial.described or trial.model).task.variables.names
    groups: dict[str, list[Unknown]] = {"Cause": [], "Unknowns": [], "Overhangs": [], "Tolerances": []}
    for unknown in trial.unknowns:
        if unknown.name not in described:
            groups["Cause"].append(unknown)
        elif trial.is_error(unknown.name):
            groups["Tolerances"].append(unknown)
        else:
            groups["Overhangs" if isinstance(unknown, Move) else "Unknowns"].append(unknown)
    return groups
