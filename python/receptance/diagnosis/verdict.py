"""The verdict of a diagnosis: its findings, shown as text, tables, page and data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields
from typing import Any

from receptance.diagnosis import presentation
from receptance.diagnosis.findings import CandidateCause, Findings
from receptance.report import Fact, PageSection, Result, Table


class Verdict(Findings, Result):
    """Whether the model is adequate, and the causes that explain the data if it is not.

    Its data and predictions are those of `Findings`.
    """

    heading = "Diagnosis"
    plotted_by = "receptance.diagnosis.figure:draw_diagnosis"

    @property
    def badge(self) -> str:
        """The answer."""
        return self.verdict if self.final else f"{self.verdict} (not final)"

    def facts(self) -> list[Fact]:
        """Return the answer: verdict, causes with sizes and remedies."""
        return presentation.facts(self)

    def key_figures(self) -> list[tuple[str, Sequence[str]]]:
        """Return the size of the first cause, and errors before and after."""
        return presentation.key_figures(self)

    def tables(self) -> list[Table]:
        """Return the effect of the causes, the alternatives, and the modes with the largest errors."""
        return presentation.tables(self)

    def sections(self) -> list[PageSection]:
        """Return held-out and fitted data, before and after, all causes, and settings."""
        return presentation.sections(self)

    @property
    def next_step(self) -> str:
        """The measurement or the command that follows."""
        return presentation.next_step(self)

    def data(self) -> dict[str, Any]:
        """Return answer, causes, candidates, improvement and residuals by mode."""
        return {
            "measurements": self.measurements,
            "verdict": self.verdict,
            "final": self.final,
            "causes": [_as_dict(cause) for cause in self.causes],
            "ambiguous_between": self.ambiguous_between,
            "gain": self.gain,
            "gains": self.gains,
            "next_measurement": self.next_measurement,
            "candidates": [_as_dict(candidate) for candidate in self.candidates],
            "vetoed": [_as_dict(one) for one in self.vetoed],
            "alternatives": [_as_dict(alternative) for alternative in self.alternatives],
            "alternative": None if self.alternative is None else _as_dict(self.alternative),
            "threshold": self.threshold,
            "adequacy": self.adequacy,
            "adequacy_after": self.adequacy_after,
            "discrepancy": {"before": self.discrepancy, "after": self.discrepancy_after},
            "base": self.base.values,
            "extended": None if self.extended is None else self.extended.values,
            "residuals_by_mode": {
                "before": self.modes,
                "after": None if self.explanation is None else self.modes_after,
            },
            "held_out_by_mode": {"before": self.held_out_modes, "after": self.held_out_modes_after},
            "bias": None if self.bias is None else {**asdict(self.bias), "text": str(self.bias)},
            "frequency_errors_percent": self.frequency_errors(),
            "undecidable": self.undecidable,
            "settings": self.settings,
        }

    def __repr__(self) -> str:
        names = ", ".join(cause.id for cause in self.causes)
        open_ = "" if self.final else ", not final"
        return f"Verdict({self.verdict}{open_}{': ' + names if names else ''}; misfit {self.adequacy.misfit:.2f})"


def _as_dict(one: CandidateCause) -> dict[str, Any]:
    names = ("value", "lower", "upper")
    found = {name: dict(zip(names, numbers, strict=True)) for name, numbers in one.parameters.items()}
    own = {each.name: getattr(one, each.name) for each in fields(one) if each.name not in ("explanation", "declared")}
    return {**own, "parameters": found}
