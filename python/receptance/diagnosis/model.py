"""The model under diagnosis: observations with their assemblies, unknowns and tolerances, and changes of these."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

from receptance.diagnosis.truncation import truncation_time
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.line_selection import resonant_lines
from receptance.fit.observation import Observation, Unit, altered
from receptance.fit.parameters import Parameters, Site
from receptance.fit.problem import Problem, Task
from receptance.fit.unknowns import Law, Move, Tolerance, Unknown, covered
from receptance.model.addresses import edges_of, place_on, points_of
from receptance.model.anatomy import Anatomy, anatomy_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.model.terminals import MODE_ADDRESS

_Changed = TypeVar("_Changed")
SPRING_TERMS = tuple(field for field in PointJoint.columns_of if field != "loss_factor")
"""Stiffnesses and dampings of a spring."""
_SEGMENT = re.compile(r"(\w+)\.segment\[(\d+)\]\.(.+)")


DATA_HOLDER = "the holder is described by data"
"""Why a cause in the holder is not decided where no beams describe it."""
TABLE = "the model ends with a table of receptances"
"""Why a cause is not decided beside a table."""


class UndecidableError(Exception):
    """The data cannot show a cause; the message names the missing data, `shared` a reason of several causes."""

    def __init__(self, message: str, shared: str = "") -> None:
        super().__init__(message)
        self.shared = shared


class IndescribableError(UndecidableError, ValueError):
    """A cause cannot be described for an assembly or a position; the message names it."""


@dataclass(frozen=True, eq=False)
class Model:
    """Observations, unknowns and tolerances: the arguments of `identify`.

    It is immutable; methods return changed copies.
    """

    observations: tuple[Observation, ...]
    """The measurements."""
    unknowns: tuple[Unknown, ...]
    tolerances: tuple[Tolerance, ...] = ()
    """Errors of dimensions and materials."""
    witnesses: tuple[Observation, ...] = ()
    """Observations that are changed with the others and never fitted. Their places decided where the parts of the
    diagnosed model are divided; other observations with the same causes are divided at the same places."""
    truncation: float | None = None
    """Time in s after the hit at which the records were truncated, where all their lines show it."""
    seed: int = 0
    """Seed of the random numbers of its fits."""
    threads: int | None = None
    """As in `Assembly.receptance`; it does not change results."""
    shorter: Model | None = field(default=None, init=False)
    """The model to which `plus` has added the last unknowns; the parameters of both are prepared once."""

    def with_shared_assemblies(self) -> Model:
        """Return the model in which observations of equal assemblies have the same one, so that it is prepared once."""
        different: list[Assembly] = []

        def share(observation: Observation) -> Observation:
            for own in different:
                if own == observation.assembly:
                    return altered(observation, assembly=own)
            different.append(observation.assembly)
            return observation

        return self.map(share)

    def with_witnesses(self) -> Model:
        """Return the model with what causes need of all its lines, which models of fewer lines keep.

        These are one observation for each set of places with one of the sensor as its witnesses, and the time of a
        truncation.
        """
        kept: dict[tuple[object, ...], Observation] = {}
        for observation in self.observations:
            parts = [name for name, element in observation.assembly.elements.items() if isinstance(element, Part)]
            places = [(name, *sorted(places_on(observation, name))) for name in parts]
            sensor = (observation.response.part, observation.response.position) if observation.is_receptance else ()
            kept.setdefault((*places, sensor), observation)
        return replace(self, witnesses=tuple(kept.values()), truncation=truncation_time(self.receptances))

    @cached_property
    def task(self) -> Task:
        """The fit problem as a task of the identification."""
        units: tuple[Unit, ...] = tuple("standard deviations" for _ in self.observations)
        return Task(self.observations, self._parameters, units, threads=self.threads)

    @cached_property
    def _parameters(self) -> Parameters:
        if self.shorter is None:
            return Parameters(self.unknowns, self.tolerances, self._places_in_laws)
        return self.shorter._parameters.plus(self.unknowns[len(self.shorter.unknowns) :])

    @cached_property
    def problem(self) -> Problem:
        """The residuals on all lines."""
        return self.task.problem()

    @cached_property
    def on_few_lines(self) -> dict[int, tuple[Observation, ...]]:
        """Observations on the most informative lines, by their number; `line_selection.on_few_lines` adds them."""
        return {}

    @cached_property
    def _places_in_laws(self) -> list[Site]:
        return [observation.site(i) for i, observation in enumerate(self.observations)]

    @cached_property
    def configuration_of(self) -> tuple[str, ...]:
        """Name of the configuration of each observation."""
        return tuple(place.configuration for place in self._places_in_laws)

    @cached_property
    def configurations(self) -> tuple[str, ...]:
        """Names of the configurations."""
        return tuple(dict.fromkeys(self.configuration_of))

    @cached_property
    def receptances(self) -> tuple[Observation, ...]:
        """The observations that are receptances."""
        return tuple(observation for observation in self.observations if observation.is_receptance)

    @cached_property
    def frequencies(self) -> tuple[Observation, ...]:
        """The observations that are natural frequencies."""
        return tuple(observation for observation in self.observations if not observation.is_receptance)

    @cached_property
    def anatomies(self) -> tuple[Anatomy, ...]:
        """Tool, joint and holder of each observation."""
        identified = [unknown.address for unknown in self.unknowns]
        return tuple(anatomy_of(observation.assembly, identified) for observation in self.observations)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints between tool and holder."""
        return tuple(dict.fromkeys(anatomy.joint for anatomy in self.anatomies if anatomy.joint))

    @property
    def unknown_modes(self) -> tuple[tuple[str, int], ...]:
        """Modes whose natural frequencies are unknowns: name of the modal part and index."""
        matches = [MODE_ADDRESS.fullmatch(unknown.address) for unknown in self.unknowns]
        return tuple((match[1], int(match[2])) for match in matches if match and match[3] == "frequency_hz")

    @property
    def in_spindle(self) -> bool:
        """Whether all assemblies are in a spindle that is described by its modes or receptances."""
        return all(anatomy.in_spindle for anatomy in self.anatomies)

    @property
    def separable(self) -> tuple[str, str]:
        """Sources of misfit that several configurations distinguish, and the one to measure where there is one."""
        if self.joints:
            return "the joint from the parts", "another overhang"
        return "one error of the parts from another", "another configuration"

    @property
    def tip(self) -> str:
        """Name of the part with the tip; raises `UndecidableError` where it differs between the assemblies."""
        # The first element of an assembly is a part.
        tips = {anatomy.tool[0] for anatomy in self.anatomies}
        if len(tips) != 1:
            raise UndecidableError("the tools have different names in the assemblies")
        return tips.pop()

    def joint_addresses(self, field: str) -> tuple[str, ...]:
        """Return the addresses of a field of all joints, and of parameters that are multiples of these."""
        own = [address for name in self.joints for address in self.addresses_of(name, field)]
        also = [other for unknown in self.unknowns if unknown.address in own for other in unknown.also]
        return tuple(dict.fromkeys([*own, *also]))

    def addresses_of(self, joint: str, field: str) -> tuple[str, ...]:
        """Return the addresses of a field of a joint: two where the joint is a collet between two springs."""
        possible = (f"{joint}.{field}", f"{joint}.inner.{field}", f"{joint}.outer.{field}")
        return tuple(a for a in possible if any(covered(a, observation.assembly) for observation in self.observations))

    def has(self, address: str) -> bool:
        """Return whether the parameter at an address is an unknown."""
        return any(
            covered(address, observation.assembly) & covered(unknown.address, observation.assembly)
            for observation in self.observations
            for unknown in self.unknowns
            if not isinstance(unknown, Move)
        )

    def couple_terms(self, *joints: str) -> Model:
        """Return the model in which the coupling terms of joints follow the laws of the other terms.

        They vary as the geometric mean of these: another clamping or another torque changes all terms of a contact.
        """

        def one(unknown: Unknown) -> Unknown:
            if not isinstance(unknown, Law) or unknown.free:
                return unknown
            reached = (unknown.address, *unknown.also)
            pairs = ((f"{joint}.{kind}", f"{joint}.{kind}_ytheta") for joint in joints for kind in "kc")
            own = {term: 0.5 for stem, term in pairs if f"{stem}_y" in reached or f"{stem}_theta" in reached}
            return replace(unknown, follows={**unknown.follows, **own})

        unknowns = tuple(one(unknown) for unknown in self.unknowns)
        return self if unknowns == self.unknowns else replace(self, unknowns=unknowns)

    def plus(self, *unknowns: Unknown) -> Model:
        """Return the model with more unknowns."""
        result = replace(self, unknowns=(*self.unknowns, *unknowns))
        object.__setattr__(result, "shorter", self)
        return result

    def map_receptances(self, change: Callable[[Observation], Observation]) -> Model:
        """Return the model with changed receptances, witnesses included."""
        return self.map(lambda observation: change(observation) if observation.is_receptance else observation)

    def map(self, change: Callable[[Observation], Observation]) -> Model:
        """Return the model with every observation changed."""
        observations, witnesses = (tuple(change(one) for one in own) for own in (self.observations, self.witnesses))
        return replace(self, observations=observations, witnesses=witnesses)

    def allow(self, discrepancy: Discrepancy) -> Model:
        """Return the model with observations, witnesses included, whose variance includes a discrepancy."""
        observations = discrepancy.allow(self.observations, self.configuration_of)
        return replace(self, observations=observations, witnesses=tuple(map(discrepancy.enlarge, self.witnesses)))

    def resonant(self) -> Model:
        """Return the model on few lines of each receptance, without those of antiresonances."""
        return replace(self, observations=resonant_lines(self.observations, self.configuration_of))

    def of(self, configurations: Collection[str]) -> tuple[Observation, ...]:
        """Return the observations of some configurations."""
        pairs = zip(self.configuration_of, self.observations, strict=True)
        return tuple(one for name, one in pairs if name in configurations)

    def without(self, configurations: Collection[str]) -> Model:
        """Return the model without some configurations, and without unknowns and errors that only these have."""
        return self.select(self.of([name for name in self.configurations if name not in configurations]))

    def select(self, observations: Sequence[Observation]) -> Model:
        """Return the model of some of its observations, without unknowns and errors that only the others have."""
        places = [observation.site(i) for i, observation in enumerate(observations)]

        def observed(
            addresses: Sequence[str],
            configurations: tuple[str, ...] | None,
            labels: tuple[str, ...] | str | None = None,
        ) -> bool:
            own = [p for p in places if p.among(configurations, labels)]
            return all(any(p.covered(address) for p in own) for address in addresses)

        return replace(
            self,
            observations=tuple(observations),
            unknowns=tuple(u for u in self.unknowns if observed(u.addresses, u.configurations)),
            tolerances=tuple(t for t in self.tolerances if observed(tuple(t.moves), t.configurations, t.labels)),
        )

    def with_change(self, change: Callable[..., _Changed], *arguments: Hashable) -> _Changed:
        """Return `change(model, *arguments)`, the same model each time.

        Variants that share a change share its model, which is then prepared and evaluated once.
        """
        if (change, arguments) not in self._changed:
            self._changed[change, arguments] = change(self, *arguments)
        changed: _Changed = self._changed[change, arguments]
        return changed

    @cached_property
    def _changed(self) -> dict[tuple[Callable[..., Any], tuple[Hashable, ...]], Any]:
        return {}

    def rebuild(self, build: Callable[[Assembly], Assembly]) -> Model:
        """Return the model with every assembly changed."""
        # Records of one configuration share their assembly before and after.
        different = {id(one.assembly): one.assembly for one in (*self.observations, *self.witnesses)}
        built = {key: build(assembly) for key, assembly in different.items()}
        return self.map(lambda one: altered(one, assembly=built[id(one.assembly)]))

    def attach(self, *points: PointMass | GroundSpring | Resonator) -> Model:
        """Return the model with point elements on every assembly that has their part."""

        def build(assembly: Assembly) -> Assembly:
            own = [point for point in points if not point.part or point.part in assembly.elements]
            return with_points(assembly, *own)

        return self.rebuild(build)

    def parts(self, name: str) -> list[Part]:
        """Return the part of a name of each observation that has it."""
        return [
            part_of(observation.assembly, name)
            for observation in self.observations
            if name in observation.assembly.elements
        ]

    def owners(self, part: str) -> list[Observation]:
        """Return the observations, witnesses included, whose assembly has a part."""
        return [one for one in (*self.observations, *self.witnesses) if part in one.assembly.elements]

    def places(self, part: str) -> list[float]:
        """Return the positions of coordinates and attachments on a part, in m from its start, without its far end.

        Raises
        ------
        IndescribableError
            An observation has a position that no witness has: the diagnosed model is not divided there.
        """
        found = sorted({x for one in self.owners(part) for x in places_on(one, part)})
        known = {x for one in self.witnesses if part in one.assembly.elements for x in places_on(one, part)}
        if self.witnesses and (new := sorted(set(found) - known)):
            raise IndescribableError(
                f"a coordinate or an attachment is on {part} at {1e3 * new[0]:g} mm, where the diagnosed data have none"
            )
        return found

    def steps(self, part: str) -> list[float]:
        """Return the positions where segments of a part meet in any of the assemblies, in m from its start."""
        return sorted({edge for one in self.owners(part) for edge in edges_of(one.assembly.elements[part])[1:-1]})

    def split(self, part: str, position: float | Callable[[Part], float]) -> tuple[Model, int]:
        """Return the model with a segment of a part divided at a position, and the index of the second piece.

        Unknowns, tolerances and conditions keep their meaning: those of the divided segment apply to both pieces, and
        those of its length to the second one.

        Parameters
        ----------
        part : str
            Name of the part.
        position : float or callable
            In m from the start of the part, or a function of the part.

        Raises
        ------
        IndescribableError
            The position is not in the same segment of every assembly, or an unknown is of that segment alone.
        """
        place: Callable[[Part], float] = position if callable(position) else lambda own: position
        owners = [part_of(one.assembly, part) for one in self.owners(part)]
        where = [_segment_at(owner, place(owner)) for owner in owners]
        index = where[0][0] if where else 0
        if not where or any(own != index for own, _ in where):
            raise IndescribableError(f"{part}: the position to divide at is not in the same segment of every assembly")
        if all(within == 0.0 for _, within in where):
            return self, index
        frozen = {p.of for u in self.unknowns if isinstance(u, Law) for p in u.powers}
        frozen |= {u.of for u in self.unknowns if isinstance(u, Move) and u.of}

        def change(observation: Observation) -> Observation:
            if part not in observation.assembly.elements:
                return observation
            values = {name: observation.assembly.get(name) for name in frozen if covered(name, observation.assembly)}
            own = part_of(observation.assembly, part)
            assembly = _divide(observation.assembly, part, index, _segment_at(own, place(own))[1])
            return altered(observation, assembly=assembly, conditions={**values, **observation.conditions})

        changed = self.map(change).with_shared_assemblies()
        single = all(len(one.segments) == 1 for one in self.parts(part))
        unknowns = tuple(_renumber(unknown, part, index, single) for unknown in self.unknowns)
        tolerances = tuple(replace(t, moves=_moves(t.moves, part, index)) for t in self.tolerances)
        return replace(changed, unknowns=unknowns, tolerances=tolerances), index + 1


