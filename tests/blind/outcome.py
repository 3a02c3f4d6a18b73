"""One case: its draw, the verdict, and the correctness of the verdict."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from blind.generator import (
    CATALOGUE,
    CHANGES,
    GEOMETRIES,
    INSIDE,
    Case,
    Truth,
    draw_case,
    measured_again,
    shown_by,
    shuffled,
)
from blind.generator.case import UPPER_HZ
from blind.oracle import consult, same_answer

COMPARED_HZ = 0.95 * UPPER_HZ
"""New tools are compared up to here: a mode near the limit of the prediction may be on one side only."""


@dataclass(frozen=True)
class Outcome:
    """One case: hidden effects, gain of the oracle, verdict."""

    seed: int
    index: int
    kind: str
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    """How large the effects were drawn, from 0 to 1."""
    large: bool
    oracle: dict[str, Any]
    verdict: str
    reported: tuple[str, ...]
    together: tuple[str, ...]
    same: tuple[str, ...]
    """Reported ids that would have looked the same as the truth."""
    seconds: float
    misfit: float
    misfit_after: float
    share: float | None
    """Improvement on new tools as a share of the oracle's."""
    covered: tuple[bool, ...]
    """Of natural frequencies of new tools by 95 % intervals."""
    size_covered: tuple[bool, ...]
    layer: bool = False
    error: str = ""
    candidates: list[Any] = field(default_factory=list)
    notes: tuple[str, ...] = ()
    """Reasons that the verdict gives."""
    next_measurement: str = ""
    shuffled: tuple[str, ...] = ()
    """Verdict and reported ids under other names and without remarks, for misleading cases."""
    resolved: bool | None = None
    """Whether the advised measurement led from an ambiguous verdict to the right name."""
    knowledge: str = ""
    """What was known of the holder, or how cones and flutes are described; empty for the ordinary tolerances."""
    within: tuple[str, ...] = ()
    """Effects that the measurement of the holder contains, so that they are not hidden."""

    @property
    def elsewhere(self) -> bool:
        """Whether an effect has no place in a model whose holder is data."""
        return self.knowledge not in ("", "drawing", *GEOMETRIES) and any(
            id in (*CHANGES, *INSIDE) for id in self.effects
        )

    @property
    def found(self) -> tuple[str, ...]:
        """Reported ids that are right or indistinguishable from the right ones."""
        return tuple(id for id in self.reported if id in self.effects or id in self.same)

    @property
    def in_set(self) -> bool:
        """Whether every effect, or an indistinguishable one, is reported."""
        if not self.effects:
            return False
        right = sum(id in self.reported for id in self.effects)
        return right == len(self.effects) or right + any(id in self.same for id in self.reported) >= len(self.effects)

    @property
    def named_right(self) -> bool:
        """Whether exactly the hidden effects are named."""
        return self.verdict == "named" and self.in_set and len(self.found) == len(self.reported)

    @property
    def one_answer(self) -> bool:
        """Whether exactly the effects are reported; indistinguishable causes count as the same."""
        merged = self.verdict in ("named", "ambiguous") and len(self.found) == len(self.reported)
        return self.in_set and merged

    @property
    def named_wrong(self) -> bool:
        """Whether an absent effect is named."""
        return self.verdict == "named" and len(self.found) < len(self.reported)


def run_case(
    seed: int, index: int, kind: str, effects: Sequence[str], ask: Callable[[Any], Any], *, quick: bool = False,
    u: float | None = None, oracle: bool = True, knowledge: str = "", advice: bool = False, geometry: str = "",
) -> Outcome:  # fmt: skip
    """Draw a case, run the diagnosis, and compare with the truth; for `advice` alone ask the oracle if ambiguous."""
    drawn = {"quick": quick, "u": u, "knowledge": knowledge, "geometry": geometry}
    case, truth = draw_case(seed, index, kind, tuple(effects), **drawn)
    answer = ask(case)
    names = tuple(effect.id for effect in truth.effects)
    resolved = _resolved(ask, case, truth, answer) if answer.verdict == "ambiguous" and names else None
    again = ask(shuffled(case)) if kind == "misleading" else None
    oracle = oracle and (not advice or answer.verdict == "ambiguous")
    consulted = consult(case, truth) if oracle else None
    wrong = [id for id in answer.reported if id not in names and id in CATALOGUE]
    beside = [id for id in answer.reported if id in names] if len(names) > 1 else []
    same = tuple(id for id in wrong if oracle and names and same_answer(case, truth, id, beside))
    frequencies = {c.name: truth.frequencies(c.name) for c in case.new_tools}
    return Outcome(
        seed=seed,
        index=index,
        kind=kind,
        effects=names,
        sizes=tuple(effect.u for effect in truth.effects),
        large=consulted.large if consulted else True,
        oracle={} if consulted is None else dataclasses.asdict(consulted),
        verdict=answer.verdict,
        reported=tuple(answer.reported),
        together=tuple(answer.together),
        same=same,
        seconds=answer.seconds,
        misfit=answer.misfit,
        misfit_after=answer.misfit_after,
        share=_share(consulted, answer) if consulted else None,
        covered=_coverage(frequencies, answer.predictions),
        size_covered=sizes_covered(truth.effects, answer.sizes, _SIZES) if answer.verdict == "named" else (),
        layer=case.nominal.layer,
        error=answer.error,
        candidates=list(answer.candidates),
        notes=tuple(answer.notes),
        next_measurement=answer.next_measurement,
        resolved=resolved,
        shuffled=() if again is None else (again.verdict, *sorted(again.reported)),
        knowledge=geometry or knowledge,
        within=truth.within,
    )


