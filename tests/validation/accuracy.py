"""How many digits the core keeps, over random models and against the reference of fifty and more digits.

The rule: a relative error of at most 1e-9 (derivatives 1e-7), or of a hundred times the effect of a relative change of
1e-15 in every input if that is more. Entries below 1e-290 are exempt.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle import draw, exact, tables
from oracle.tables import Tables
from receptance import ReceptanceError, _core

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-9
DERIVATIVE_TOLERANCE = 1e-7
SENSITIVITY_FACTOR = 100.0
EXEMPT_BELOW = 1e-290
FEW_DRAWS, MANY_DRAWS = 8, 40
"""Sign patterns of the changes that the sensitivity is the largest over: few, and many where few refuse an entry."""
MOST_PARAMETERS = 6
DRIVE, TRANSFER, INNER = "drive point", "transfer", "inner node"
PLACES = (DRIVE, TRANSFER, INNER)
DEFAULT_SEED = 20240607
DEFAULT_CASES = 2000


def base_seed() -> int:
    """Return the seed of the randomised checks: RECEPTANCE_TEST_SEED, or one that never changes."""
    return int(os.environ.get("RECEPTANCE_TEST_SEED", DEFAULT_SEED))


@dataclass
class Tally:
    """Accuracy of one quantity at one kind of position."""

    entries: int = 0
    lines: int = 0
    lines_over: int = 0
    models_over: set[str] = field(default_factory=set)
    """Models with such lines; the lines of one model are not independent."""
    worst_error: float = 0.0
    worst_over: float = 0.0
    """Largest error among the entries that break the rule."""
    worst_ratio: float = 0.0
    worst_ratio_by_kind: dict[str, float] = field(default_factory=dict)
    offenders: list[str] = field(default_factory=list)

    @property
    def share_within(self) -> float:
        """Share of the lines whose every entry keeps the rule."""
        return 1.0 - self.lines_over / self.lines if self.lines else 1.0

    def add(self, kind: str, label: str, error: FloatArray, allowed: FloatArray) -> None:
        """Count one line's entries."""
        self.entries += error.size
        self.lines += 1
        ratio = error / allowed
        over = ratio > 1.0
        self.worst_error = max(self.worst_error, float(error.max()))
        self.worst_ratio = max(self.worst_ratio, float(ratio.max()))
        self.worst_ratio_by_kind[kind] = max(self.worst_ratio_by_kind.get(kind, 0.0), float(ratio.max()))
        if over.any():
            self.lines_over += 1
            self.models_over.add(label.split(":", 1)[0])
            self.worst_over = max(self.worst_over, float(error[over].max()))
            self.offenders.append(f"ratio {ratio.max():.3g}, error {error[over].max():.3g}: {label}")


@dataclass
class Report:
    """The tallies of one run."""

    seed: int
    cases: int = 0
    lines: int = 0
    seconds: float = 0.0
    receptance: dict[str, Tally] = field(default_factory=lambda: {place: Tally() for place in PLACES})
    derivative: dict[str, Tally] = field(default_factory=lambda: {place: Tally() for place in PLACES[:2]})
    parameters: set[tuple[int, int]] = field(default_factory=set)
    refused: list[str] = field(default_factory=list)

    def rows(self) -> list[tuple[str, Tally]]:
        """Return the tallies with their names."""
        named = [(f"receptance, {place}", tally) for place, tally in self.receptance.items()]
        return named + [(f"derivative, {place}", tally) for place, tally in self.derivative.items()]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "seed": self.seed,
            "cases": self.cases,
            "lines": self.lines,
            "seconds": self.seconds,
            "instruction_set": _core.instruction_set(),
            "cores": os.cpu_count(),
            "refused": self.refused,
            "quantities": {
                name: {
                    "entries": tally.entries,
                    "lines": tally.lines,
                    "share_of_lines_within_rule": tally.share_within,
                    "worst_error": tally.worst_error,
                    "worst_error_outside_rule": tally.worst_over,
                    "worst_ratio_to_rule": tally.worst_ratio,
                    "worst_ratio_by_kind": tally.worst_ratio_by_kind,
                    "offenders": tally.offenders,
                }
                for name, tally in self.rows()
            },
        }

    def text(self) -> str:
        """Return the results as a text table."""
        head = (
            f"accuracy: seed {self.seed}, {self.cases} models, {self.lines} lines, {self.seconds:.0f} s, "
            f"{_core.instruction_set()}, {os.cpu_count()} cores"
        )
        width = max(len(name) for name, _ in self.rows())
        lines = [head, f"{'':{width}}  lines  share within   worst error/allowed   worst error outside the rule"]
        for name, tally in self.rows():
            outside = f"{tally.worst_over:.2g}" if tally.lines_over else "none"
            share, ratio = f"{100.0 * tally.share_within:9.3f} %", f"{tally.worst_ratio:19.3g}"
            lines.append(f"{name:{width}}  {tally.lines:5d}  {share}   {ratio}   {outside}")
        kinds = sorted({kind for _, tally in self.rows() for kind in tally.worst_ratio_by_kind})
        lines.append("worst error/allowed by kind of model: " + ", ".join(name for name, _ in self.rows()))
        for kind in kinds:
            values = (f"{tally.worst_ratio_by_kind.get(kind, 0.0):9.2g}" for _, tally in self.rows())
            lines.append(f"  {kind:16} {' '.join(values)}")
        return "\n".join(lines)