def require_beams(model: Model) -> None:
    """Raise `UndecidableError` if data describe all that is behind the joint: they have no dimensions or materials."""
    data = dict.fromkeys(
        anatomy.end for anatomy in model.anatomies if anatomy.joint and anatomy.end and not anatomy.holder
    )
    if data:
        raise UndecidableError(
            f"{DATA_HOLDER} ({', '.join(data)}), not by beams: they contain its errors, and a change since they were "
            "measured has no place in the model; measure the holder again",
            DATA_HOLDER,
        )


def require_joint(model: Model) -> None:
    """Raise `UndecidableError` if no assembly has a joint between tool and holder."""
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")


def far_end(model: Model) -> str:
    """Return the last part of the holder, the same in all assemblies; raises `UndecidableError` where there is none."""
    parts = {anatomy.holder[-1] for anatomy in model.anatomies if anatomy.holder}
    if len(parts) != 1:
        raise UndecidableError("the model has no holder, or several")
    return parts.pop()


def require_no_table(model: Model, reason: str) -> None:
    """Raise `UndecidableError` if an assembly ends with a table of receptances, which does not allow for a cause."""
    if any(observation.assembly.tabulated for observation in model.observations):
        raise UndecidableError(f"{TABLE}, {reason}", TABLE)


def places_on(observation: Observation, part: str) -> Iterator[float]:
    """Yield the positions of an observation's coordinates and attachments on a part, in m, without its far end."""
    elements = observation.assembly.elements
    end = edges_of(elements[part])[-1]
    coordinates = (observation.response, observation.excitation) if observation.is_receptance else ()
    own = [place_on(elements, "coordinate", place.part, place.position) for place in coordinates]
    for name, point in observation.assembly.attachments.items():
        carrier, points = points_of(elements, name, point)
        own += [(carrier, x) for x in points]
    yield from (x for carrier, x in own if carrier == part and x != end)


