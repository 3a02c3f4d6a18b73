"""Candidates of a sweep from the options of the command."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from scipy import stats

from receptance import sweep, units
from receptance.campaign import Campaign
from receptance.campaign.values import kind_of
from receptance.cli.running import InputError
from receptance.fit.parameters import FACTORS
from receptance.sweep import Candidates, Grid, Sampled

_EXAMPLE = "joint.k_y = 1e7 N/m to 1e9 N/m"
POINTS = 20
"""Number of values of each parameter by default."""
_MOST_CANDIDATES = 10_000_000
_LOGARITHMIC = 10.0
"""Ratio of the ends of a range from which its values are spaced logarithmically."""


def check_figure(candidates: Candidates) -> None:
    """Raise `InputError` if more parameters are varied than a figure shows."""
    count = len(candidates.addresses)
    most = sweep.figure.LARGEST_COUNT
    if count > most:
        raise InputError(
            f"a figure shows at most {most} parameters, and {count} are varied; name some with --vary, or "
            "leave out --plot and --report"
        )


def fixed_values(at: list[str]) -> dict[str, float]:
    """Return the values of --at by address in SI units."""
    found: dict[str, float] = {}
    for address, value in _assigned("--at", at, "'ADDRESS = VALUE', such as 'joint.k_y = 1e8 N/m'"):
        found[address] = _quantity(address, value, f"--at {address}: the value")
    return found


def candidates_of(
    read: Campaign, vary: list[str], points: int | None, sample: int | None, seed: int, given: dict[str, float]
) -> Candidates:
    """Return a grid or random candidates within the ranges of --vary, or of all unknowns."""
    if points is not None and sample is not None:
        raise InputError("--points makes a grid and --sample random candidates; expected one of them")
    points = points or POINTS
    ranges = _ranges(vary)
    if not vary:
        chosen = (u for u in read.unknowns if u.address not in given and u.address not in FACTORS)
        ranges = {u.address: (u.lower, u.upper) for u in chosen}
    for address in ranges:
        if address in given:
            raise InputError(f"{address} is varied and has a fixed value by --at, expected one of them")
    if not ranges:
        raise InputError(f"the campaign has no unknowns, expected a parameter, such as --vary '{_EXAMPLE}'")
    logarithmic = {name: low > 0.0 and high / low >= _LOGARITHMIC for name, (low, high) in ranges.items()}
    if sample is not None:
        distributions = {
            name: stats.loguniform(low, high) if logarithmic[name] else stats.uniform(low, high - low)
            for name, (low, high) in ranges.items()
        }
        return Sampled(distributions, count=sample, seed=seed)
    count = points ** len(ranges)
    if count > _MOST_CANDIDATES:
        raise InputError(f"{points} values of {len(ranges)} parameters are {count:.1e} candidates; use --sample COUNT")
    return Grid(
        {
            name: np.geomspace(low, high, points) if logarithmic[name] else np.linspace(low, high, points)
            for name, (low, high) in ranges.items()
        }
    )


def _ranges(vary: list[str]) -> dict[str, tuple[float, float]]:
    """Return the ranges of --vary by address in SI units."""
    found: dict[str, tuple[float, float]] = {}
    for address, rest in _assigned("--vary", vary, f"'ADDRESS = LOW to HIGH', such as '{_EXAMPLE}'", " to "):
        low_text, _, high_text = rest.partition(" to ")
        low = _quantity(address, low_text.strip(), f"--vary {address}: the lower end")
        high = _quantity(address, high_text.strip(), f"--vary {address}: the upper end")
        if not low < high:
            raise InputError(f"--vary {address}: the range is {rest}, expected the lower end first")
        found[address] = low, high
    return found


def _assigned(option: str, texts: list[str], expected: str, sign: str = "") -> Iterator[tuple[str, str]]:
    """Yield addresses and texts on the right side of `=`, which contain a sign."""
    known = set()
    for text in texts:
        address, equals, rest = (part.strip() for part in text.partition("="))
        if not equals or sign not in rest:
            raise InputError(f"{option} is {text!r}, expected {expected}")
        if address in known:
            raise InputError(f"{option} {address} is given twice, expected it once")
        known.add(address)
        yield address, rest


def _quantity(address: str, text: str, what: str) -> float:
    """Return a value in SI units; a number without unit is accepted for dimensionless quantities."""
    value: float | str = text
    with suppress(ValueError):
        value = float(text)
    try:
        return units.parse(value, kind_of(address))
    except ValueError as error:
        raise InputError(f"{what} {error}") from error
