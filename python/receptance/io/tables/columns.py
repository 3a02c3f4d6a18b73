"""Columns of a table: what their names say."""

from __future__ import annotations

import re
from dataclasses import dataclass

from receptance.units import Form, form_name

__all__ = ["QUALITIES", "Column", "parse_column"]

QUALITIES = {
    "log variance": "log_variance",
    "degrees of freedom": "degrees_of_freedom",
    "correlated lines": "correlated_lines",
    "usable": "usable",
}
"""Columns that this library writes beside an FRF, and the fields they are."""

_PARTS = {
    "real": ("real", "re"),
    "imaginary": ("imaginary", "imag", "im"),
    "magnitude": ("magnitude", "mag", "amplitude", "abs"),
    "phase": ("phase", "angle", "arg"),
}
_FORMS = r"receptance|compliance|mobility|accelerance|inertance"
_PART = "|".join(word for words in _PARTS.values() for word in words)
_FRF = re.compile(
    rf"(?:(?P<form>{_FORMS}|frf|h)\s+)?(?P<part>{_PART})(?:\s+part)?(?:\s+(?P<after>{_FORMS}|frf))?(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_OTHER = re.compile(rf"(?P<what>coherence|coh|{'|'.join(QUALITIES)})(?:\s+(?P<entry>.+))?", re.IGNORECASE)
_BRACKETS = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]", re.DOTALL)
_PARENTHESES = re.compile(r"(?P<name>[^()]*?)\s*\((?P<unit>.*)\)", re.DOTALL)


@dataclass(frozen=True)
class Column:
    """What the name of a column says."""

    name: str
    """Without the unit."""
    unit: str | None
    role: str
    """frequency, time, real, imaginary, magnitude, phase, coherence, one of QUALITIES, or channel."""
    form: Form | None = None
    entry: str = ""
    """Which response and excitation, where there are several."""


def parse_column(text: str) -> Column:
    """Return what a name such as `accelerance real [m/s^2/N]` or `tip (g)` says.

    Examples
    --------
    >>> from receptance.io.tables.columns import parse_column
    >>> parse_column("Inertance imag 2/1 [m/s^2/N]")
    Column(name='Inertance imag 2/1', unit='m/s^2/N', role='imaginary', form='accelerance', entry='2/1')
    """
    text = text.strip()
    match = _BRACKETS.fullmatch(text) or _PARENTHESES.fullmatch(text)
    name, unit = (match["name"].strip(), match["unit"].strip()) if match and match["name"].strip() else (text, None)
    if name.lower() in ("frequency", "freq", "f"):
        return Column(name, unit, "frequency")
    if name.lower() in ("time", "t"):
        return Column(name, unit, "time")
    other = _OTHER.fullmatch(name)
    if other:
        what = other["what"].lower()
        return Column(name, unit, QUALITIES.get(what, "coherence"), entry=other["entry"] or "")
    frf = _FRF.fullmatch(name)
    if frf:
        role = next(role for role, words in _PARTS.items() if frf["part"].lower() in words)
        word = (frf["form"] or frf["after"] or "").lower()
        return Column(name, unit, role, form_name(word) if word not in ("", "frf", "h") else None, frf["entry"] or "")
    return Column(name, unit, "channel")
