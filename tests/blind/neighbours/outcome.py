"""One case of the laboratory of neighbours: the verdict, what the data show of the error, and which answers are right.

What the data show is measured with the laboratory's model, described as the case describes it, whose joint and errors
are fitted to the records: how much chi-square exceeds that of the same fit to the twin, for the same number of values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blind.generator import CATALOGUE, NEIGHBOUR
from blind.oracle import imitated
from blind.outcome import Outcome
from blind.problem import Data, Fitted, Problem, data_of

from .case import Measured, Neighbour, draw_neighbour

SHOWN = 30.0
"""Excess of chi-square from which the data show an error; the oracle of hidden effects has the same limit."""
SAME = 6.0
"""Chi-square, three nats, by which an indistinguishable cause may fit worse than what is right."""
STEPS = 20


@dataclass(frozen=True)
class Visible:
    """What the records show of an error."""

    gain: float
    """Chi-square of the fit without the error beyond that of the twin."""
    misfit: float
    """Chi-square of that fit over the number of values."""
    misfit_true: float
    """The same of the twin."""

    @property
    def shown(self) -> bool:
        """Whether the data show the error."""
        return self.gain > SHOWN


def _fitted(measured: Measured, data: Sequence[Data]) -> tuple[Problem, Fitted]:
    problem = Problem(measured.case, measured.truth, data)
    return problem, problem.fit(problem.start(), most=STEPS)


def visible(neighbour: Neighbour) -> Visible:
    """Return what the records show of the error, after a fit of joint and errors."""
    with np.errstate(all="ignore"):
        pair = (neighbour.seen, neighbour.twin)
        fits = [_fitted(measured, data_of(measured.case, measured.truth))[1] for measured in pair]
    misfits = [fit.chi_square / fit.count if np.isfinite(fit.chi_square) else np.inf for fit in fits]
    return Visible(fits[0].count * (misfits[0] - misfits[1]), *misfits)


def indistinguishable(neighbour: Neighbour, silent: Neighbour, ids: Sequence[str], *, tries: int = 12) -> list[str]:
    """Return which effects of the laboratory fit the records without noise as well as what is right.

    As well means to within three nats of the fit to the twin, in all configurations or in one. Where the model without
    any effect does so, none counts: then nothing is to be named.

    Parameters
    ----------
    neighbour, silent : Neighbour
        The case with noise, from which the standard deviations are, and without.
    ids : sequence of str
        Reported causes; those that the laboratory cannot simulate are never the same.
    tries : int, optional
        In how many ways each effect may act.
    """
    with np.errstate(all="ignore"):
        twin = _fitted(silent.twin, _exact(neighbour.twin, silent.twin))[1]
        limit = twin.chi_square + SAME
        base, start = _fitted(silent.seen, _exact(neighbour.seen, silent.seen))
        if not limit < start.chi_square < np.inf:
            return []
        places = [c.name for c in silent.seen.case.nominal.configurations]
        joints = (start.x, twin.x)
        return [id for id in ids if id in CATALOGUE and imitated(base, (), id, limit, joints, places, tries)]


def _exact(noisy: Measured, silent: Measured) -> list[Data]:
    """Return records without noise on the lines, and with the standard deviations, of those with noise."""
    return [
        replace(data, log=np.log(record.estimate.receptance[data.kept]))
        for data, record in zip(data_of(noisy.case, noisy.truth), silent.case.records, strict=True)
    ]


def run_neighbour(
    seed: int, index: int, id: str, ask: Callable[[Any], Any], *, quick: bool = False, u: float | None = None
) -> Outcome:
    """Draw a case, run the diagnosis, and compare the answer with what is right.

    `same` of the outcome holds the reported causes that a user would accept and those that are indistinguishable.
    """
    neighbour = draw_neighbour(seed, index, id, u=u, quick=quick)
    answer = ask(neighbour.seen.case)
    seen = visible(neighbour)
    accepted = [cause for cause in answer.reported if cause in neighbour.kind.right]
    others = [cause for cause in answer.reported if cause not in accepted]
    if others:
        silent = draw_neighbour(seed, index, id, u=u, quick=quick, noise=False)
        accepted += indistinguishable(neighbour, silent, others)
    return Outcome(
        seed=seed,
        index=index,
        kind=NEIGHBOUR,
        effects=(id,),
        sizes=(neighbour.u,),
        large=seen.shown,
        oracle={"gain": seen.gain, "misfit": seen.misfit, "misfit_true": seen.misfit_true},
        verdict=answer.verdict,
        reported=tuple(answer.reported),
        together=tuple(answer.together),
        same=tuple(accepted),
        seconds=answer.seconds,
        misfit=answer.misfit,
        misfit_after=answer.misfit_after,
        share=None,
        covered=(),
        size_covered=(),
        error=answer.error,
        candidates=list(answer.candidates),
        notes=tuple(answer.notes),
        next_measurement=answer.next_measurement,
    )
