"""The model of the generator with unknowns, fitted to records: the fit of the oracle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blind.generator import Case, Configuration, Effect, Record, Truth, rig
from blind.generator.case import JOINT, Stated, true_numbers, where_of
from blind.generator.effects import null_of

FLOOR = 0.003
STEP = 1e-4
"""Of unknowns, for derivatives."""
JITTER = 1e-4
NOISIEST = 0.12
"""Lines whose logarithm scatters more than this are no longer normal and left out."""
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Data:
    """One record in the fit of the oracle."""

    record: Record
    configuration: Configuration
    kept: NDArray[np.bool_]
    lines: FloatArray
    log: NDArray[np.complex128]
    spread: FloatArray
    pulse: float


@dataclass(frozen=True)
class Fitted:
    """Where a fit ended: the vector, chi-square with priors, and the number of observed numbers."""

    x: FloatArray
    chi_square: float
    count: int
    steps: int


def data_of(case: Case, truth: Truth, *, exact: bool = False) -> list[Data]:
    """Return the records with the spreads that noise and floor give them; `exact` takes the noise away."""
    by_name = {c.name: c for c in case.nominal.configurations}
    found = []
    for record in case.records:
        p = truth.numbers[record.configuration, record.level, record.plane]
        found.append(data_from(record, by_name[record.configuration], p, truth.setups[record.level].pulse, exact))
    return found


def data_from(record: Record, configuration: Configuration, p: Mapping[str, float], pulse: float, exact: bool) -> Data:
    e = record.estimate
    clean = rig.recorded(p, e.frequency_hz, e.decay_rate, pulse)
    slope = np.gradient(np.unwrap(np.angle(clean)) * 1j + np.log(np.abs(clean)), np.log(e.frequency_hz))
    spread = np.sqrt(e.log_variance * e.correlated_lines + FLOOR**2 + (JITTER * np.abs(slope)) ** 2)
    kept = spread < NOISIEST
    values = clean if exact else e.receptance
    return Data(record, configuration, kept, e.frequency_hz[kept], np.log(values[kept]), spread[kept], pulse)


class Problem:
    """The laboratory's model with joint, errors and effects as unknowns, against data.

    Unknowns are logarithms of the joint's numbers, errors in standard deviations, and sizes of effects in units of
    their own scale.
    """

    def __init__(
        self, case: Case, truth: Truth, data: Sequence[Data], effects: Sequence[Effect] = (),
        *, fixed: Mapping[str, float] | None = None, own: Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        self.case, self.truth, self.data = case, truth, data
        self.effects = tuple(effects)
        self.sizes = [(i, name) for i, effect in enumerate(self.effects) for name in effect.sizes]
        scales = [self.effects[i].sizes[name] for i, name in self.sizes]
        self.scales = np.array([abs(scale) or 1e-6 for scale in scales])
        measured = {one.record.configuration for one in data}
        stated = [t.name for t in case.nominal.tolerances if t.configuration is None or t.configuration in measured]
        every = [*stated, *(f"{name} @ {c}" for name in JOINT for c in sorted(measured))]
        self.errors = [name for name in every if own is None or name in own]
        self.joint = list(JOINT) if fixed is None else []
        self.fixed = dict(fixed or {})
        self.size = len(self.joint) + len(self.errors) + len(self.sizes)

    def start(self, *, null: bool = False) -> FloatArray:
        """Return the truth, optionally with negligible effects."""
        x = [np.log(self.truth.joint[name]) for name in self.joint]
        x += [self.truth.errors.get(name, 0.0) for name in self.errors]
        for (i, name), scale in zip(self.sizes, self.scales, strict=True):
            effect = self.effects[i]
            value = null_of(effect.id, effect.sizes)[name] if null else effect.sizes[name]
            x.append(value / scale)
        return np.array(x)

    def owner(self, index: int) -> str | None:
        """Return the only configuration that an unknown changes, None where it changes all."""
        at = index - len(self.joint)
        if at < 0:
            return None
        if at >= len(self.errors):
            return self.effects[self.sizes[at - len(self.errors)][0]].configuration
        name = self.errors[at]
        if " @ " in name:
            return name.split(" @ ")[1]
        stated: Stated = next(t for t in self.case.nominal.tolerances if t.name == name)
        return stated.configuration

    def _numbers(self, x: FloatArray, one: Data) -> dict[str, float]:
        joint = {name: float(np.exp(value)) for name, value in zip(self.joint, x, strict=False)} or {
            name: self.fixed[name] for name in JOINT
        }
        errors = {**self.fixed, **dict(zip(self.errors, x[len(self.joint) :], strict=False))}
        values: list[dict[str, float]] = [{} for _ in self.effects]
        for (i, name), scale, value in zip(
            self.sizes, self.scales, x[len(self.joint) + len(self.errors) :], strict=True
        ):
            values[i][name] = float(scale * value)
        record = one.record
        where = where_of(self.truth, one.configuration, record.level, record.plane)
        effects = tuple(zip(self.effects, values, strict=True))
        return true_numbers(self.case.nominal, self.truth, joint, errors, effects, where)

    def part(self, x: FloatArray, one: Data) -> FloatArray:
        """Return the residuals of one record."""
        with np.errstate(all="ignore"):
            model = rig.recorded(self._numbers(x, one), one.lines, one.record.estimate.decay_rate, one.pulse)
            difference = one.log - np.log(model)
        turns = 2.0 * np.pi * np.round(difference.imag / 2.0 / np.pi)
        return np.concatenate([difference.real, difference.imag - turns]) / np.tile(one.spread, 2)

    def residual(self, x: FloatArray) -> FloatArray:
        """Return all residuals, errors last."""
        try:
            parts = [self.part(x, one) for one in self.data]
        except (np.linalg.LinAlgError, OverflowError, ValueError):
            return np.full(1, np.inf)
        first = len(self.joint)
        return np.concatenate([*parts, x[first : first + len(self.errors)]])

    def jacobian(self, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return the derivatives of all residuals."""
        known: dict[object, NDArray[np.complex128]] = {}
        slopes = [self._slopes(x, one, known) for one in self.data]
        parts = [-np.vstack([one.real, one.imag]) for one in slopes]
        result = np.vstack([*parts, np.zeros((len(self.errors), x.size))])
        first, last = len(self.joint), len(self.joint) + len(self.errors)
        result[r.size - len(self.errors) :, first:last] = np.eye(len(self.errors))
        return result

    def _slopes(self, x: FloatArray, one: Data, known: dict[object, NDArray[np.complex128]]) -> NDArray[np.complex128]:
        """Return the derivatives of one record's logarithm, in its standard deviations; two levels may share them."""
        p = self._numbers(x, one)
        own = [j for j in range(x.size) if self.owner(j) in (None, one.record.configuration)]
        steps: dict[tuple[object, ...], dict[str, float]] = {}
        parts: list[tuple[int, tuple[object, ...], float]] = []
        for j in own:
            move = self._moved(x, one, p, j)
            if move:
                # Unknowns of equal effect, such as a stiffness and its scatter, need one derivative.
                first = next(iter(move.values()))
                way = tuple((name, float(f"{change / first:.6g}")) for name, change in move.items())
                steps.setdefault(way, move)
                parts.append((j, way, first / next(iter(steps[way].values()))))
        e = one.record.estimate
        key = (tuple(p.items()), tuple(steps), e.frequency_hz.tobytes(), e.decay_rate)
        if key not in known:
            known[key] = rig.log_slopes(p, list(steps.values()), e.frequency_hz, e.decay_rate, one.pulse)
        columns = dict(zip(steps, (known[key][one.kept] / one.spread[:, None] / STEP).T, strict=True))
        result = np.zeros((one.lines.size, x.size), dtype=np.complex128)
        for j, way, share in parts:
            result[:, j] = share * columns[way]
        return result

    def _moved(self, x: FloatArray, one: Data, p: Mapping[str, float], j: int) -> dict[str, float]:
        """Return how a record's numbers change by a small step of an unknown."""
        away = x.copy()
        away[j] += STEP
        moved = self._numbers(away, one)
        return {name: moved[name] - value for name, value in p.items() if moved[name] != value}

    def promise(self, x: FloatArray) -> float:
        """Return the chi-square that would be reached if everything were linear."""
        r = self.residual(x)
        if not np.isfinite(r).all():
            return np.inf
        jacobian = self.jacobian(x, r)
        size = np.linalg.norm(jacobian, axis=0) + 1e-12
        step = np.linalg.lstsq(jacobian / size, r, rcond=1e-9)[0]
        return float(np.sum((r - jacobian / size @ step) ** 2))

    def fit(self, x: FloatArray, most: int = 12, enough: float = 0.1, hopeless: float = 0.0) -> Fitted:
        """Return the least chi-square near a start, by Levenberg and Marquardt; the slope is kept while it serves.

        It ends early if a linear model predicts a minimum far above `hopeless`, if given.
        """
        r = self.residual(x)
        cost = float(r @ r)
        if not np.isfinite(cost):
            return Fitted(x, np.inf, r.size, 0)
        jacobian = self.jacobian(x, r)
        fresh, damping, steps = True, 1e-4, 0
        for steps in range(1, most + 1):
            normal = jacobian.T @ jacobian
            gradient = jacobian.T @ r
            size = np.sqrt(np.diag(normal)) + 1e-12
            scaled = normal / np.outer(size, size) + damping * np.eye(x.size)
            step = -np.linalg.solve(scaled, gradient / size) / size
            if hopeless and fresh and steps > 4 and cost + gradient @ step > 1.5 * hopeless + 100.0:
                break
            trial = self.residual(x + step)
            there = float(trial @ trial) if np.isfinite(trial).all() else np.inf
            gain = cost - there
            if gain > 0.0:
                x, r, cost = x + step, trial, there
                damping = max(damping * 0.1, 1e-8)
            if gain < enough:
                if gain <= 0.0:
                    damping = max(damping * 30.0, 1e-3)
                if fresh and abs(gain) < enough:
                    break
                if damping > 1e6:
                    break
            if gain < 0.3 * (cost + max(gain, 0.0)) and not fresh:
                jacobian, fresh = self.jacobian(x, r), True
            else:
                fresh = False if gain > 0.0 else fresh
                if gain <= 0.0 and not fresh:
                    jacobian, fresh = self.jacobian(x, r), True
        return Fitted(x, cost, r.size - len(self.errors), steps)