def part_of(assembly: Assembly, name: str) -> Part:
    """Return a part of an assembly."""
    part = assembly.elements[name]
    if not isinstance(part, Part):
        raise IndescribableError(f"{name} is no part")
    return part


def with_points(assembly: Assembly, *points: PointMass | GroundSpring | Resonator) -> Assembly:
    """Return the assembly with more point elements."""
    own = named(assembly.attachments).values()
    return Assembly(named(assembly.elements).values(), [*own, *points], motion=assembly.motion)


def named(elements: Mapping[str, Any]) -> dict[str, Any]:
    """Return elements or attachments by name, each with that name."""
    return {name: replace(element, name=name) for name, element in elements.items()}


def _segment_at(part: Part, position: float) -> tuple[int, float]:
    """Return the index of the segment at a position, and the distance from the segment's start."""
    begin = 0.0
    for index, segment in enumerate(part.segments):
        if position < begin + segment.length:
            return index, position - begin
        begin += segment.length
    raise IndescribableError(f"position {position:g} m lies behind the part's end at {begin:g} m")


def _divide(assembly: Assembly, part: str, index: int, length: float) -> Assembly:
    elements = named(assembly.elements)
    segments = list(elements[part].segments)
    whole = segments[index]
    segments[index : index + 1] = [replace(whole, length=length), replace(whole, length=whole.length - length)]
    elements[part] = Part(segments, name=part)
    return Assembly(elements.values(), named(assembly.attachments).values(), motion=assembly.motion)


def _pieces(address: str, part: str, index: int) -> tuple[str, ...]:
    """Return the addresses that replace an address after segment `index` was divided."""
    found = _SEGMENT.fullmatch(address)
    if found is None or found[1] != part or int(found[2]) < index:
        return (address,)
    number, field = int(found[2]), found[3]
    names = tuple(f"{part}.segment[{n}].{field}" for n in (number, number + 1))
    return names if number == index and field != "length" else names[1:]


def _moves(moves: Mapping[str, float], part: str, index: int) -> dict[str, float]:
    return {piece: n for address, n in moves.items() for piece in _pieces(address, part, index)}


def _renumber(unknown: Unknown, part: str, index: int, single: bool) -> Unknown:
    if isinstance(unknown, Move):
        return replace(unknown, moves=_moves(unknown.moves, part, index))
    pieces = _pieces(unknown.address, part, index)
    if len(pieces) == 1:
        return replace(unknown, address=pieces[0], name=unknown.name)
    if single:
        return replace(unknown, address=re.sub(r"\[\d+\]", "[*]", unknown.address), name=unknown.name)
    raise IndescribableError(f"the unknown {unknown.name!r} is of a segment that is to be divided")
