"""Pairs of identifications, and how much of the reference's time is SciPy's own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

import numpy_reference as reference
from numpy_reference import identification
from numpy_reference.cases import GUESS, JOINT, tool_and_holder
from receptance.fit import Identification, Observation, Unknown, identify

from .models import JOINT_FIELDS, Array, coupled, sweep
from .pair import Pair

SEED, NOISE = 0, 0.02


def fit_input(lines: int) -> tuple[Array, Array, Array]:
    """Return lines in Hz and rad/s, and a noisy tip receptance of the coupled assembly by the reference."""
    f, w = sweep(lines)
    exact, _ = reference.tip_receptance(w, reference.Substructures(*tool_and_holder(), w[-1]), JOINT)
    noise = np.random.default_rng(SEED).standard_normal((lines, 2)) @ np.array([NOISE, NOISE * 1j])
    return f, w, exact * np.exp(noise)


def identification_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of one identification of the four joint parameters."""
    f, w, measured = fit_input(lines)
    frf = Observation(assembly=coupled(), frequency_hz=f, receptance=measured)
    guess = {f"joint.{field}": getattr(GUESS, field) for field in JOINT_FIELDS}
    unknowns = [Unknown(address=at, lower=x / 1e3, upper=x * 1e3, start=x) for at, x in guess.items()]

    def ours() -> Identification:
        # SciPy's own tolerance, as the reference has it.
        return identify(frf, unknowns, starts=1, tolerance=1e-8, threads=1)

    def difference(found: Identification, fit: reference.Fit) -> float:
        """Distance of the two optima in standard errors; infinite where one has not converged."""
        if not (found.converged and fit.result.success):
            return np.inf
        return max(
            abs(found.values[f"joint.{field}"] - getattr(fit.joint, field)) / found.standard_errors[f"joint.{field}"]
            for field in JOINT_FIELDS
        )

    def remark(found: Identification, fit: reference.Fit) -> str:
        return f"evaluations: ours {found.evaluations}, reference {fit.nfev} residuals, {fit.result.njev} Jacobians"

    for against, analytic in (
        ("SciPy on NumPy, analytic Jacobian", True),
        ("SciPy on NumPy, finite differences", False),
    ):
        yield Pair(
            subject="identification of 4 joint parameters",
            against=against,
            ours=ours,
            reference=lambda analytic=analytic: reference.identify(w, measured, *tool_and_holder(), GUESS, analytic),
            difference=difference,
            tolerance=1e-2,
            lines=lines,
            remark=remark,
        )


class Share(NamedTuple):
    """Seconds of a reference identification with the analytic Jacobian.

    Attributes
    ----------
    whole : in all.
    scipy : in SciPy's least squares, less the residuals and Jacobians that it calls.
    model : in residuals and Jacobians; what is left is the set-up before the fit.
    """

    whole: float
    scipy: float
    model: float


def scipy_share(lines: int, rounds: int) -> Share:
    """Measure how much of the reference's time is SciPy's own, medians over the rounds."""
    _, w, measured = fit_input(lines)
    spent: dict[str, float] = {}

    def timed(key: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **options: Any) -> Any:
            began = time.perf_counter()
            result = call(*arguments, **options)
            spent[key] += time.perf_counter() - began
            return result

        return wrapped

    def least_squares(residual: Any, start: Any, *, jac: Any, **options: Any) -> Any:
        return fit(timed("model", residual), start, jac=timed("model", jac), **options)

    def run() -> None:
        identification.identify(w, measured, *tool_and_holder(), GUESS)

    fit, run = timed("fit", identification.least_squares), timed("whole", run)
    found = []
    with mock.patch.object(identification, "least_squares", least_squares):
        # The first warms up.
        for _ in range(rounds + 1):
            spent.update(whole=0.0, fit=0.0, model=0.0)
            run()
            found.append((spent["whole"], spent["fit"] - spent["model"], spent["model"]))
    return Share(*(float(x) for x in np.median(found[1:], axis=0)))
