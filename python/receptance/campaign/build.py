"""Construction of materials, parts, joints, unknowns and assemblies from the tables of a campaign."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NoReturn, TypeVar

from receptance import coupling, drawing, units
from receptance._text import did_you_mean, instead_of, one_of
from receptance.campaign.keys import ElementTable
from receptance.campaign.problems import CampaignError, KeyPath, Problems, path_text
from receptance.campaign.schema import (
    ATTACHMENTS,
    JOINTS,
    AssemblyTable,
    AutomaticModes,
    CampaignTable,
    CandidateTable,
    CoordinateTable,
    MeasurementTable,
    PartTable,
    SpindleTable,
    UnknownTable,
)
from receptance.campaign.shapes import note_on_directions, shape_of
from receptance.campaign.values import PLAIN_NUMBER, kind_of, prior_of
from receptance.coupling.unknown_modes import bounds_of_modes
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation
from receptance.fit.parameters import FACTORS
from receptance.fit.unknowns import Law, Move, Power, Tolerance, Unknown, covered
from receptance.model.assembly import Assembly
from receptance.model.beams import STEEL, Material, Part, Segment, SpreadJoint
from receptance.model.coordinates import Coordinate
from receptance.model.fields import Member, Number
from receptance.model.insertion import Insertion, fitting_bore, with_insertion
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import RESIDUALS, MeasuredPart, ModalPart, Mode

AnyJoint = PointJoint | SpreadJoint | ColletJoint | MicroslipJoint
_KINDS = (
    *(kind.__name__ for kind in (Material, Part, Segment, ModalPart, Mode, Assembly, Unknown)),
    *(keys.element.__name__ for keys in (*JOINTS.choices, *ATTACHMENTS.choices) if keys.element is not None),
    "Section",
    "SectionShape",
    *(f"SectionShape.{name}" for name in ("fluted", "polygon", "rectangle")),
    "read_contour",
    "insert",
    "Candidate",
    "Observation",
    "Milling",
    "Turning",
)
"""Classes and functions whose error messages begin with their name; the path in the file replaces it."""
_WITHOUT_MOVES = ("multiple", "also", "free", "individual", "follows", "exponent")
"""Keys of an unknown that cannot stand beside `moves`."""
_NEEDED = {
    "relative": ("moves",),
    "along": ("free",),
    "power_of": ("reference",),
    "reference": ("power_of",),
    "exponent": ("power_of",),
    "follows": ("power_of", "individual"),
}
"""Keys of an unknown that depend on another one."""
_OF_CONTOUR = frozenset({"material", "layer", "bore_layer", "unit", "axis", "tip", "within", "tolerance"})
"""Keys of a part that are only for a contour."""
_PROVISIONAL_HZ = 1000.0
"""Natural frequency of a mode before its start value is estimated from the measured FRFs."""
_NOT_A_BLANK = 'is "{}", a blank from which a spindle is identified; expected an assembly that is predicted'
_Made = TypeVar("_Made")


@dataclass(frozen=True)
class KnownSpindle:
    """A spindle from its file, and the errors of its numbers if it is given by modes."""

    part: MeasuredPart | ModalPart
    tolerances: tuple[Tolerance, ...]


@dataclass(frozen=True)
class InsertedShank:
    """An assembly of parts as drawn, with the values that it sets, and what the insertion makes of tool and holder."""

    drawn: Assembly
    insertion: Insertion


@dataclass
class Built:
    """The objects of a campaign by name; objects with mistakes are missing."""

    materials: dict[str, Material] = field(default_factory=dict)
    parts: dict[str, Part] = field(default_factory=dict)
    modal_parts: dict[str, ModalPart] = field(default_factory=dict)
    joints: dict[str, AnyJoint] = field(default_factory=dict)
    attachments: dict[str, PointMass | GroundSpring | Resonator] = field(default_factory=dict)
    sensors: dict[str, PointMass] = field(default_factory=dict)
    unknowns: dict[str, Unknown] = field(default_factory=dict)
    assemblies: dict[str, Assembly] = field(default_factory=dict)
    """Configurations; a blank of a spindle is the blank alone."""
    insertions: dict[str, InsertedShank] = field(default_factory=dict)
    """Assemblies whose tool and holder are those of their drawings, before and after the insertion."""
    spindles: dict[str, KnownSpindle] = field(default_factory=dict)
    unidentified: dict[str, str] = field(default_factory=dict)
    """Spindles that are not identified yet, with what they lack; assemblies that end with one are missing."""


class Mistake(Exception):  # noqa: N818
    """Ends the construction of an object after its mistakes were added, or those of an object that it needs."""


class Builder:
    """Builds objects from tables; mistakes are collected as `problems`, and warnings as `notes` and `warnings`.

    A function that builds an object adds a mistake and raises `Mistake`, which `store` catches.
    """

    def __init__(self, problems: Problems, folder: Path | None = None) -> None:
        self.problems, self.folder = problems, folder
        self.built = Built()
        self.numbers: dict[str, float | None] = {}
        """Numbers by address that the tables of joints and modal parts have, and starts of unknowns without one."""
        self.notes: list[str] = []
        self.warnings: list[str] = []

    # Mistakes and notes ----------------------------------------------------------------------------------------------

    def make(self, path: KeyPath, build: Callable[..., _Made], /, *arguments: Any, **options: Any) -> _Made:
        """Return the result of a function; its error is a mistake."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                made = build(*arguments, **options)
            except CampaignError as error:  # of a table in a file of its own
                self.fail(path, "; ".join(map(str, error.problems)))
            except (ValueError, TypeError, OSError, ReceptanceError) as error:
                self.fail(path, _without_owner(str(error)))
        for warning in caught:
            self.note(path, str(warning.message))
            self.warnings.append(self.notes[-1])
        return made

    def fail(self, path: KeyPath, text: str) -> NoReturn:
        """Add a mistake that ends the construction of an object."""
        self.problems.add(path, text)
        raise Mistake

    def require(self, *paths: KeyPath) -> None:
        """End the construction of an object if there is a mistake at or below one of the paths."""
        if any(map(self.problems.at, paths)):
            raise Mistake

    def together(self, steps: Iterable[Callable[[], Any]]) -> list[Any]:
        """Return the results of independent steps; all of them are tried before a mistake ends the construction."""
        made, wrong = [], False
        for step in steps:
            try:
                made.append(step())
            except Mistake:
                wrong = True
        if wrong:
            raise Mistake
        return made

    def store(
        self, objects: dict[str, _Made], name: str, build: Callable[..., _Made], /, *arguments: Any, **options: Any
    ) -> None:
        """Add an object with a name, unless it has mistakes."""
        with suppress(Mistake):
            objects[name] = build(*arguments, **options)

    def note(self, path: KeyPath, text: str) -> None:
        """Add a note; an earlier, more general note that contains its text is removed."""
        place = f"{path_text(path)}: "
        text = _without_owner(text)
        self.notes[:] = [note for note in self.notes if not (note.startswith(place) and text in note)]
        self.notes.append(f"{place}{text}")

    # Elements --------------------------------------------------------------------------------------------------------

    def build(self, campaign: CampaignTable) -> Built:
        """Build all objects of a campaign that have no mistakes."""
        built = self.built
        for name, table in campaign.materials.items():
            self.store(built.materials, name, self.element, table, ("materials", name), name=name)
        for name, part in campaign.parts.items():
            self.store(built.parts, name, self._part, name, part)
        self.numbers = {**_written_numbers(campaign)}
        for address, unknown in campaign.unknowns.items():
            self.store(built.unknowns, address, self._unknown, address, unknown, campaign)
            if address in built.unknowns:
                self.numbers.setdefault(address, built.unknowns[address].start)
        for name in campaign.modal_parts:
            self.store(built.modal_parts, name, self._modal_part, name, campaign)
        for name, spindle in campaign.spindles.items():
            self.store(built.spindles, name, self._spindle, name, spindle)
        for name, joint in campaign.joints.items():
            self.store(built.joints, name, self._joint, name, joint)
        for name, point in campaign.attachments.items():
            self.store(built.attachments, name, self.element, point, ("attachments", name), name, name=name)
        for name, sensor in campaign.sensors.items():
            self.store(built.sensors, name, self.element, sensor, ("sensors", name), name, name=name)
        for name, assembly in campaign.assemblies.items():
            self.store(built.assemblies, name, self._assembly, name, assembly, campaign)
        self._check_blanks(campaign)
        self._check_unknowns(campaign)
        return built

    def element(self, table: ElementTable, path: KeyPath, address: str = "", **given: Any) -> Any:
        """Return the element at an address from its table.

        A missing number has the start of its unknown; fields in `given` are not read from the table.
        """
        values = dict(given)
        for name, declared in table.element.declared.items():
            if name in values or not hasattr(table, name):
                continue
            value = getattr(table, name)
            if isinstance(declared, Member) and declared.kind is Material:
                # An unknown material was reported; with steel in its place dimensions are checked as well.
                value = None if value is None else self.built.materials.get(value, STEEL)
            elif isinstance(declared, Member):
                value = self.element(value, (*path, name), f"{address}.{name}")
            elif isinstance(declared, Number) and name not in table.written:
                value = self.numbers.get(f"{address}.{name}", value)
            values[name] = tuple(value) if isinstance(value, list) else value
        return self.make(path, table.element, **values)

    def _part(self, name: str, table: PartTable) -> Part:
        path: KeyPath = ("parts", name)
        if table.contour is not None:
            made = self._part_of_contour(name, table, table.contour)
            return coupling.as_rigid(made) if table.rigid else made
        for key in sorted(table.written & _OF_CONTOUR):
            self.fail((*path, key), "is given without `contour`, expected that as well, or none of the two")
        if not table.segments and not self.problems.at((*path, "contour")):
            text = "is missing: one or more tables `[[parts.NAME.segments]]`, or the file of a drawing as `contour`"
            self.fail((*path, "segments"), text)
        rows = enumerate(table.segments)
        segments = self.together(partial(self._segment, row, ("parts", name, "segments", i)) for i, row in rows)
        made = Part(segments, name=name)
        return coupling.as_rigid(made) if table.rigid else made

    def _segment(self, table: ElementTable, path: KeyPath) -> Segment:
        """Return a segment; one with a shape may have the size of the shape."""
        shape, outer = None, table.outer_diameter
        if table.shape is not None:
            shape = self.make((*path, "shape"), shape_of, table.shape, outer, self.folder)
            outer = shape.diameter if outer is None else outer
            if not table.shape.straight and (text := note_on_directions(shape, table.length)):
                self.note((*path, "shape"), text)
        elif outer is None:
            self.fail((*path, "outer_diameter"), f"is missing: outer diameter, such as {units.LENGTH.example}")
        made: Segment = self.element(table, path, outer_diameter=outer, shape=shape)
        return made

    def _part_of_contour(self, name: str, table: PartTable, file: str) -> Part:
        """Return the part of a drawing; what the drawing does not state is noted."""
        path: KeyPath = ("parts", name)
        self.require(path)
        if table.segments:
            self.fail((*path, "segments"), "are given with `contour`, expected one of the two")
        if table.material is None:
            self.fail((*path, "material"), "is missing: name of the material of the contour")
        if self.folder is None:
            self.fail((*path, "contour"), "is a file, which is not read here, expected segments")
        options: drawing.DrawingOptions = {"tolerance": table.within}
        if table.layer is not None:
            options["layer"] = table.layer
        if table.bore_layer is not None:
            options["bore_layer"] = table.bore_layer
        if table.unit is not None:
            options["unit"] = table.unit
        if table.axis is not None:
            options["axis"] = table.axis
        if table.tip is not None:
            options["tip"] = table.tip
        drawn = self.make((*path, "contour"), drawing.read_contour, self.folder / file, **options)
        for text in drawn.assumptions:
            self.note((*path, "contour"), text)
        material = self.built.materials.get(table.material, STEEL)
        return self.make((*path, "contour"), Part.from_contour, drawn.contour, material=material, name=name)

    def _joint(self, name: str, table: ElementTable) -> AnyJoint:
        wrong = [problem.path[1:2] for problem in self.problems.found if problem.path[:1] == ("unknowns",)]
        if any(not key or str(key[0]).startswith(f"{name}.") for key in wrong):
            raise Mistake  # a missing value of the joint is only a consequence of the mistake in the unknown
        made: AnyJoint = self.element(table, ("joints", name), name, name=name)
        return made

    def _modal_part(self, name: str, campaign: CampaignTable) -> ModalPart:
        table = campaign.modal_parts[name]
        path: KeyPath = ("modal_parts", name)
        if isinstance(table.modes, AutomaticModes):
            if not table.identify:
                self.fail((*path, "modes"), 'is "auto", which is for modes that are identified; add `identify = true`')
            for address in campaign.unknowns:
                if address.startswith(f"{name}.mode["):
                    text = f'belongs to a mode of {name}, whose modes are "auto", expected a number of modes there'
                    self.problems.add(("unknowns", address), text)

        def mode(index: int, row: ElementTable) -> Mode:
            own, here = f"{name}.mode[{index}]", (*path, "modes", index)
            given = {} if row.frequency_hz is not None else {"frequency_hz": _PROVISIONAL_HZ}
            if given and not table.identify and f"{own}.frequency_hz" not in self.built.unknowns:
                self.fail(here, "has no frequency_hz, expected one, or `identify = true` for the whole modal part")
            shapes = [key for key in Mode.columns_of if key.startswith(("y", "theta"))]
            unknown = table.identify or any(f"{own}.{key}" in campaign.unknowns for key in shapes)
            if not unknown and not any(getattr(row, key) for key in shapes):
                self.problems.add(here, "has no mode shape, expected y or theta, or one of them among the unknowns")
            made: Mode = self.element(row, here, own, **given)
            return made

        modes = self.together(partial(mode, index, row) for index, row in enumerate(table.modes))
        made: ModalPart = self.element(table, path, name, modes=modes, name=name)
        return made

    def _spindle(self, name: str, table: SpindleTable) -> KnownSpindle:
        """Return a spindle from its file; one whose file is not there yet, but has blanks, is unidentified."""
        path: KeyPath = ("spindles", name)
        self.require((*path, "file"))
        if table.file is None and not table.blanks:
            self.fail(path, "has neither a file nor blanks, expected one of them: a spindle is read or identified")
        file = None if table.file is None or self.folder is None else self.folder / table.file
        if file is None or (table.blanks and not file.exists()):
            lacks = "its file is not named" if table.file is None else f"{table.file} does not exist yet"
            self.built.unidentified[name] = f"{lacks}: `receptance spindle` identifies it from the blanks and writes it"
            raise Mistake
        part = self.make((*path, "file"), coupling.read_spindle, file, name=name)
        if isinstance(part, coupling.SpindleModes):
            return KnownSpindle(part.part, part.tolerances)
        # Messages name the file as the campaign does.
        return KnownSpindle(replace(part, source=str(table.file)), ())

    # Unknowns --------------------------------------------------------------------------------------------------------

    def _unknown(self, address: str, table: UnknownTable, campaign: CampaignTable) -> Unknown:
        """Return an unknown; without a start in its table it has that of `numbers`, else the middle of its bounds."""
        path: KeyPath = ("unknowns", address)
        self.require(path)
        if wrong := _misplaced(table):
            self.fail((*path, wrong[0]), wrong[1])
        plain = bool(table.moves) or table.multiple is not None
        lower, upper, start = table.lower, table.upper, table.start
        if start is None and not plain:
            start = self.numbers.get(address)
            if start is not None and not lower <= start <= upper:
                text = (
                    f"has bounds that exclude the value {start:g} of the joint, expected wider bounds or another start"
                )
                self.fail(path, text)
        fields: dict[str, Any] = {"address": address, "lower": lower, "upper": upper, "start": start}
        fields |= {"scale": table.scale, "name": table.name}
        fields["configurations"] = None if table.assemblies is None else tuple(table.assemblies)
        fields["labels"] = None if table.measurements is None else tuple(table.measurements)
        if (prior := table.prior) is not None:
            logarithmic = table.scale == "log" or (table.scale is None and lower > 0.0 and not table.moves)
            quantity = PLAIN_NUMBER if plain else kind_of(address)
            fields["prior"] = self.make((*path, "prior"), prior_of, quantity, prior.value, prior.spread, logarithmic)
        power = {} if table.power_of is None else {"of": table.power_of, "reference": table.reference}
        if table.moves:
            fields |= {"name": table.name or address, "moves": table.moves, "relative": table.relative}
            return self.make(path, Move, **fields, **power)
        fields |= {"multiple": 1.0 if table.multiple is None else table.multiple, "also": table.also}
        if not (power or table.free or table.individual is not None):
            return self.make(path, Unknown, **fields)
        if power:
            lowest, highest = table.exponent or (-4.0, 4.0)
            fields["powers"] = self.make(path, Power, **power, lower=lowest, upper=highest)
        if table.free:
            fields["along"] = table.along or (campaign.series.over if campaign.series is not None else "")
        fields |= {"free": table.free, "individual": table.individual or 0.0, "follows": table.follows}
        return self.make(path, Law, **fields)

    def _check_unknowns(self, campaign: CampaignTable) -> None:
        """Check that every unknown is a parameter of some assembly, and that no parameter has two unknowns."""
        built = self.built
        if built.assemblies.keys() != campaign.assemblies.keys() or not built.assemblies:
            return
        if self.problems.at(("assemblies",)) or built.unidentified:
            return  # an assembly with a mistake may have the parameter
        for title, unknown in built.unknowns.items():
            for name, spindle in built.spindles.items():
                if spindle.tolerances and any(address.startswith(f"{name}.") for address in unknown.addresses):
                    text = f"is a number of spindles.{name}, whose file states its error; expected no row in `unknowns`"
                    self.problems.add(("unknowns", title), text)
        measured = {
            *built.sensors,
            *(name for measurement in campaign.measurements.values() for name in measurement.attachments),
        }
        claimed: dict[tuple[str, str], str] = {}
        for title, unknown in built.unknowns.items():
            owned = addresses_of(unknown)
            for address in unknown.addresses:
                if address.split(".", 1)[0] in measured or address in FACTORS:
                    continue
                found = sorted(
                    (name, own) for name, assembly in built.assemblies.items() for own in covered(address, assembly)
                )
                if not found:
                    first = next(iter(built.assemblies.values()))
                    text = unknown_address(address, first, "is a parameter of no assembly")
                    self.problems.add(("unknowns", title), text)
                for key in found if address in owned else ():
                    if key in claimed:
                        text = f'moves {key[1]}, which the unknown "{claimed[key]}" moves too, expected one of the two'
                        self.problems.add(("unknowns", title), text)
                        break
                    claimed[key] = title

    def _check_blanks(self, campaign: CampaignTable) -> None:
        """Check that blanks are known and in their spindle, and that only their measurements refer to them."""
        for name, spindle in campaign.spindles.items():
            for index, blank in enumerate(spindle.blanks):
                if (table := campaign.assemblies.get(blank)) is None:
                    continue
                path: KeyPath = ("spindles", name, "blanks", index)
                if table.chain[-1] != name:
                    text = (
                        f'is "{blank}", whose chain ends with "{table.chain[-1]}", expected "{name}" as its last name'
                    )
                    self.problems.add(path, text)
                elif blank in self.built.assemblies:
                    self._check_known(path, blank)
        blanks = blanks_of(campaign)
        for title, candidate in campaign.candidates.items():
            if candidate.assembly in blanks:
                self.problems.add(("candidates", title, "assembly"), _NOT_A_BLANK.format(candidate.assembly))
        for title, cut in campaign.cuts.items():
            for side in ("x", "y"):
                assembly = getattr(getattr(cut, side, None), "assembly", None)
                if assembly in blanks:
                    self.problems.add(("cuts", title, side, "assembly"), _NOT_A_BLANK.format(assembly))

    def _check_known(self, path: KeyPath, blank: str) -> None:
        for title, unknown in self.built.unknowns.items():
            own = {a for address in addresses_of(unknown) for a in covered(address, self.built.assemblies[blank])}
            if own:
                text = f'is "{blank}", of which {title} is among the unknowns; expected a blank that is known'
                self.problems.add(path, text)

    # Assemblies ------------------------------------------------------------------------------------------------------

    def _assembly(self, name: str, table: AssemblyTable, campaign: CampaignTable) -> Assembly:
        path: KeyPath = ("assemblies", name)
        built, points, names = self.built, self.built.attachments, list(table.chain)
        elements: dict[str, Any] = {**built.parts, **built.joints, **built.modal_parts}
        elements |= {name: spindle.part for name, spindle in built.spindles.items()}
        for index, element in enumerate(names[:-1]):
            if element in campaign.spindles:
                text = f'is "{element}", a spindle, followed by {names[index + 1]}; expected it once, as the last name'
                self.fail((*path, "chain", index), text)
        if name in blanks_of(campaign) and names[-1] in campaign.spindles:
            del names[-1]  # the blank alone, whose receptance is subtracted
            if not names:
                self.fail((*path, "chain"), "has a spindle alone, expected the blank before it")
        if not elements.keys() >= set(names) or not points.keys() >= set(table.attachments):
            raise Mistake
        chain = [elements[element] for element in names]
        for joint, element in zip(names, chain, strict=True):
            if isinstance(element, PointJoint):
                self.require(("joints", joint))
                self.make(("joints", joint), element.check_motion, table.motion)
        assembly = self.make((*path, "chain"), Assembly, chain, motion=table.motion)
        if table.attachments:
            on = [points[attachment] for attachment in table.attachments]
            assembly = self.make((*path, "attachments"), Assembly, chain, on, motion=table.motion)
        for address in table.set:
            here = (*path, "set", address)
            own = covered(address, assembly)
            if not own:
                self.problems.add(here, unknown_address(address, assembly))
            elif any(
                own & covered(a, assembly) for unknown in self.built.unknowns.values() for a in addresses_of(unknown)
            ):
                self.problems.add(here, "is set here and is among the unknowns, expected one of the two")
        self.require((*path, "set"))
        if table.set:
            assembly = self.make((*path, "set"), assembly.replace, table.set)
        if table.insertion is None:
            self._note_on_empty_bore(path, assembly)
            return assembly
        made, insertion = self.make((*path, "insertion"), with_insertion, assembly, table.insertion)
        built.insertions[name] = InsertedShank(assembly, insertion)
        self._check_moved(path, built.insertions[name], made)
        return made

    def _note_on_empty_bore(self, path: KeyPath, assembly: Assembly) -> None:
        """Note a shank that fits the empty bore of its holder, in which it probably is."""
        fitting = fitting_bore(assembly)
        if fitting is None:
            return
        tool, holder, depth = fitting
        shank, bore = (1e3 * diameter for diameter in (tool.segments[-1].at(1.0)[0], holder.segments[0].inner_diameter))
        self.note(
            path,
            f"the shank of {tool.name}, {shank:.6g} mm, fits the bore of {holder.name}, {bore:.6g} mm, which is empty "
            f"over {1e3 * depth:.6g} mm; where the shank is in it, describe {tool.name} with its whole shank and state "
            f'insertion = "LENGTH", at most {1e3 * depth:.6g} mm, or state core in the segments of {holder.name}',
        )

    def _check_moved(self, path: KeyPath, shank: InsertedShank, made: Assembly) -> None:
        """Check that the addresses of unknowns are those of the same dimension in the parts as drawn."""
        for title, unknown in self.built.unknowns.items():
            if unknown.configurations is not None and path[-1] not in unknown.configurations:
                continue
            addresses = addresses_of(unknown)
            moved = {name for address in addresses for name in covered(address, made)}
            more: dict[str, float] = {}
            for parameter in sorted({name for address in addresses for name in covered(address, shank.drawn)}):
                targets = shank.insertion.moved(parameter)
                if parameter not in targets:
                    text = (
                        f"moves {parameter}, which the insertion of {path_text(path)} makes {one_of(targets)}: it "
                        f"ends in segment {shank.insertion.divided} of the holder; divide that segment in the file "
                        "where the shank ends"
                    )
                    self.problems.add(
                        ("unknowns", title), text if targets else f"moves {parameter}, which is in the bore"
                    )
                more |= {target: factor for target, factor in targets.items() if target not in moved}
            if more:
                also = ", ".join(f'"{target}" = {factor:g}' for target, factor in more.items())
                text = f"in {path_text(path)} it moves the tool in front of the bore alone, unless it has also = "
                self.note(("unknowns", title), f"{text}{{ {also} }}")

    def place(self, path: KeyPath, table: CoordinateTable, assembly: Assembly) -> Coordinate:
        """Return a coordinate on an assembly."""
        self.require(path)
        if assembly.motion == "axial" and table.direction.endswith("theta"):
            text = f'is "{table.direction}", but axial motion has no rotation; expected "+y"'
            self.fail((*path, "direction"), text)
        parts = assembly.parts
        name = table.part or next(iter(parts))
        if name not in parts:
            text = f'is "{name}", which is not a part of the assembly{instead_of(name, parts)}'
            self.fail((*path, "part"), text)
        length, position = parts[name].length, table.position
        if position != "end" and position > length * (1.0 + 1e-9):
            text = f'is {1e3 * position:g} mm, expected at most the length {1e3 * length:g} mm of part "{name}"'
            self.fail((*path, "position"), text)
        direction: Literal["y", "theta"] = "theta" if table.direction.endswith("theta") else "y"
        return Coordinate(name, position, direction)

    def measured(
        self,
        path: KeyPath,
        table: MeasurementTable | CandidateTable,
        campaign: CampaignTable,
        attachments: Sequence[str] = (),
        level: tuple[float, bool] | None = None,
    ) -> tuple[Assembly, Coordinate]:
        """Return the assembly of a measurement with attachments and sensor, and the response coordinate."""
        built = self.built
        if table.assembly not in built.assemblies:
            raise Mistake
        assembly = self.at_level(path, level, built.assemblies[table.assembly], campaign)
        missing = table.sensor is not None and table.sensor not in built.sensors
        if missing or not built.attachments.keys() >= set(attachments):
            raise Mistake
        points = [built.attachments[name] for name in attachments]
        steps: list[Callable[[], Any]] = [partial(self.place, (*path, "response"), table.response, assembly)]
        if points:
            steps.append(partial(self.make, (*path, "attachments"), with_attached, assembly, *points))
        response, *attached = self.together(steps)
        assembly = attached[0] if attached else assembly
        if table.sensor is not None:
            sensor = replace(built.sensors[table.sensor], part=response.part, position=response.position)
            assembly = with_attached(assembly, sensor)
        return assembly, response

    def at_level(
        self, path: KeyPath, level: tuple[float, bool] | None, assembly: Assembly, campaign: CampaignTable
    ) -> Assembly:
        """Return the assembly with micro-slip joints at the level of a measurement.

        `level` is an amplitude over the reference, or, if its second item is true, a force in N that is divided by the
        `reference_force` of each joint.
        """
        if level is None:
            return assembly
        here = (*path, "level")
        amount, is_force = level
        levels: dict[str, float] = {}
        for name in assembly.elements:
            if name not in campaign.joints or campaign.joints[name].kind != "micro-slip":
                continue
            reference = campaign.joints[name].reference_force
            if is_force and reference is None:
                text = f'is the force "{amount:g} N", but the joint "{name}" has no `reference_force`; expected one'
                self.fail(here, f"{text} in the joint")
            if f"{name}.level" in campaign.unknowns:
                self.fail(here, f"is given and {name}.level is among the unknowns, expected one of the two")
            levels[f"{name}.level"] = amount / reference if is_force and reference is not None else amount
        if not levels:
            self.fail(here, 'is given, but no joint of the assembly is of the kind "micro-slip"')
        return self.make(here, assembly.replace, levels)


