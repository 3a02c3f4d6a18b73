"""Hypothetical measurements: observations without data, which a predictor simulates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.identification.from_frf import Floor
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, altered
from receptance.identification.unknowns import Tolerance
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A hypothetical measurement: an observation without data.

    It is a receptance on `frequency_hz`, or the natural frequencies of some `modes`. `next_measurement` ranks
    candidates, and takes them as predictions that are to be improved.

    Parameters
    ----------
    label : str
        Its name.
    assembly : Assembly
        The assembly that would be measured. The values of identified parameters do not matter.
    frequency_hz : array_like, optional
        `(n,)` ascending lines of a receptance in Hz, complex where an exponential window would be used.
    response, excitation : Coordinate, optional
        Coordinates of the motion and of the load; by default y at the tip.
    standard_deviation : array_like, optional
        Standard deviation of the real and of the imaginary part of the logarithm of the receptance, one number or
        `(n,)`; by default 1 %.
    floor : float or Floor, optional
        Standard deviation of errors that no noise model covers, added in quadrature as in `MeasuredFRF.from_frf`.
    modes : sequence of int, optional
        Ascending numbers of the elastic modes whose natural frequencies would be measured; the lowest is 1.
    standard_deviation_hz : array_like, optional
        Standard deviation of these frequencies in Hz, one number or one for each mode. A prediction needs none.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the measurement, of its clamping for example. An error with the name of an error of the fit is the
        same error. Errors of the fit that the assembly has apply in any case.
    configuration : str, optional
        Name of its configuration, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws.
    cost : float, optional
        Cost in any unit that is the same for all candidates.

    Raises
    ------
    TypeError, ValueError
        Neither lines nor modes, or both; lines, modes or standard deviations that cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import Candidate
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> blank = Candidate(label="blank", assembly=bar, frequency_hz=np.linspace(100.0, 4000.0, 40))
    >>> blank
    Candidate('blank', receptance on 40 lines from 100 to 4000 Hz)
    >>> blank.observation(bar.receptance(blank.frequency_hz))
    MeasuredFRF('blank', 40 lines from 100 to 4000 Hz)
    """

    label: str
    assembly: Assembly
    frequency_hz: NDArray[np.inexact] | None = None
    response: Coordinate = field(default_factory=Coordinate)
    excitation: Coordinate = field(default_factory=Coordinate)
    standard_deviation: ArrayLike = 0.01
    floor: float | Floor = 0.0
    modes: tuple[int, ...] | None = None
    standard_deviation_hz: ArrayLike | None = None
    tolerances: tuple[Tolerance, ...] = ()
    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.label, str) or not self.label:
            raise TypeError(f"Candidate: label is {self.label!r}, expected a name as text")
        owner = f"Candidate {self.label!r}"
        if (self.frequency_hz is None) == (self.modes is None):
            both = "neither frequency_hz nor modes is" if self.modes is None else "frequency_hz and modes are both"
            raise ValueError(f"{owner}: {both} given, expected one of the two")
        if self.modes is not None and not len(self.modes):
            raise ValueError(f"{owner}: modes is empty, expected at least one number")
        fields: dict[str, Any] = {
            "tolerances": _checks.items(f"{owner}: tolerances", self.tolerances, Tolerance, least=0),
            "configuration": self.configuration or self.label,
            "floor": self.floor if isinstance(self.floor, Floor) else Floor(relative=self.floor, frequency=0.0),
            "cost": _checks.positive(owner, "cost", self.cost),
        }
        _checks.set_fields(self, fields)
        try:
            if self.frequency_hz is not None:
                _checks.frequencies(self.frequency_hz)
            blank = self._blank
        except (TypeError, ValueError) as error:
            kind = "MeasuredFRF" if self.modes is None else "MeasuredFrequencies"
            text = str(error).removeprefix(f"{kind} {self.label!r}: ")
            raise type(error)(f"{owner}: {text}") from None
        checked = ("conditions", "frequency_hz", "standard_deviation", "modes", "standard_deviation_hz")
        given = [name for name in checked if getattr(self, name) is not None and hasattr(blank, name)]
        _checks.set_fields(self, {name: getattr(blank, name) for name in given})

    def observation(self, data: ArrayLike | None = None) -> MeasuredFRF | MeasuredFrequencies:
        """Return the measurement as an observation.

        Parameters
        ----------
        data : array_like, optional
            `(n,)` receptances in SI units, or natural frequencies in Hz. By default placeholders:
            ones, and 1 Hz, 2 Hz and so on.

        Returns
        -------
        MeasuredFRF or MeasuredFrequencies
            With standard deviations that include the floor; those of frequencies are 1 Hz where none were given.
        """
        blank = self._blank
        if data is None:
            return blank
        if isinstance(blank, MeasuredFrequencies):
            return altered(blank, frequency_hz=np.asarray(data, dtype=np.float64))
        values = np.asarray(data, dtype=np.complex128)
        variance = np.square(np.asarray(self.standard_deviation, dtype=np.float64))
        if isinstance(self.floor, Floor) and self.floor:
            variance = variance + self.floor.variance(blank.frequency_hz.real, values)
        return altered(blank, receptance=values, standard_deviation=np.sqrt(variance))

    @cached_property
    def _blank(self) -> MeasuredFRF | MeasuredFrequencies:
        """The observation with ones as data; it checks the fields."""
        common: dict[str, Any] = {
            "assembly": self.assembly,
            "label": self.label,
            "configuration": self.configuration,
            "conditions": self.conditions,
        }
        if self.frequency_hz is None:
            modes = () if self.modes is None else self.modes
            return MeasuredFrequencies(
                frequency_hz=np.arange(1.0, 1.0 + len(modes)),
                modes=modes,
                standard_deviation_hz=1.0 if self.standard_deviation_hz is None else self.standard_deviation_hz,
                **common,
            )
        return MeasuredFRF(
            frequency_hz=self.frequency_hz,
            receptance=np.ones(np.size(self.frequency_hz)),
            response=self.response,
            excitation=self.excitation,
            standard_deviation=self.standard_deviation,
            **common,
        )

    def __repr__(self) -> str:
        if self.frequency_hz is None:
            what = f"natural frequencies of modes {', '.join(map(str, self.modes or ()))}"
        else:
            low, high = self.frequency_hz[[0, -1]].real
            what = f"receptance on {self.frequency_hz.size} lines from {low:g} to {high:g} Hz"
        return f"Candidate({self.label!r}, {what})"
