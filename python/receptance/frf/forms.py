"""Forms of a frequency response function: conversion and units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.units import FORMS, Form, FRFKind, frf_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.frf.frf import FRF

__all__ = ["check_form", "conversion", "converted", "unit_of"]


def check_form(owner: str, form: Any) -> Form:
    """Return the form, or raise."""
    for known in FORMS:
        if form == known:
            return known
    kind = ValueError if isinstance(form, str) else TypeError
    raise kind(f"{owner}: form is {form!r}, expected one of {', '.join(FORMS)}")


def conversion(frequency_hz: NDArray[Any], old: Form, new: Form) -> NDArray[np.complex128]:
    """Return the factors `(n,)` that turn one form into another on (complex) lines: (i w) to a power.

    Whole powers by multiplication, so that going there and back costs at most the last digit.
    """
    s = 2j * np.pi * frequency_hz.astype(np.complex128)
    power = FORMS.index(new) - FORMS.index(old)
    factor = np.ones_like(s)
    for _ in range(abs(power)):
        factor = factor * s
    return 1.0 / factor if power < 0 else factor


def converted(frf: FRF, form: Any) -> tuple[dict[str, Any], slice]:
    """Return the fields that change in another form, and the lines that are left; see `FRF.to`."""
    new = check_form(repr(frf), form)
    if new == frf.form:
        return {}, slice(None)
    lines = frf.complex_frequency_hz
    if lines[0] != 0.0 or FORMS.index(new) > FORMS.index(frf.form):
        return {"form": new, "values": frf.values * conversion(lines, frf.form, new)[:, None, None]}, slice(None)
    if lines.size == 1:
        raise ValueError(f"{frf!r}: at 0 Hz {frf.form} says nothing of {new}, and there is no other line")
    motions = dict(zip(FORMS, ("displacement", "velocity", "acceleration"), strict=True))
    note = f"the line at 0 Hz is dropped: {motions[frf.form]} says nothing of {motions[new]} there"
    values = frf.values[1:] * conversion(lines[1:], frf.form, new)[:, None, None]
    return {"form": new, "values": values, "notes": (*frf.notes, note)}, slice(1, None)


def unit_of(form: Form, response: Coordinate, excitation: Coordinate) -> str:
    """Return the SI unit of one entry.

    Examples
    --------
    >>> from receptance import Coordinate
    >>> from receptance.frf.forms import unit_of
    >>> unit_of("mobility", Coordinate(direction="theta"), Coordinate())
    'rad/s/N'
    """
    return frf_unit(FRFKind(form, response.direction, excitation.direction))
