"""The menu: hypothetical measurements, among them those that one can still make on what was measured.

A hypothetical measurement is an observation without values, which a predictor simulates, with the errors that only it
has and its cost. The menu makes them from the measurements of a fit or of a diagnosis, with their lines and their
noise: one of them again, at the holder's nose, at a longer overhang, at a higher force, tool and holder alone, and for
a holder in a spindle a gauge blank in the same spindle in place of the holder alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile
from typing import Any

import numpy as np

from receptance import _checks
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Tolerance, Unknown, covered
from receptance.fit.weights import Floor
from receptance.model.anatomy import Anatomy, anatomy_of, overhang_of
from receptance.model.assembly import Assembly
from receptance.model.beams import STEEL, Part, Segment
from receptance.model.coordinates import Coordinate

LONGER = 1.3
"""A longer overhang, as a multiple of the longest one that was measured."""
HARDER = 3.0
"""A higher force, as a multiple of the highest one that was measured."""
RESOLUTION_ALONE = 1e-3
"""Standard deviation of natural frequencies of a part alone, as a share."""
MODES_ALONE = 3
"""Number of natural frequencies of a part alone."""
HIGHEST_ALONE = 2e4
"""Highest natural frequency of a part alone in Hz."""


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
        Cost in any unit that is the same for all candidates. In the menu it is the effort, about that of so many hits
        on the machine.

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


@dataclass(frozen=True, eq=False)
class Menu:
    """Measurements that one can still make on what was measured, each as a candidate, or None where there is none.

    They are like the first receptance that was measured, or else like the first natural frequencies: with its lines or
    modes, and its noise. Each is a configuration of its own, because the tool may have been clamped again since: laws
    have individual parts of their own there. The errors of dimensions are those of the measurement that it is like,
    except for a new overhang.

    Parameters
    ----------
    observations : tuple of Observation
        The measurements, with standard deviations.
    unknowns : tuple of Unknown
        Unknowns of the fit: they tell which joint is identified.
    tolerances : tuple of Tolerance
        Errors of dimensions, materials and clampings.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
    >>> from receptance.predict import Menu
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> lines = np.linspace(100.0, 5000.0, 200)
    >>> tip = Observation(
    ...     label="tip", assembly=pair, frequency_hz=lines, receptance=pair.receptance(lines), standard_deviation=0.02
    ... )
    >>> menu = Menu((tip,), (Unknown(address="joint.k_theta", lower=1e3, upper=1e7),), ())
    >>> [candidate.label for candidate in menu.candidates()]
    ['tip again', 'at the nose of holder', 'at a longer overhang', 'tool alone, free-free', 'holder alone, free-free']
    """

    observations: tuple[Observation, ...]
    unknowns: tuple[Unknown, ...]
    tolerances: tuple[Tolerance, ...]

    def candidates(self) -> list[Candidate]:
        """Return all that there are."""
        menu = (
            self.again(),
            self.at_the_nose(),
            self.longer_overhang(),
            self.higher_force(),
            self.tool_alone(),
            self.holder_alone(),
            self.blank_in_spindle(),
        )
        return [candidate for candidate in menu if candidate is not None]

    @cached_property
    def _anatomies(self) -> list[Anatomy]:
        identified = [unknown.address for unknown in self.unknowns]
        return [anatomy_of(observation.assembly, identified) for observation in self.observations]

    @cached_property
    def _first(self) -> int:
        """Index of the observation that the new ones are like."""
        return next((i for i, observation in enumerate(self.observations) if observation.is_receptance), 0)

    def again(self) -> Candidate:
        """Return the same measurement once more."""
        return self._like(f"{self.observations[self._first].title(self._first)} again", 2.0)

    def at_the_nose(self) -> Candidate | None:
        """Return a direct FRF at the nose of the holder."""
        holder = self._anatomies[self._first].holder
        if not holder or not self.observations[self._first].is_receptance:
            return None
        nose = Coordinate(holder[0], 0.0)
        return self._like(f"at the nose of {holder[0]}", 3.0, response=nose, excitation=nose)

    def longer_overhang(self) -> Candidate | None:
        """Return a measurement at a longer overhang than all that were measured, with a clamping of its own."""
        observation, anatomy = self.observations[self._first], self._anatomies[self._first]
        if not anatomy.joint:
            return None
        label, address = "at a longer overhang", overhang_of(observation.assembly, anatomy)
        assemblies = [other.assembly for other in self.observations if address in other.assembly.parameters]
        longer = LONGER * max(assembly.get(address) for assembly in assemblies)
        errors = tuple(
            replace(error, name=f"{error.name}, {label}")
            if error.configurations and any(address in covered(moved, observation.assembly) for moved in error.moves)
            else error
            for error in self._errors(self._first, label)
        )
        conditions = {n: longer if n in ("overhang", address) else x for n, x in observation.conditions.items()}
        assembly = observation.assembly.replace({address: longer})
        return self._like(label, 3.0, errors=errors, assembly=assembly, conditions=conditions)

    def higher_force(self) -> Candidate | None:
        """Return a measurement at a higher force than all that were measured, where forces are known."""
        measured = self.observations[self._first]
        changes: dict[str, Any] = {}
        levels = [other.conditions["force"] for other in self.observations if "force" in other.conditions]
        if levels:
            changes["conditions"] = {**measured.conditions, "force": HARDER * max(levels)}
        if measured.force is not None:
            changes["force"] = HARDER * max(float(o.force.max()) for o in self.observations if o.force is not None)
        return self._like(f"at {HARDER:g} times the force", 3.0, **changes) if changes else None

    def tool_alone(self) -> Candidate | None:
        """Return natural frequencies of the tool with the longest overhang, alone and free-free."""
        return self._alone("tool")

    def holder_alone(self) -> Candidate | None:
        """Return natural frequencies of the holder alone and free-free, up to the next joint behind it.

        There are none of a holder in a spindle.
        """
        return None if any(anatomy.in_spindle for anatomy in self._anatomies) else self._alone("holder")

    def blank_in_spindle(self) -> Candidate | None:
        """Return a direct FRF at the tip of a gauge blank in place of tool and holder, for a holder in a spindle.

        The blank is a steel cylinder with the length of the holder and its diameter at the spindle.
        """
        measured, anatomy = self.observations[self._first], self._anatomies[self._first]
        if not anatomy.in_spindle or not anatomy.holder or not measured.is_receptance:
            return None
        elements = measured.assembly.elements
        parts = [measured.assembly.parts[name] for name in anatomy.holder]
        (_, (diameter, _)) = parts[-1].segments[-1].ends
        length = sum(segment.length for part in parts for segment in part.segments)
        blank = Part([Segment(length=length, outer_diameter=diameter, material=STEEL)], name="gauge_blank")
        end = replace(elements[anatomy.end], name=anatomy.end)
        assembly = Assembly([blank, end], motion=measured.assembly.motion)
        label, tip = "gauge blank in the spindle", Coordinate(blank.name, 0.0)
        return self._like(label, 3.0, assembly=assembly, response=tip, excitation=tip)

    def _like(
        self, label: str, cost: float, *, errors: tuple[Tolerance, ...] | None = None, **changes: Any
    ) -> Candidate:
        """Return a measurement like the first one, with changes."""
        measured = self.observations[self._first]
        fields: dict[str, Any] = {
            "label": label,
            "assembly": measured.assembly,
            "conditions": measured.conditions,
        }
        if measured.is_receptance:
            places = {"response": measured.response, "excitation": measured.excitation, "force": measured.force}
            observation = Observation(
                frequency_hz=measured.frequency_hz,
                standard_deviation=float(np.median(np.asarray(measured.standard_deviation))),
                floor=Floor(),
                **(places | fields | changes),
            )
        else:
            deviation = measured.standard_deviation
            observation = Observation.from_modes(
                modes=measured.modes, standard_deviation_hz=deviation, **(fields | changes)
            )
        errors = self._errors(self._first, label) if errors is None else errors
        return Candidate(observation=observation, tolerances=errors, cost=cost)

    def _alone(self, side: str) -> Candidate | None:
        index = max(range(len(self.observations)), key=self._overhang)
        observation, names = self.observations[index], getattr(self._anatomies[index], side)
        if not names:
            return None
        elements = observation.assembly.elements
        chain = list(elements)
        chain = list(takewhile(lambda name: name in names, chain[chain.index(names[0]) :]))
        assembly = Assembly([replace(elements[name], name=name) for name in chain], motion=observation.assembly.motion)
        frequencies = assembly.natural_frequencies(HIGHEST_ALONE)[:MODES_ALONE]
        if not frequencies.size:
            return None
        label = f"{' and '.join(chain)} alone, free-free"
        alone = Observation.from_modes(
            label=label,
            assembly=assembly,
            modes=range(1, frequencies.size + 1),
            standard_deviation_hz=RESOLUTION_ALONE * frequencies,
            conditions=observation.conditions,
        )
        return Candidate(observation=alone, tolerances=self._errors(index, label), cost=4.0)

    def _errors(self, index: int, label: str) -> tuple[Tolerance, ...]:
        """Return the errors of a measurement as those of the new one."""
        site = self.observations[index].site(index)
        return tuple(
            error
            if error.configurations is None and error.labels is None
            else replace(error, configurations=(label,), labels=None)
            for error in self.tolerances
            if site.among(error.configurations, error.labels)
        )

    def _overhang(self, index: int) -> float:
        assembly, anatomy = self.observations[index].assembly, self._anatomies[index]
        return assembly.get(overhang_of(assembly, anatomy)) if anatomy.joint else 0.0
