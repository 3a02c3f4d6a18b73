"""Observations of assemblies as observations of a problem of the core.

The core evaluates all residuals and their derivatives: receptances, reduced to a joint where that joint alone is
unknown, truncated records, natural frequencies and damping ratios.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance import _core
from receptance.errors import ReceptanceError
from receptance.identification.factors import FACTORS
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.model.joints import PointJoint
from receptance.model.tables import Tied

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Observed
    from receptance.identification.unknowns import Unknown
    from receptance.model.assembly import Assembly

__all__ = ["CoreObservations", "InfeasibleError", "Unit", "only_joint", "residuals_at"]

Unit = Literal["standard deviations", "percent", "logarithm", "relative"]
"""Meaning of a residual of 1: one logarithm is a factor of e, one relative is twice a natural frequency."""
_LEAST_DAMPING = 1e-4
"""Damping ratios below this are compared relative to it, where they have no standard deviation."""


class InfeasibleError(ReceptanceError):
    """A point at which the model has no value; a fit keeps away from it."""


@dataclass(eq=False)
class _Receptance:
    """Records of one receptance of one model on the same lines."""

    model: _core.TiedModel
    lines: _core.Lines
    points: NDArray[np.float64]
    percent: bool
    end: float | None
    by_line: _core.ByLine | None
    assembly: Assembly
    indices: list[int] = field(default_factory=list)
    measured: list[NDArray[np.complex128]] = field(default_factory=list)
    weights: list[NDArray[np.float64]] = field(default_factory=list)


class CoreObservations:
    """Adds observations to a problem of the core.

    Parameters
    ----------
    core : _core.Problem
        Where they are added.
    observed : sequence of Observed
        The observations.
    unknowns : sequence of Unknown
        The fitted vector, whose bounds a reduction to one joint needs. Without them there is no reduction.
    threads : int, optional
        As in `Assembly.receptance`.

    Attributes
    ----------
    sizes : tuple of int
        Number of residuals of each observation.
    places : ndarray
        Place of each residual of the core if they follow the order of the observations.
    assemblies : list of Assembly
        Assembly of each observation of the core.
    reduced : int
        Number of observations that are reduced to one joint.

    Raises
    ------
    InfeasibleError
        A record with lines on which a measured or modal part of its assembly is not known.
    """

    def __init__(
        self, core: _core.Problem, observed: Sequence[Observed], unknowns: Sequence[Unknown], threads: int | None
    ) -> None:
        self._core, self._unknowns, self._threads = core, unknowns, threads
        self._order: list[int] = []
        self._receptances: dict[tuple[bytes, ...], _Receptance] = {}
        self.assemblies: list[Assembly] = []
        self.reduced = 0
        found: list[int] = []
        for index, one in enumerate(observed):
            if isinstance(one.observation, MeasuredFRF):
                found.append(self._add_receptance(index, one, one.observation))
            else:
                found.append(self._add_frequencies(index, one, one.observation))
        self.sizes = tuple(found)
        for each in self._receptances.values():
            records = _core.Records(np.stack(each.measured), np.stack(each.weights), each.percent, each.end)
            core.add_receptance(each.model, each.lines, each.points, records, each.by_line)
            self._order += each.indices
            self.assemblies.append(each.assembly)
        begins = np.cumsum([0, *self.sizes])
        self.places = np.concatenate([np.arange(begins[i], begins[i + 1]) for i in self._order] or [np.arange(0)])

    def _add_receptance(self, index: int, one: Observed, frf: MeasuredFRF) -> int:
        """Add a receptance; those of one model on the same lines are records of one observation of the core."""
        percent = one.unit == "percent"
        select: Any = slice(None) if one.chosen is None else one.chosen
        measured = np.ascontiguousarray(frf.receptance[select])
        weights = np.ones(measured.size)
        if one.unit == "standard deviations" and frf.standard_deviation is not None:
            weights = np.ascontiguousarray(1.0 / frf.standard_deviation[select])
        size = measured.size if percent else 2 * measured.size
        lines_hz = np.ascontiguousarray(frf.frequency_hz[select])
        if not percent and frf.ends is None and self._add_reduced(index, one, frf, lines_hz, measured, weights):
            return size
        model, addresses, factors = _tied(one)
        force = None if frf.force is None else np.ascontiguousarray(frf.force[select])
        w = np.ascontiguousarray(2.0 * np.pi * lines_hz, dtype=np.complex128)
        lines, end = _core.Lines(w), b"" if frf.ends is None else np.float64(frf.ends).tobytes()
        forces = b"" if force is None else force.tobytes()
        key = (one.unit.encode(), w.tobytes(), forces, end, addresses.tobytes(), factors.tobytes(), *model.key)
        if key not in self._receptances:
            evaluated = _core.Records(measured[None], weights[None], percent, frf.ends).evaluated(lines)
            try:
                given = model.flat.by_line(evaluated / math.tau, force)
            except ValueError as error:
                raise InfeasibleError(str(error)) from None
            tied, assembly = model.model(addresses, factors), one.observation.assembly
            self._receptances[key] = _Receptance(tied, lines, model.points, percent, frf.ends, given, assembly)
        own = self._receptances[key]
        own.indices.append(index)
        own.measured.append(measured)
        own.weights.append(weights)
        return size

    def _add_reduced(
        self,
        index: int,
        one: Observed,
        frf: MeasuredFRF,
        lines: NDArray[Any],
        measured: NDArray[np.complex128],
        weights: NDArray[np.float64],
    ) -> bool:
        """Add a receptance as that of a model reduced to its one unknown joint, if it is one."""
        joint = only_joint(one)
        if joint is None or not self._unknowns:
            return False
        fields = [address.split(".", 1)[1] for address in one.placed.addresses]
        columns = [PointJoint.columns_of.index(name) for name in fields]
        bounds = [self._unknowns[i] for i in one.placed.base]
        try:
            stiff = _stiffest(frf, joint, dict(zip(fields, bounds, strict=True)))
            reduction = frf.assembly.reduced_to_joint(
                joint, lines, response=frf.response, excitation=frf.excitation, at=stiff, threads=self._threads
            )
        except (ReceptanceError, ValueError):
            # The joint at the bounds has no value; the fit itself may never go there.
            return False
        numbers = np.full(len(PointJoint.columns_of), -1.0)
        numbers[columns] = one.placed.base
        self._core.add_joint_receptance(reduction, np.array(stiff.columns()), numbers, measured, weights)
        self._order.append(index)
        self.assemblies.append(frf.assembly)
        self.reduced += 1
        return True

    def _add_frequencies(self, index: int, one: Observed, measured: MeasuredFrequencies) -> int:
        """Add natural frequencies and the damping ratios that are known."""
        model, addresses, factors = _tied(one)
        frequency, spread = measured.frequency_hz, measured.standard_deviation_hz
        weighed = one.unit == "standard deviations" and spread is not None
        share = 0.01 if one.unit == "percent" else 1.0
        unit = spread if weighed and spread is not None else frequency * share
        damping: tuple[NDArray[np.float64], ...] = ()
        ratio, known = measured.damping_ratio, measured.standard_deviation_damping
        if ratio is not None:
            unit_damping = known if weighed and known is not None else np.maximum(ratio, _LEAST_DAMPING) * share
            damping = np.ascontiguousarray(ratio), 1.0 / unit_damping
        modes = np.array(measured.modes, dtype=np.float64) - 1.0
        self._core.add_frequencies(
            model.model(addresses, factors), modes, 2.0 * np.pi * frequency, 0.5 / (np.pi * unit), *damping
        )
        self._order.append(index)
        self.assemblies.append(measured.assembly)
        return frequency.size + measured.damped.size


def residuals_at(one: Observed, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the residuals of an observation at rows of values of the unknowns, `(n, p)`; NaN where it has no value."""
    count = values.shape[1]
    limits = np.array([[-np.inf], [np.inf]]) * np.ones(count)
    core = _core.Problem(np.zeros(count, dtype=np.bool_), limits, np.zeros((0, 3)), 1)
    (size,) = CoreObservations(core, [one], (), None).sizes
    result, none = np.full((len(values), size), np.nan), np.zeros(count, dtype=np.bool_)
    for row, found in zip(result, map(np.ascontiguousarray, values), strict=True):
        rows = core.rows(found, none)
        if rows is not None:
            row[:] = rows[0]
    return result


