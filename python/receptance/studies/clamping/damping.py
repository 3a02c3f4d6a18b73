"""VIRTUAL: whether damping at the interface may be neglected, on the tip response in a simulated machine and free.

What decides the limit of stable cutting is the least real part of the tip response: the limit goes with its inverse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from receptance.studies.table3.machine import VirtualMachine

__all__ = ["DampingCase", "DampingStudy", "study_damping"]

FACTORS = (0.0, 1.0, 3.0, 10.0, 30.0)
_WORTH_PERCENT = 10.0
"""An error of the least real part, and of the limit of stability with it, that matters."""
_FREE_HZ = (200.0, 12500.0)
_LINES = 6000
_MOST = 1e3
_NEAREST = 1e-4


@dataclass(frozen=True, kw_only=True)
class DampingCase:
    """One test and one damping of the interface, a multiple of what is simulated elsewhere.

    `peak_percent` and `real_percent` are by how much the highest peak and the least real part are too large where the
    damping is neglected.
    """

    test: str
    factor: float
    peak_percent: float
    real_percent: float


@dataclass(frozen=True, kw_only=True)
class DampingStudy:
    """All tests and dampings; `allowed` is by test the factor at which neglecting costs 10 % of the stability limit."""

    cases: tuple[DampingCase, ...]
    allowed: dict[str, float]
    truth: dict[str, float]
    worth_percent: float = _WORTH_PERCENT

    def of_published(self) -> tuple[DampingCase, ...]:
        """Return the cases with the published rotational damping as it is."""
        return tuple(case for case in self.cases if case.factor == 1.0)


def study_damping(machine: VirtualMachine, *, say: Callable[[str], None]) -> DampingStudy:
    """Compare tip responses with and without damping at the interface."""
    cases, allowed = [], {}
    for overhang in (machine.long_mm, machine.shorter_mm[0]):
        for free in (False, True):
            test = f"{'free-free' if free else 'in the machine'}, {overhang:g} mm"
            say(f"damping: {test}")
            for factor in FACTORS[1:]:
                peak, real = _neglected(machine, overhang, free, factor)
                cases.append(DampingCase(test=test, factor=factor, peak_percent=peak, real_percent=real))
            allowed[test] = _allowed(machine, overhang, free)
    return DampingStudy(cases=tuple(cases), allowed=allowed, truth=dict(machine.truth))


def _neglected(machine: VirtualMachine, overhang: float, free: bool, factor: float) -> tuple[float, float]:
    (peak, real), (bare_peak, bare_real) = (_extremes(machine, overhang, free, one) for one in (factor, 0.0))
    return 100.0 * (bare_peak / peak - 1.0), 100.0 * (bare_real / real - 1.0)


def _extremes(machine: VirtualMachine, overhang: float, free: bool, factor: float) -> tuple[float, float]:
    """Return the highest magnitude and the size of the least real part."""
    damping = {name: factor * machine.truth[name] for name in ("joint.c_y", "joint.c_theta")}
    assembly = machine.assembly(overhang, free=free).replace(damping)
    low, high = _FREE_HZ if free else machine.measuring.machine_hz
    modes = assembly.natural_frequencies(high)
    # Lines close enough to every mode to meet peaks and slopes of any damping here.
    near = np.concatenate([[0.0], np.geomspace(_NEAREST, 0.05, 60)])
    lines = np.concatenate(
        [np.linspace(low, high, _LINES), *(f * (1.0 + s * near) for f in modes for s in (-1.0, 1.0))]
    )
    lines = np.unique(lines[(lines >= low) & (lines <= high)])
    response = assembly.receptance(lines)
    return float(np.abs(response).max()), float(-response.real.min())


def _allowed(machine: VirtualMachine, overhang: float, free: bool) -> float:
    """Return the multiple at which neglecting costs as much as matters, by bisection; infinite if beyond a thousand."""
    low, high = 0.0, _MOST
    if abs(_neglected(machine, overhang, free, high)[1]) < _WORTH_PERCENT:
        return float("inf")
    for _ in range(24):
        middle = 0.5 * (low + high) if low > 0.0 else min(1.0, 0.5 * high)
        if abs(_neglected(machine, overhang, free, middle)[1]) < _WORTH_PERCENT:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
