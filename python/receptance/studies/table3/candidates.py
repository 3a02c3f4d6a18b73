"""Which measurement next: candidates are simulated for joints that the data allow, and everything is fitted again.

The interval that a candidate promises depends on where the joint really is, which nobody knows yet; so it is found for
several joints on the profile of what is known worst, and the widest counts.
Every candidate is really simulated and fitted; `expect` is the one place to put a cheaper expected information.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification import Identification, MeasuredFRF, Unknown, identify

if TYPE_CHECKING:
    from receptance.identification.profiles import Profile
    from receptance.studies.table3.machine import VirtualMachine

__all__ = ["Candidate", "Expected", "expect", "fit_all", "half_width_percent", "menu"]

STIFFNESSES = ("joint.k_y", "joint.k_theta")


@dataclass(frozen=True)
class Candidate:
    """A test that could be made."""

    name: str
    overhang_mm: float
    free: bool


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What a candidate promises.

    `percent` is by parameter the half-width of the 95 % profile interval after it, in percent, the widest over the
    joints that were tried; infinite where a side stays open. `at_fit` is the same for the joint that fits best.
    """

    candidate: Candidate
    percent: dict[str, float]
    at_fit: dict[str, float]

    @property
    def worst_percent(self) -> float:
        """Of the parameter that is then known worst."""
        return max(self.percent.values())

    @property
    def rank(self) -> tuple[float, float]:
        """What candidates are compared by: no test bounds a joint that may be rigid, so the best fit decides then."""
        return self.worst_percent, max(self.at_fit.values())


def menu(machine: VirtualMachine) -> tuple[Candidate, ...]:
    """Return the tests that the seed's bench allows."""
    long = machine.long_mm
    found = [Candidate("the same once more", long, False)]
    found += [Candidate(f"in the machine at {mm:g} mm", mm, False) for mm in machine.shorter_mm]
    found += [Candidate(f"free-free at {mm:g} mm", mm, True) for mm in (long, *machine.shorter_mm)]
    return tuple(found)


def half_width_percent(profile: Profile) -> float:
    """Return the half-width of an interval in percent, from its ratio; infinite where a side is open."""
    if not profile.bounded:
        return float("inf")
    return 100.0 * (float(np.sqrt(profile.upper / profile.lower)) - 1.0)


def expect(
    machine: VirtualMachine,
    measured: Sequence[MeasuredFRF],
    fit: Identification,
    profile: Profile,
    *,
    level: float,
    say: Callable[[str], None],
) -> tuple[Expected, ...]:
    """Return what every candidate promises, the best first."""
    points = _compatible(fit, profile)
    found = []
    for candidate in menu(machine):
        say(f"expecting of {candidate.name}")
        worst = dict.fromkeys(STIFFNESSES, 0.0)
        at_fit: dict[str, float] = {}
        for point in points:
            # Without noise: the data that are expected if this joint is the true one.
            new = machine.measure(
                candidate.name, candidate.overhang_mm, free=candidate.free, values=point, errors=point
            )
            old = [_as_expected(machine, one, point) for one in measured]
            again = fit_all(machine, [*old, new], near=point, staged=False)
            percent = {n: half_width_percent(p) for n, p in again.profiles(STIFFNESSES, level=level).items()}
            worst = {name: max(worst[name], value) for name, value in percent.items()}
            at_fit = at_fit or percent
        found.append(Expected(candidate=candidate, percent=worst, at_fit=at_fit))
    return tuple(sorted(found, key=lambda one: one.rank))


def fit_all(
    machine: VirtualMachine,
    measured: Sequence[MeasuredFRF],
    *,
    near: Mapping[str, float] | None = None,
    staged: bool = True,
    seed: int = 0,
) -> Identification:
    """Fit the joint and all errors; from a point that is near, and through the stages, and the better one is kept."""
    places = {one.configuration: one.assembly for one in measured}
    tolerances = machine.tolerances(places)
    ends = []
    if near is not None:
        ends.append(identify(measured, _started(machine.unknowns, near), tolerances=tolerances, starts=1, seed=seed))
    if staged or not ends:
        ends.append(identify(measured, machine.unknowns, tolerances=tolerances, strategy="staged", starts=1, seed=seed))
    return min(ends, key=lambda end: end.starts[0].cost)


def _started(unknowns: Sequence[Unknown], near: Mapping[str, float]) -> list[Unknown]:
    return [replace(u, start=float(np.clip(near[u.name], u.lower, u.upper))) for u in unknowns]


def _as_expected(machine: VirtualMachine, one: MeasuredFRF, point: Mapping[str, float]) -> MeasuredFRF:
    """Return the measurement so far as a joint would have given it, without noise: only its information counts."""
    overhang = 1e3 * one.assembly.get("tool.segment[0].length")
    free = "spindle" not in one.assembly.elements
    return machine.measure(one.configuration, overhang, free=free, values=point, errors=point)


def _compatible(fit: Identification, profile: Profile) -> list[dict[str, float]]:
    """Return the fit and the ends of a profile within its interval, with everything else that goes along."""
    inside = profile.paths[profile.rise <= profile.threshold]
    order = np.argsort(inside[:, fit.addresses.index(profile.name)])
    chosen = [inside[order[0]], inside[order[-1]]]
    points = [dict(zip(fit.addresses, fit.task.variables.to_values(x).tolist(), strict=True)) for x in chosen]
    return [dict(fit.values), *points]
