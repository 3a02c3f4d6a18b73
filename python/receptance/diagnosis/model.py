"""The model under diagnosis: observations with their assemblies, unknowns and tolerances, and changes of these."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from receptance.diagnosis.thresholds import EXPLORING_LINES
from receptance.diagnosis.truncation import record_ends
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.line_selection import informative_lines, resonant_lines
from receptance.fit.observation import Observation, Unit, altered
from receptance.fit.parameters import Parameters, Site
from receptance.fit.problem import Problem, Task
from receptance.fit.unknowns import Law, Move, Tolerance, Unknown, covered
from receptance.model.addresses import edges_of, place_on, points_of
from receptance.model.anatomy import Anatomy, anatomy_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Part, Segment
from receptance.model.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.model.terminals import MODE_ADDRESS

SPRING_TERMS = tuple(field for field in PointJoint.columns_of if field != "loss_factor")
"""Stiffnesses and dampings of a spring."""
_SEGMENT = re.compile(r"(\w+)\.segment\[(\d+)\]\.(.+)")


DATA_HOLDER = "holder_by_data"
"""Code of the reason why a cause in the holder is not decided where no beams describe it."""
TABLE = "ends_with_table"
"""Code of the reason why a cause is not decided where the model ends with a table of receptances."""


class UndecidableError(Exception):
    """The data cannot show a cause: the message names the missing data, `shared` is the code of a common reason."""

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
    ends: Mapping[str, float] = field(default_factory=dict)
    """Times in s after the hit at which records were truncated, where all their lines show it: see `record_ends`."""
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

        These are one observation for each set of places with one of the sensor as its witnesses, and the times at which
        records end.
        """
        kept: dict[tuple[object, ...], Observation] = {}
        for observation in self.observations:
            parts = [name for name, element in observation.assembly.elements.items() if isinstance(element, Part)]
            places = [(name, *sorted(places_on(observation, name))) for name in parts]
            sensor = (observation.response.part, observation.response.position) if observation.is_receptance else ()
            kept.setdefault((*places, sensor), observation)
        return replace(self, witnesses=tuple(kept.values()), ends=record_ends(self.receptances))

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
    def on_few_lines(self) -> tuple[Observation, ...]:
        """Observations on the most informative lines of each receptance."""
        # Models that differ in their unknowns share them.
        if self.shorter is not None and self.shorter.observations is self.observations:
            return self.shorter.on_few_lines
        chosen = informative_lines(self.observations, self.configuration_of, EXPLORING_LINES)
        return tuple(each.select(lines) for each, lines in zip(self.observations, chosen, strict=True))

    @property
    def thinned(self) -> Model:
        """The model of these lines."""
        return replace(self, observations=self.on_few_lines)

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
            unknowns=tuple(u for u in self.unknowns if observed(u.addresses, u.configurations, u.labels)),
            tolerances=tuple(t for t in self.tolerances if observed(tuple(t.moves), t.configurations, t.labels)),
        )

    def with_change(self, change: Callable[..., Model], *arguments: Hashable) -> Model:
        """Return `change(model, *arguments)`, the same model each time.

        Variants that share a change share its model, which is then prepared and evaluated once.
        """
        if (change, arguments) not in self._changed:
            self._changed[change, arguments] = change(self, *arguments)
        return self._changed[change, arguments]

    @cached_property
    def _changed(self) -> dict[tuple[Callable[..., Model], tuple[Hashable, ...]], Model]:
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
        those of its length to the second one. The diameters between the pieces of a cone follow those of its ends.

        Parameters
        ----------
        part : str
            Name of the part.
        position : float or callable
            In m from the start of the part, or a function of the part.

        Raises
        ------
        IndescribableError
            The position is not in the same segment of every assembly, or an unknown is of that segment alone; or the
            segment is a cone with an unknown diameter, or is not the same cone in every assembly.
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
        division = _division(part, index, zip(owners, (within for _, within in where), strict=True))
        unknowns = tuple(_renumber(unknown, division, single) for unknown in self.unknowns)
        tolerances = tuple(replace(t, moves=division.moves(t.moves, t.relative)) for t in self.tolerances)
        return replace(changed, unknowns=unknowns, tolerances=tolerances), index + 1