def relative_error(found: NDArray[np.complex128], reference: NDArray[np.complex128]) -> FloatArray:
    """Return |found/reference - 1|; infinite where something is not finite, 0 where both are below the exemption."""
    size = np.abs(reference)
    out = np.full(found.shape, np.inf)
    usable = np.isfinite(found) & (size >= EXEMPT_BELOW)
    np.divide(np.abs(np.where(usable, found, 0.0) - reference), size, out=out, where=usable)
    both_small = (size < EXEMPT_BELOW) & np.isfinite(found)
    out[both_small] = np.where(np.abs(found[both_small]) < 1e10 * EXEMPT_BELOW, 0.0, np.inf)
    return out


def allowed_error(error: FloatArray, tolerance: float, sensitivity: Any) -> FloatArray:
    """Return the allowed error; `sensitivity(n_draws)` is computed only where the plain tolerance is exceeded."""
    allowed = np.full(error.shape, tolerance)
    for draws in (FEW_DRAWS, MANY_DRAWS):
        if np.all(error <= allowed):
            break
        allowed = np.maximum(allowed, SENSITIVITY_FACTOR * sensitivity(draws))
    return allowed


def receptance_errors(
    model: Tables, w: complex, found: NDArray[np.complex128], points: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return error and allowance of each entry of one line."""
    reference = exact.receptance_complex128(model, w, points, points)
    error = relative_error(found, reference)
    return error, allowed_error(error, TOLERANCE, lambda draws: exact.sensitivity(model, w, points, points, draws, rng))


def places(points: FloatArray) -> dict[str, NDArray[np.bool_]]:
    """Return which entries of a matrix over `points`, both ends first, belong to which kind of place."""
    node = points[:, 0]
    end = (node == node[0]) | (node == node[2])
    both_ends = end[:, None] & end[None, :]
    same = node[:, None] == node[None, :]
    return {DRIVE: both_ends & same, TRANSFER: both_ends & ~same, INNER: ~both_ends}


def random_parameters(model: Tables, rng: np.random.Generator) -> FloatArray:
    """Draw table entries to differentiate by, tables equally likely, any physical column."""
    rows = [
        [(number, row, column) for row in range(len(table)) for column in range(table.shape[1])
         if tables.is_continuous(number, column)]
        for number, table in enumerate(model)
    ]  # fmt: skip
    rows = [table for table in rows if table]
    picked: set[tuple[int, int, int]] = set()
    for _ in range(MOST_PARAMETERS):
        table = rows[int(rng.integers(len(rows)))]
        picked.add(table[int(rng.integers(len(table)))])
    return np.array(sorted(picked), dtype=np.float64)


def add_case(report: Report, case: draw.Case, label: str, rng: np.random.Generator) -> None:
    """Compare one model with the reference, at all its lines, and its derivatives at one."""
    kind = case.label.split(",")[0].split(" ")[0]
    points, none = case.excitations, np.zeros((0, 3))
    parameters = random_parameters(case.tables, rng)
    line = int(rng.integers(len(case.w)))
    report.cases += 1
    report.lines += len(case.w)
    try:
        h, _ = _core.Model(0, *case.tables).receptance(_core.Lines(case.w), points, points, none, 1)
        ends = points[:4]
        _, slope = _core.Model(0, *case.tables).receptance(_core.Lines(case.w), ends, ends, parameters, 1)
    except ReceptanceError as error:
        report.refused.append(f"{label}: {error}")
        return
    where = places(points)
    for number, w in enumerate(case.w):
        error, allowed = receptance_errors(case.tables, w, h[number], points, rng)
        for place, mask in where.items():
            if mask.any():
                name = f"{label}, line {number} ({w / (2 * np.pi):.6g} Hz)"
                report.receptance[place].add(kind, name, error[mask], allowed[mask])
    error, allowed = _derivative_errors(case.tables, case.w[line], slope[line], ends, parameters, rng)
    report.parameters.update((int(table), int(column)) for table, _, column in parameters)
    where = places(ends)
    for place, tally in report.derivative.items():
        worst = np.unravel_index(np.argmax(error / allowed), error.shape)
        address = parameters[worst[2]].astype(int).tolist()
        tally.add(kind, f"{label}, line {line}, by {address}", error[where[place]], allowed[where[place]])


def _derivative_errors(
    model: Tables,
    w: complex,
    found: NDArray[np.complex128],
    points: FloatArray,
    parameters: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    reference = exact.derivative_complex128(model, w, points, points, parameters)
    error = relative_error(found, reference)
    return error, allowed_error(
        error,
        DERIVATIVE_TOLERANCE,
        lambda draws: exact.derivative_sensitivity(model, w, points, points, parameters, draws, rng),
    )


def run(seed: int, n_cases: int, only: Sequence[int] | None = None) -> Report:
    """Draw and compare models; the same seed and number give the same ones. `only` picks some of them."""
    report = Report(seed)
    start = time.perf_counter()
    for number in range(n_cases):
        if only is None or number in only:
            # A generator for each model, so that any of them can be looked at alone.
            rng = np.random.default_rng([seed, number])
            case = draw.case(rng)
            add_case(report, case, f"model {number}: {case.label}", rng)
    report.seconds = time.perf_counter() - start
    return report
