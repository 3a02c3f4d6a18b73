"""Forms of a frequency response function, and their units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate

__all__ = ["FORMS", "Form", "check_form", "conversion", "unit_of"]

Form = Literal["receptance", "mobility", "accelerance"]
"""Displacement, velocity or acceleration per load."""
FORMS: tuple[Form, ...] = get_args(Form)
"""In the order of time derivatives: the place is the power of i w that a receptance is multiplied with."""


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


def unit_of(form: Form, response: Coordinate, excitation: Coordinate) -> str:
    """Return the SI unit of one entry.

    Examples
    --------
    >>> from receptance import Coordinate
    >>> from receptance.frf.forms import unit_of
    >>> unit_of("mobility", Coordinate(direction="theta"), Coordinate())
    'rad/s/N'
    """
    motion = "m" if response.direction == "y" else "rad"
    rate = ("", "/s", "/s^2")[FORMS.index(form)]
    return f"{motion}{rate}/{'N' if excitation.direction == 'y' else '(N m)'}"