def require_beams(model: Model) -> None:
    """Raise `UndecidableError` if data describe all that is behind the joint: they have no dimensions or materials."""
    data = dict.fromkeys(
        anatomy.end for anatomy in model.anatomies if anatomy.joint and anatomy.end and not anatomy.holder
    )
    if data:
        raise UndecidableError(
            f"the holder is described by data ({', '.join(data)}), not by beams: they contain its errors, and a change "
            "since they were measured has no place in the model; measure the holder again",
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
        raise UndecidableError(f"the model ends with a table of receptances, {reason}", TABLE)


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
    share = length / whole.length
    near, far = whole.between(0.0, share), whole.between(share, 1.0)
    segments[index : index + 1] = [replace(near, length=length), replace(far, length=whole.length - length)]
    elements[part] = Part(segments, name=part)
    return Assembly(elements.values(), named(assembly.attachments).values(), motion=assembly.motion)


@dataclass(frozen=True)
class _Division:
    """A segment that was divided, and what replaces the parameters of its part."""

    part: str
    index: int
    cone: Segment | None = None
    """The whole segment if it is a cone."""
    share: float = 0.0
    """Length of the first piece of a cone over that of the cone."""

    def pieces(self, address: str) -> tuple[str, ...]:
        """Return the addresses of the pieces that replace an address of a segment."""
        match = _SEGMENT.fullmatch(address)
        if match is None or match[1] != self.part or int(match[2]) < self.index:
            return (address,)
        number, field = int(match[2]), match[3]
        names = tuple(f"{self.part}.segment[{n}].{field}" for n in (number, number + 1))
        return names if number == self.index and field != "length" else names[1:]

    def moves(self, moves: Mapping[str, float], relative: bool) -> dict[str, float]:
        """Return the moves of the pieces that together are the moves of the whole, to first order."""
        if self.cone is None:
            return {piece: n for address, n in moves.items() for piece in self.pieces(address)}
        return self._moves_of_cone(moves, relative, self.cone)

    def is_size(self, address: str) -> bool:
        """Return whether an address is that of a length or a diameter of the cone."""
        return self.cone is not None and self._slopes(address, self.cone) is not None

    def _moves_of_cone(self, moves: Mapping[str, float], relative: bool, cone: Segment) -> dict[str, float]:
        changed: dict[str, float] = {}
        for address, n in moves.items():
            slopes = self._slopes(address, cone)
            if slopes is None:
                for piece in self.pieces(address):
                    changed[piece] = changed.get(piece, 0.0) + n
                continue
            before = 1.0
            if relative:
                # d(log of a piece) = d(piece) / piece, where d(whole) = n whole; of a length, n times the second piece.
                whole = _SEGMENT.fullmatch(address)[3]  # type: ignore[index]
                before = (1.0 - self.share) * cone.length if whole == "length" else getattr(cone, whole)
            for piece, (slope, value) in slopes.items():
                ratio = slope * before / value if relative else slope
                changed[piece] = changed.get(piece, 0.0) + n * ratio
        return changed

    def _slopes(self, address: str, cone: Segment) -> dict[str, tuple[float, float]] | None:
        """Return derivatives and values of what changes with a length or a diameter of a cone; None for the others."""
        match = _SEGMENT.fullmatch(address)
        if match is None or match[1] != self.part or int(match[2]) != self.index:
            return None
        field, share = match[3], self.share
        first, second = (f"{self.part}.segment[{n}]" for n in (self.index, self.index + 1))
        ends = {"outer_diameter": "end_outer_diameter", "inner_diameter": "end_inner_diameter"}
        ends = {near: far for near, far in ends.items() if getattr(cone, far) is not None}
        if field == "length":
            # The cut keeps its place, so that it is at a smaller share of a longer cone.
            slopes = {f"{second}.length": (1.0, (1.0 - share) * cone.length)}
            for near, far in ends.items():
                start, end = getattr(cone, near), getattr(cone, far)
                between = (-share * (end - start) / cone.length, (1.0 - share) * start + share * end)
                slopes |= {f"{first}.{far}": between, f"{second}.{near}": between}
            return slopes
        for near, far in ends.items():
            start, end = getattr(cone, near), getattr(cone, far)
            middle = (1.0 - share) * start + share * end
            if field == near:
                between = (1.0 - share, middle)
                return {f"{first}.{near}": (1.0, start), f"{first}.{far}": between, f"{second}.{near}": between}
            if field == far:
                between = (share, middle)
                return {f"{first}.{far}": between, f"{second}.{near}": between, f"{second}.{far}": (1.0, end)}
        return None


def _division(part: str, index: int, places: Iterable[tuple[Part, float]]) -> _Division:
    """Return the division of a segment at a distance from its start in each of some parts of one name."""
    cones = {
        (segment.length, segment.ends, within): segment
        for owner, within in places
        if (segment := owner.segments[index]).is_conical
    }
    if not cones:
        return _Division(part, index)
    if len(cones) > 1:
        raise IndescribableError(f"{part}.segment[{index}] is a cone that differs between the assemblies")
    (((length, _, within), cone),) = cones.items()
    return _Division(part, index, cone, within / length)


def _renumber(unknown: Unknown, division: _Division, single: bool) -> Unknown:
    if isinstance(unknown, Move):
        return replace(unknown, moves=division.moves(unknown.moves, unknown.relative))
    pieces = division.pieces(unknown.address)
    if division.is_size(unknown.address):
        raise IndescribableError(f"the unknown {unknown.name!r} is of a cone that is to be divided")
    if len(pieces) == 1:
        return replace(unknown, address=pieces[0], name=unknown.name)
    if single:
        return replace(unknown, address=re.sub(r"\[\d+\]", "[*]", unknown.address), name=unknown.name)
    raise IndescribableError(f"the unknown {unknown.name!r} is of a segment that is to be divided")


def of_thickness(model: Model, section: str) -> dict[str, float]:
    """Return equal relative moves of the outer diameters at both ends of a segment, for a thicker or a thinner one."""
    ends = (f"{section}.outer_diameter", f"{section}.end_outer_diameter")
    return {
        address: 1.0
        for address in ends
        if address == ends[0] or any(covered(address, observation.assembly) for observation in model.observations)
    }