def _resolved(ask: Callable[..., Any], case: Case, truth: Truth, answer: Any) -> bool:
    """Return whether the advised measurement, when taken, resolves an ambiguous verdict to the right name.

    A directly measured quantity (a weight, a length, a gain) is known afterwards: either it is the effect, or it is
    none and the diagnosis is repeated without it. Other measurements are taken, and the diagnosis is repeated with
    them. If two are advised, both are taken.
    """
    names = {effect.id for effect in truth.effects}
    shown = shown_by(answer.next_measurement)
    more = measured_again(case, truth, answer.next_measurement)
    if not shown and more is None:
        return False
    left = names - shown
    if not left:
        return True
    second = ask(more or case, without=tuple(shown))
    return second.verdict == "named" and set(second.reported) == left


def _error(predicted: dict[str, list[float]], true: dict[str, list[float]]) -> float | None:
    """Return the rms error of natural frequencies over the new tools, in %."""
    found = []
    for name, every in true.items():
        own = predicted.get(name)
        if not own:
            return None
        frequencies = _compared(every)
        # By the nearest one: a mode too many or too few would shift all the others.
        away = np.abs(np.array(own)[None, :] / frequencies[:, None] - 1.0).min(axis=1)
        found += list(100.0 * away)
    return float(np.sqrt(np.mean(np.square(found)))) if found else None


def _share(consulted: Any, answer: Any) -> float | None:
    """Return the share of the oracle's improvement on new tools; None if that is negligible."""
    true = consulted.frequencies_true
    before, best = (_error(one, true) for one in (consulted.frequencies_before, consulted.frequencies_after))
    after = _error({name: pair[0] for name, pair in answer.predictions.items()}, true)
    if before is None or best is None or after is None or before - best < 0.02:
        return None
    return float((before - after) / (before - best))


def _compared(frequencies: Sequence[float]) -> NDArray[np.float64]:
    found = np.array(frequencies)
    return found[found < COMPARED_HZ]


def _coverage(true: dict[str, Any], predictions: dict[str, Any]) -> tuple[bool, ...]:
    covered = []
    for name, every in true.items():
        if name not in predictions:
            continue
        frequencies = _compared(every)
        values, errors = (np.array(one)[: frequencies.size] for one in predictions[name])
        inside = np.zeros(frequencies.size, dtype=bool)
        inside[: values.size] = np.abs(values - frequencies[: values.size]) <= stats.norm.ppf(0.975) * errors
        covered += inside.tolist()
    return tuple(covered)


_SIZES: dict[str, tuple[str, Callable[[float], float]]] = {
    "sensor_mass": ("mass", float),
    "hammer_offset": ("distance", float),
    "time_delay": ("delay", float),
    "overhang_error": ("length", float),
    "joint_hysteretic_loss": ("loss", float),
    "exponential_window": ("rate", float),
    "calibration_gain": ("gain", np.log1p),
    "tool_modulus": ("share", np.log1p),
    "tool_density": ("share", np.log1p),
    "holder_modulus": ("share", np.log1p),
    "holder_inertia": ("share", np.log1p),
    "joint_amplitude": ("exponent", float),
    "joint_overhang_law": ("exponent", float),
    "collet_mass": ("mass", float),
}
"""Effects whose size the package states as one number, and how ours becomes it."""


def sizes_covered(
    effects: Sequence[Any],
    stated: dict[str, dict[str, tuple[float, float, float]]],
    known: dict[str, tuple[str, Callable[[float], float]]],
) -> tuple[bool, ...]:
    """Return whether intervals of rightly named effects hold the true sizes, of effects whose size is one number."""
    covered = []
    for effect in effects:
        own = stated.get(effect.id)
        if effect.id in known and own:
            name, change = known[effect.id]
            value = change(effect.sizes[name])
            _, low, high = next(iter(own.values()))
            covered.append(bool(low <= value <= high))
    return tuple(covered)
