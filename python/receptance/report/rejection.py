"""Why the numbers of a result must not be used, or rest on intervals that include an error of the model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

REJECTED = "Rejected: do not use these numbers"
"""Heading of the reasons for which numbers must not be used."""
WIDENED = "Not adequate: the intervals include an error of the model"
"""Heading of the reasons for which intervals are widened."""


@dataclass(frozen=True)
class Rejection:
    """Rejection of a fit or of a result that uses it, with the remedies; false if there is none.

    Examples
    --------
    >>> from receptance.report import Rejection
    >>> both = Rejection(widened=("the model leaves residuals",)) + Rejection(unusable=("not converged",))
    >>> list(both), bool(Rejection())
    (['not converged', 'the model leaves residuals'], False)
    """

    unusable: tuple[str, ...] = ()
    """Reasons for which the numbers must not be used, a sentence each."""
    widened: tuple[str, ...] = ()
    """Reasons for which the numbers are those of a fit that allows for an error of its model, a sentence each."""

    def __bool__(self) -> bool:
        return bool(self.unusable or self.widened)

    def __iter__(self) -> Iterator[str]:
        yield from (*self.unusable, *self.widened)

    def __add__(self, other: Rejection) -> Rejection:
        """Return the reasons of both, each once."""
        unusable = tuple(dict.fromkeys((*self.unusable, *other.unusable)))
        return Rejection(unusable, tuple(dict.fromkeys((*self.widened, *other.widened))))

    def of(self, name: str) -> Rejection:
        """Return the reasons with the name of what they are about before each."""
        unusable, widened = (tuple(f"{name}: {text}" for text in texts) for texts in (self.unusable, self.widened))
        return Rejection(unusable, widened)

    def headed(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Yield a heading and the reasons of each kind."""
        yield from (pair for pair in ((REJECTED, self.unusable), (WIDENED, self.widened)) if pair[1])

    def data(self) -> dict[str, tuple[str, ...]]:
        """Return the reasons of each kind, by the names that they have in JSON."""
        return {name: texts for name, texts in (("rejected", self.unusable), ("not_adequate", self.widened)) if texts}


ACCEPTED = Rejection()
"""No rejection."""