def _misplaced(table: UnknownTable) -> tuple[str, str] | None:
    """Return key and text of a mistake if a key is given beside one that excludes it, or without one that it needs."""
    values = {key: getattr(table, key) for key in table.written}
    stated = {key for key, value in values.items() if value is not None and value is not False and value != {}}
    for key in _WITHOUT_MOVES if "moves" in stated else ():
        if key in stated:
            return key, "is given with `moves`, expected one of the two"
    for key, needed in _NEEDED.items():
        if key in stated and not stated & set(needed):
            return (
                key,
                f"is given without {' and '.join(f'`{name}`' for name in needed)}, expected {one_of(needed)} as well",
            )
    return None


def _written_numbers(campaign: CampaignTable) -> dict[str, float]:
    """Return the numbers that the tables of joints and modal parts have, by address."""
    tables = {**campaign.joints, **campaign.modal_parts}
    for name, part in campaign.modal_parts.items():
        tables |= {f"{name}.mode[{index}]": mode for index, mode in enumerate(part.modes)}
    for name, joint in campaign.joints.items():
        inside = [key for key in joint.element.declared if isinstance(getattr(joint, key, None), ElementTable)]
        tables |= {f"{name}.{key}": getattr(joint, key) for key in inside}
    return {
        f"{name}.{key}": getattr(table, key)
        for name, table in tables.items()
        for key in table.element.columns_of
        if key in table.written
    }


