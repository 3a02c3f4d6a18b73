"""What a campaign file says of unknowns beforehand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from receptance._text import shown
from receptance.campaign.quantities import parse_share
from receptance.identification.unknowns import Prior
from receptance.units import Quantity, parse

if TYPE_CHECKING:
    from receptance.campaign.format import PriorTable

__all__ = ["prior_of"]


def prior_of(kind: Quantity, table: PriorTable, logarithmic: bool) -> Prior:
    """Return a prior on the scale of the fit; a mistake in it is a ValueError that says what was expected."""
    mean = parse(table.value, kind)
    return Prior(mean=mean, standard_deviation=_spread(kind, table.spread, mean, logarithmic))


def _spread(kind: Quantity, written: str | float, mean: float, logarithmic: bool) -> float:
    expected = 'a standard deviation such as "30 %", or a quantity of the parameter\'s kind'
    if not isinstance(written, str):
        return parse(written, kind) / (abs(mean) if logarithmic else 1.0)
    if written.startswith("factor"):
        try:
            factor = float(written.removeprefix("factor"))
        except ValueError:
            factor = math.nan
        if not logarithmic or not factor > 1.0 or math.isinf(factor):
            also = ', or "factor 3", a number above one' if logarithmic else "; only a logarithm has a factor"
            raise ValueError(f"has the spread {shown(written)}, expected {expected}{also}")
        return math.log(factor)
    if written.rstrip().endswith(("%", "percent")):
        share = parse_share(written, expected)
        return share if logarithmic else share * abs(mean)
    return parse(written, kind) / (abs(mean) if logarithmic else 1.0)
