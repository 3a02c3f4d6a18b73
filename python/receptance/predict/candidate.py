"""Hypothetical measurements: observations without data, which a predictor simulates."""

from __future__ import annotations

from dataclasses import dataclass

from receptance import _checks
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Tolerance


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A hypothetical measurement: an observation without values, the errors that only it has, and its cost.

    `next_measurement` ranks candidates, and takes them as predictions that are to be improved.

    Parameters
    ----------
    observation : Observation
        What would be measured; its label is the name of the candidate. A prediction needs no standard deviation.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the measurement, of its clamping for example. An error with the name of an error of the fit is the
        same error. Errors of the fit that the assembly has apply in any case.
    cost : float, optional
        Cost in any unit that is the same for all candidates.

    Raises
    ------
    TypeError, ValueError
        An observation without a label, or a cost that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.fit import Observation
    >>> from receptance.predict import Candidate
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> blank = Observation(
    ...     label="blank", assembly=bar, frequency_hz=np.linspace(100.0, 4000.0, 40), standard_deviation=0.01
    ... )
    >>> Candidate(observation=blank, cost=2.0)
    Candidate('blank', 40 lines from 100 to 4000 Hz)
    """

    observation: Observation
    tolerances: tuple[Tolerance, ...] = ()
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.observation, Observation):
            raise TypeError(f"Candidate: observation is {self.observation!r}, expected an Observation")
        if not self.observation.label:
            raise ValueError(f"Candidate: {self.observation!r} has no label, expected one, which names the candidate")
        owner = f"Candidate {self.label!r}"
        tolerances = _checks.items(f"{owner}: tolerances", self.tolerances, Tolerance, least=0)
        _checks.set_fields(self, {"tolerances": tolerances, "cost": _checks.positive(owner, "cost", self.cost)})

    @property
    def label(self) -> str:
        """Label of the observation."""
        return self.observation.label

    def __repr__(self) -> str:
        return f"Candidate{repr(self.observation).removeprefix('Observation')}"