def blanks_of(campaign: CampaignTable) -> dict[str, str]:
    """Return the assemblies that are a blank in a spindle, and their spindles."""
    return {blank: name for name, spindle in campaign.spindles.items() for blank in spindle.blanks}


def addresses_of(unknown: Unknown) -> tuple[str, ...]:
    """Return the addresses of an unknown; a `Move` has none of its own."""
    return () if isinstance(unknown, Move) else unknown.addresses


def with_attached(assembly: Assembly, *points: PointMass | GroundSpring | Resonator) -> Assembly:
    """Return the assembly with further attachments."""
    return Assembly(assembly.elements.values(), [*assembly.attachments.values(), *points], motion=assembly.motion)


def unknown_address(address: str, assembly: Assembly, what: str = "is no parameter of this assembly") -> str:
    """Return the text of a mistake: an address that an assembly does not have."""
    first = address.split(".", 1)[0] + "."
    own = [name for name in assembly.parameters if name.startswith(first)]
    return f"{what}{did_you_mean(address, assembly.parameters)}; expected {one_of(own or assembly.parameters)}"


def _without_owner(text: str) -> str:
    """Return a message of the library without the object at its beginning, which the path names."""
    owner, colon, rest = text.partition(": ")
    return rest if colon and owner.split(" ", 1)[0] in _KINDS else text


