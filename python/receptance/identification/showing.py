"""An identification as a line, as text and as a page."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.result import Identification

__all__ = ["line", "page", "text"]

_COLUMNS = ("parameter", "value", "standard error", "95 % interval")


def text(result: Identification) -> str:
    """Return values with intervals, fit, starts, advice and notes."""
    rows = [_COLUMNS, *_rows(result)]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    lines = [_headline(result), ""]
    for row in rows:
        lines.append("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    lines += ["", *_fits(result)]
    lines += [f"advice: {said}" for said in result.advice]
    lines += [f"note: {said}" for said in result.notes]
    return "\n".join(lines)


def line(result: Identification) -> str:
    """Return values and headline on one line."""
    errors = result.standard_errors
    found = ", ".join(f"{address}={value:.4g} +- {errors[address]:.1g}" for address, value in result.values.items())
    return f"Identification({found}; {_headline(result)})"


def page(result: Identification) -> str:
    """Return what `text` says as HTML, for notebooks."""
    head = "".join(f"<th>{cell}</th>" for cell in _COLUMNS)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in _rows(result))
    said = [html.escape(one) for one in _fits(result)]
    said += [f"<b>{html.escape(one)}</b>" for one in result.advice]
    said += [html.escape(one) for one in result.notes]
    return (
        f"<p>{html.escape(_headline(result))}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        f"<ul>{''.join(f'<li>{one}</li>' for one in said)}</ul>"
    )


def _rows(result: Identification) -> list[tuple[str, str, str, str]]:
    rows = []
    for address, value in result.values.items():
        low, high = result.interval(address)
        rows.append((address, f"{value:.5g}", f"{result.standard_errors[address]:.2g}", f"{low:.5g} to {high:.5g}"))
    return rows


def _fits(result: Identification) -> list[str]:
    return [
        f"{label}: {residual.size} residuals, rms {_rms(residual):.3g} {unit}"
        for label, unit, residual in zip(result.labels, result.units, result.residuals, strict=True)
    ]


def _headline(result: Identification) -> str:
    state = "converged" if result.converged else "not converged"
    count = len(result.starts)
    starts = "one start" if count == 1 else f"{result.agreeing} of {count} starts reached the best optimum"
    return f"{state}, {starts}, {result.evaluations} evaluations, rms {result.rms:.3g}"


def _rms(residual: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(residual**2)))
