"""The report's figures, which can be zoomed."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.diagnosis.wording import remarks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike
    from plotly.graph_objects import Figure

    from receptance.diagnosis import Candidate, Verdict
    from receptance.diagnosis.by_mode import Curve

__all__ = ["curve_figure", "evidence_figure", "frequencies_figure", "similarity_figure"]

MEASURED, BEFORE, AFTER = "#c9ced3", "#d95f02", "#1b7f79"
_LINE = "rgba(0,0,0,0.12)"
_SHOWN = 16
_FONT = {"family": "system-ui, sans-serif", "size": 13}


def curve_figure(before: Curve, after: Curve | None) -> Figure:
    """Return magnitude, phase and residual of one receptance: measured, before and after."""
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.04, row_heights=[0.45, 0.25, 0.3])
    # Broad and pale: the models lie on it.
    sets = [("measured", before.frequency_hz, before.measured, MEASURED, 5.0)]
    sets.append(("model as given", before.frequency_hz, before.modelled, BEFORE, 1.6))
    if after is not None:
        sets.append(("model extended", after.frequency_hz, after.modelled, AFTER, 1.6))
    for name, lines, values, colour, width in sets:
        line = {"color": colour, "width": width, "dash": "dash" if name == "model as given" else "solid"}
        own: dict[str, Any] = {"name": name, "legendgroup": name, "line": line, "mode": "lines"}
        figure.add_scatter(x=_five_digits(lines), y=_five_digits(np.abs(values)), row=1, col=1, **own)
        # From -270 to 90 degrees: a drive point lies between -180 and 0 and does not jump from end to end.
        phase = np.degrees(np.angle(1j * values)) - 90.0
        figure.add_scatter(x=_five_digits(lines), y=_five_digits(phase), row=2, col=1, showlegend=False, **own)
    for name, curve, colour in (("model as given", before, BEFORE), ("model extended", after, AFTER)):
        if curve is not None:
            size = np.sqrt(np.mean(curve.residual**2, axis=0))
            line = {"color": colour, "width": 1.0}
            figure.add_scatter(
                x=_five_digits(curve.frequency_hz),
                y=_five_digits(size),
                row=3,
                col=1,
                name=name,
                legendgroup=name,
                showlegend=False,
                line=line,
                mode="lines",
            )
    figure.add_hline(y=1.0, row=3, col=1, line={"color": "#888888", "dash": "dot", "width": 1})
    figure.update_yaxes(type="log", title="receptance (m/N)", exponentformat="power", row=1, col=1)
    figure.update_yaxes(title="phase (°)", tickvals=[-270, -180, -90, 0, 90], row=2, col=1)
    figure.update_yaxes(type="log", title="residual (s.d.)", row=3, col=1)
    figure.update_xaxes(title="frequency (Hz)", row=3, col=1)
    return _with_layout(figure, 620)


def frequencies_figure(before: Sequence[Curve], after: Sequence[Curve]) -> Figure:
    """Return the errors of natural frequencies, before and after."""
    from plotly.graph_objects import Figure

    figure = Figure()
    for name, some, colour in (("model as given", before, BEFORE), ("model extended", after, AFTER)):
        if some:
            # Two rows of names: the modes, and below them their configurations.
            names = [
                [escape(c.label) for c in some for _ in c.frequency_hz],
                [f"{f:.0f} Hz" for c in some for f in c.frequency_hz],
            ]
            errors = [100.0 * (m - f) / f for c in some for f, m in zip(c.measured.real, c.modelled.real, strict=True)]
            figure.add_bar(x=names, y=_five_digits(np.array(errors)), name=name, marker={"color": colour})
    figure.update_yaxes(title="modelled less measured (%)")
    figure.update_layout(barmode="group")
    return _with_layout(figure, 420)


def evidence_figure(verdict: Verdict) -> Figure:
    """Return the evidence of the candidates, each alone, and the detection threshold."""
    from plotly.graph_objects import Figure

    shown = list(verdict.candidates[:_SHOWN])[::-1]
    figure = Figure()
    reported = {one.id for one in verdict.causes}
    most = max([one.evidence for one in shown] + [2.0 * max(verdict.threshold, 1.0)])
    figure.add_bar(
        x=[max(one.evidence, 0.0) for one in shown],
        y=[one.id for one in shown],
        orientation="h",
        marker={"color": [AFTER if one.id in reported else "#b8c4cc" for one in shown]},
        text=[_bar_label(one) for one in shown],
        textposition="outside",
        cliponaxis=False,
        hovertext=[f"{one.evidence:+.1f}" for one in shown],
        hoverinfo="text",
    )
    # Room for the text beside the longest bar.
    figure.update_xaxes(range=[0.0, 1.4 * most])
    figure.add_vline(x=verdict.threshold, line={"color": BEFORE, "dash": "dash", "width": 1.5})
    figure.update_xaxes(title="evidence (twice the logarithm of odds); dashed: detection threshold")
    return _with_layout(figure, 120 + 26 * len(shown))


def _bar_label(one: Candidate) -> str:
    return ", ".join(text for text in (f"misfit {one.misfit:.2f}", remarks(one)) if text)


def similarity_figure(names: Sequence[str], cosines: Sequence[Sequence[float]]) -> Figure:
    """Return the cosines between the effects of causes on these data."""
    from plotly.graph_objects import Figure

    figure = Figure()
    figure.add_heatmap(
        z=np.asarray(cosines).round(3).tolist(),
        x=list(names),
        y=list(names),
        zmin=0.0,
        zmax=1.0,
        colorscale="Teal",
        colorbar={"title": {"text": "1: same effect"}},
    )
    figure.update_yaxes(autorange="reversed")
    figure.update_xaxes(tickangle=40)
    return _with_layout(figure, 160 + 28 * len(names))


def _five_digits(values: ArrayLike) -> list[float]:
    """Return numbers with five digits, which are more than a screen shows and keep the file small."""
    return [float(f"{value:.5g}") for value in np.asarray(values, dtype=np.float64)]


def _with_layout(figure: Figure, height: int) -> Figure:
    figure.update_layout(
        height=height,
        font=_FONT,
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        plot_bgcolor="white",
        paper_bgcolor="white",
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.01},
        hovermode="closest",
    )
    figure.update_xaxes(gridcolor=_LINE, zerolinecolor=_LINE, automargin=True)
    figure.update_yaxes(gridcolor=_LINE, zerolinecolor=_LINE, automargin=True)
    return figure