def only_joint(one: Observed) -> str | None:
    """Return the joint whose terms are the only unknowns of an observation, each by itself; None if there is none."""
    placed = one.placed
    owners = {name.split(".", 1)[0] for name in placed.addresses}
    name = owners.pop() if len(owners) == 1 else ""
    if type(one.observation.assembly.elements.get(name)) is not PointJoint:
        return None
    alone = np.all(placed.base >= 0) and np.all(placed.scale == 1.0) and np.all(placed.second < 0)
    return name if alone and not placed.exponents.any() and not placed.shifts.any() else None


def _stiffest(frf: MeasuredFRF, joint: str, unknowns: dict[str, Unknown]) -> PointJoint:
    """Return the joint as stiff as the bounds allow: any other one adds compliance to it, which costs no digits."""
    values: dict[str, Any] = {name: getattr(frf.assembly.elements[joint], name) for name in PointJoint.columns_of}
    for name, unknown in unknowns.items():
        values[name] = unknown.upper if name in ("k_y", "k_theta") else max(0.0, unknown.lower)
    for kind in "kc":
        limit = np.sqrt(values[f"{kind}_y"] * values[f"{kind}_theta"])
        values[f"{kind}_ytheta"] = float(np.clip(values[f"{kind}_ytheta"], -0.5 * limit, 0.5 * limit))
    return PointJoint(**values)


def _tied(one: Observed) -> tuple[Tied, NDArray[np.float64], NDArray[np.float64]]:
    """Return the model as a function of addresses, these as functions of the unknowns, and factors of the record."""
    placed = one.placed
    factors = [(FACTORS.index(name), i) for i, name in enumerate(placed.addresses) if name in FACTORS]
    tied = one.observation.assembly.tied(placed.addresses, one.points, others=FACTORS)
    start = np.where(placed.base >= 0, placed.scale, placed.fixed)
    columns = [placed.base, start, placed.second, placed.share, placed.exponents, placed.shifts]
    addresses = np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)
    return tied, addresses, np.array(factors, dtype=np.float64).reshape(-1, 2)
