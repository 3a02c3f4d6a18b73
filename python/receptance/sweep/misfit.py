"""How far candidates are from what was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification import MeasuredFrequencies, MeasuredFRF
from receptance.identification.frequency_residuals import FrequencyResidual
from receptance.identification.residuals import InfeasibleError
from receptance.sweep.outputs import LINE_S, MODES_S, Evaluated, Evaluation, Output, Variable, shared_candidates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["Misfit"]


class Misfit(Output):
    """How far each candidate is from what was measured: the sum of squares that `identify` minimises.

    Of receptances it is the sum over the lines of |ln(measured / model) / standard deviation|^2, of natural frequencies
    that of ((model - measured) / standard deviation)^2: chi-square, where all have standard deviations. Without
    them it is that of the logarithm, or of the relative difference, alone.

    Parameters
    ----------
    observations : MeasuredFRF or MeasuredFrequencies, or a sequence of them
        What was measured, each on its own assembly.
    name : str, optional
        In the results.
    """

    per_assembly = False

    def __init__(
        self, observations: MeasuredFRF | MeasuredFrequencies | Sequence[MeasuredFRF | MeasuredFrequencies],
        *, name: str = "misfit",
    ) -> None:  # fmt: skip
        several = tuple(observations) if isinstance(observations, Sequence) else (observations,)
        if not several:
            raise ValueError("Misfit: there is no observation, expected at least one")
        for one in several:
            if not hasattr(one, "assembly") or not hasattr(one, "frequency_hz"):
                raise TypeError(f"Misfit: {one!r} was given, expected a MeasuredFRF or MeasuredFrequencies")
        self.observations = several
        self.name = name

    @property
    def candidate_s(self) -> float:
        """About what a candidate takes; see `Output`."""
        return sum(
            LINE_S * one.frequency_hz.size if isinstance(one, MeasuredFRF) else MODES_S for one in self.observations
        )

    def variables(self) -> tuple[Variable, ...]:
        """Return what it keeps."""
        return (Variable(self.name, "float64", "", {}, "sum of squared residuals, of all observations"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return those that were observed."""
        return tuple(one.assembly for one in self.observations)

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates to what is kept."""
        parts = [
            _frf_misfit(one, addresses, threads) if isinstance(one, MeasuredFRF) else _frequency_misfit(one, addresses)
            for one in self.observations
        ]

        def run(values: NDArray[np.float64]) -> Evaluated:
            kept = np.zeros(len(values))
            for part in parts:
                kept += part(values)
            return {self.name: kept}, np.isfinite(kept)

        return run

    def describe(self) -> list[Any]:
        """Return what defines it."""
        found: list[Any] = [self.name]
        for one in self.observations:
            found += [one.frequency_hz]
            if isinstance(one, MeasuredFRF):
                found += [one.receptance, one.standard_deviation, repr(one.response), repr(one.excitation), one.force]
            else:
                found += [list(one.modes), one.standard_deviation_hz]
        return found


def _frf_misfit(
    frf: MeasuredFRF, addresses: Sequence[str], threads: int | None
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    found, columns = shared_candidates(
        frf.assembly, addresses, frf.frequency_hz, frf.response, frf.excitation, threads
    )  # fmt: skip
    weights = None if frf.standard_deviation is None else 1.0 / frf.standard_deviation
    if frf.force is not None:
        raise ValueError(f"{frf!r} has a stepped force, which a sweep does not know; give the level of the joint")

    def run(values: NDArray[np.float64]) -> NDArray[np.float64]:
        result: NDArray[np.float64] = found.misfit(np.ascontiguousarray(values[:, columns]), frf.receptance, weights)
        return result

    return run


class _Addresses:
    """Parameters of a residual of one assembly."""

    def __init__(self, addresses: Sequence[str]) -> None:
        self.addresses = tuple(addresses)


def _frequency_misfit(
    measured: MeasuredFrequencies, addresses: Sequence[str]
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    unit = "relative" if measured.standard_deviation_hz is None else "standard deviations"
    residual = FrequencyResidual(measured, _Addresses(addresses), unit)  # type: ignore[arg-type]

    def run(values: NDArray[np.float64]) -> NDArray[np.float64]:
        kept = np.full(len(values), np.nan)
        for i, row in enumerate(values):
            try:
                kept[i] = float(np.sum(residual.value(row) ** 2))
            except InfeasibleError:
                continue
        return kept

    return run
