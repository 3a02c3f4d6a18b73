"""A diagnosis as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.report.figure import COLOURS, PALE, finished, panels, set_up, surface, title_left

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.diagnosis import Verdict
    from receptance.diagnosis.by_mode import Curve

__all__ = ["draw_diagnosis"]

_CANDIDATES = 12
_RECEPTANCES = 5
"""Receptances that are drawn; the report has all of them."""
_COLUMNS = 3
_GAP = 4.0
"""Ratio of the distance of two lines to those around it from which lines are left out between them."""


def draw_diagnosis(verdict: Verdict, ax: Axes | None = None) -> Figure:
    """Draw receptances and natural frequencies, measured and modelled, and the evidence of the candidates.

    Parameters
    ----------
    verdict : Verdict
        From `receptance.diagnosis.diagnose`.
    ax : Axes, optional
        As in `Result.plot`.

    Returns
    -------
    matplotlib.figure.Figure
        Of the receptances the first five; the model as given, and extended by the explanation where there is one.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown
    >>> from receptance.diagnosis import diagnose
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> modes = MeasuredFrequencies(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(3e4)[:4], standard_deviation_hz=5.0
    ... )
    >>> unknown = Unknown(address="joint.k_theta", lower=1e3, upper=1e7)
    >>> verdict = diagnose([modes], [unknown], causes=["shear_neglected"])
    >>> len(verdict.plot().axes)
    2
    """
    from receptance.diagnosis.by_mode import curves

    before = curves(verdict.base_fit)
    after = [] if verdict.explanation is None else curves(verdict.explanation.fit)
    receptances = [i for i, one in enumerate(before) if np.iscomplexobj(one.measured)]
    frequencies = [i for i in range(len(before)) if i not in receptances]
    candidates = verdict.candidates[:_CANDIDATES]
    count = len(receptances[:_RECEPTANCES]) + bool(frequencies) + bool(candidates)
    columns = min(count, _COLUMNS)
    rows = -(-count // columns)
    figure = surface(ax, 0.8 + 4.6 * columns, 3.6 * rows + 0.7)
    title_left(figure, f"{verdict.title}: {verdict.verdict}")
    axes = iter(panels(figure, count, columns))
    for i in receptances[:_RECEPTANCES]:
        _draw_receptance(next(axes), before[i], after[i] if after else None)
    if frequencies:
        _draw_frequencies(next(axes), [before[i] for i in frequencies], [after[i] for i in frequencies if after])
    if candidates:
        _draw_evidence(next(axes), verdict)
    return finished(figure)


def _draw_receptance(axes: Axes, before: Curve, after: Curve | None) -> None:
    set_up(axes, before.label or before.configuration, "frequency [Hz]", "receptance [m/N]")
    axes.plot(*_with_gaps(before.frequency_hz, before.measured), color=PALE, lw=3.0, label="measured")
    given = _with_gaps(before.frequency_hz, before.modelled)
    axes.plot(*given, color=COLOURS[1], lw=1.0, ls="--", label="model as given")
    if after is not None:
        axes.plot(*_with_gaps(after.frequency_hz, after.modelled), color=COLOURS[2], lw=1.0, label="model extended")
    axes.set_yscale("log")
    axes.legend(fontsize=8, frameon=False)


def _with_gaps(
    lines: NDArray[np.float64], values: NDArray[np.complex128] | NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lines and magnitudes with NaN where lines are left out, so that no curve is drawn there."""
    spacing = np.diff(lines)
    around = np.maximum(np.append(spacing[:1], spacing[:-1]), np.append(spacing[1:], spacing[-1:]))
    gaps = np.flatnonzero(spacing > _GAP * around) + 1
    return np.insert(lines, gaps, np.nan), np.insert(np.abs(values), gaps, np.nan)


def _draw_frequencies(axes: Axes, before: Sequence[Curve], after: Sequence[Curve]) -> None:
    set_up(axes, "Natural frequencies", "measured [Hz]", "modelled less measured [%]")
    for curves, colour, marker, label in (
        (before, COLOURS[1], "o", "model as given"),
        (after, COLOURS[2], "s", "model extended"),
    ):
        if curves:
            measured = np.concatenate([one.measured.real for one in curves])
            modelled = np.concatenate([one.modelled.real for one in curves])
            axes.plot(measured, 100.0 * (modelled / measured - 1.0), marker, color=colour, ms=4.0, label=label)
    axes.axhline(0.0, color=PALE, lw=0.9)
    axes.legend(fontsize=8, frameon=False)


def _draw_evidence(axes: Axes, verdict: Verdict) -> None:
    shown = verdict.candidates[:_CANDIDATES]
    reported = {one.id for one in verdict.causes}
    set_up(axes, "Evidence of the candidates", "twice the logarithm of the odds", "")
    axes.grid(visible=False)
    places = range(len(shown))
    colours = [COLOURS[2] if one.id in reported else PALE for one in shown]
    axes.barh(places, [max(one.evidence, 0.0) for one in shown], color=colours, height=0.7)
    axes.axvline(verdict.threshold, color=COLOURS[1], lw=1.0, ls="--", label="detection threshold")
    axes.set_yticks(places, [one.id for one in shown], fontsize=8)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.legend(fontsize=8, frameon=False)