# Unknowns of modal parts ----------------------------------------------------------------------------------------------


def modal_unknowns(
    table: CampaignTable, built: Built, measurements: Mapping[str, Observation], builder: Builder
) -> dict[str, Unknown]:
    """Return the unknowns of modal parts with `identify = true` that are not listed in `unknowns`."""
    found: dict[str, Unknown] = {}
    for name, part in table.modal_parts.items():
        if not part.identify:
            continue
        path: KeyPath = ("modal_parts", name)
        seen = [
            frf
            for title, frf in measurements.items()
            if table.measurements[title].role == "identify" and frf.is_receptance and name in frf.assembly.elements
        ]
        if not seen:
            builder.problems.add(
                (*path, "identify"),
                "is true, but there is no FRF for identification of an assembly that ends with this part, expected one",
            )
            continue
        rigid = [index for index, mode in enumerate(part.modes) if mode.frequency_hz == 0.0]
        if rigid:
            builder.problems.add(
                (*path, "modes", rigid[0]),
                "is a rigid-body mode, but the part has `identify = true`, which is for elastic modes; expected "
                "bounds of its numbers in `unknowns` instead",
            )
            continue
        modes = [{key: getattr(row, key) for key in row.written} for row in part.modes]
        residuals = {key: float(getattr(part, key)) for key in RESIDUALS}
        automatic = {one.address: one for one in bounds_of_modes(name, modes, residuals, seen)}
        given = {own for unknown in built.unknowns.values() for own in addresses_of(unknown)}
        found |= {address: unknown for address, unknown in automatic.items() if address not in given}
        for title, assembly in table.assemblies.items():
            for address in assembly.set:
                if title in built.assemblies and covered(address, built.assemblies[title]) & automatic.keys():
                    here: KeyPath = ("assemblies", title, "set", address)
                    builder.problems.add(
                        here, f"is set here, but `modal_parts.{name}.identify` is true, expected one of the two"
                    )
    return found
