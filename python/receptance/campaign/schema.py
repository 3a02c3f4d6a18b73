"""Pydantic models of the tables of a campaign file.

Models of elements (materials, segments, joints, masses, cuts) are made from the declarations of the elements; the
others are declared here.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import operator
import sys
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    StringConstraints,
    Tag,
    WithJsonSchema,
    create_model,
)

from receptance import units
from receptance._reading import campaign_keys, reading_options
from receptance._text import shown
from receptance.campaign.values import (
    Address,
    DataFile,
    Deviation,
    DeviationAtAddress,
    DeviationShare,
    ForceWindow,
    NameInMachine,
    Position,
    Share,
    Value,
    amount,
    by_address,
    name_of,
    of_types,
    parse_condition,
    parse_level,
    spread,
)
from receptance.model.beams import Material, Segment, SpreadJoint
from receptance.model.fields import Choice, Count, Element, Member, Number
from receptance.model.fields import Field as Declaration
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import ModalPart, Mode
from receptance.stability.cutting import Milling, Turning

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler


class SchemaTable(BaseModel):
    """A table of the file; unknown keys are mistakes, and text is not converted to numbers."""

    # Only the model of the whole file validates: building the others as well takes a tenth of a second.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    @classmethod
    def default(cls) -> Self:
        """Return the table without keys; the constructor would first build a validator of this model alone."""
        return cls.model_construct()

    @classmethod
    def model_json_schema(cls, *given: Any, **options: Any) -> dict[str, Any]:
        """Return the JSON schema. All tables are built first, which pydantic before version 2.12 does not do."""
        cls.model_rebuild()
        _build(SchemaTable)
        return super().model_json_schema(*given, **options)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Describe the keys by the strings below the fields, which only the JSON schema needs."""
        found: dict[str, Any] = handler(core_schema)
        properties = handler.resolve_ref_schema(found)["properties"]
        texts = _descriptions(cls)
        for name in properties.keys() & texts.keys():
            properties[name].setdefault("description", texts[name])
        return found


def _build(kind: type[SchemaTable]) -> None:
    """Build all tables of a kind."""
    for one in kind.__subclasses__():
        one.model_rebuild()
        _build(one)


def _descriptions(model: type[SchemaTable]) -> dict[str, str]:
    """Return the strings below the fields of a model and of its bases by the name of the field.

    pydantic would read them when the models are made, which takes half of the time in which this module is loaded.
    """
    written = _written()
    return {name: text for base in reversed(model.__mro__) for name, text in written.get(base.__name__, {}).items()}


@functools.cache
def _written() -> dict[str, dict[str, str]]:
    """Return the strings below the fields of the classes of this module by class and field."""
    source = inspect.getsource(sys.modules[__name__])
    classes = {one.name: one.body for one in ast.parse(source).body if isinstance(one, ast.ClassDef)}
    return {
        name: {
            field.target.id: inspect.cleandoc(text.value.value)
            for field, text in itertools.pairwise(body)
            if isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        }
        for name, body in classes.items()
    }


class ElementTable(SchemaTable):
    """A table whose keys follow from the declarations of an element."""

    origin: ClassVar[tuple[Callable[[Any], type[ElementTable]], Any]]
    """Function that makes the model, and its argument."""
    element: ClassVar[type[Element]]
    """Class of the element."""

    def __reduce__(self) -> tuple[Any, ...]:
        # The model is made at run time, so that pickle cannot import it by name.
        return _restored, (*type(self).origin, self.__getstate__())

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


def _restored(function: Callable[[Any], type[ElementTable]], argument: Any, state: dict[Any, Any]) -> ElementTable:
    model = function(argument)
    table = model.__new__(model)
    table.__setstate__(state)
    return table


@dataclass(frozen=True)
class Of:
    """Marks a field as the table of an element.

    Parameters
    ----------
    element : type
        Class of the element.
    tag : str, optional
        Value of the key `kind`.
    keys : type, optional
        A model with additional or changed keys.
    without : tuple of str, optional
        Fields of the element that are not keys.
    defaults : tuple, optional
        Names of fields and defaults of their keys, where they differ from those of the element.
    name : str, optional
        Name of the model in the JSON schema.
    """

    element: type[Element]
    tag: str = ""
    keys: type[ElementTable] = ElementTable
    without: tuple[str, ...] = ()
    defaults: tuple[tuple[str, Any], ...] = ()
    name: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace the annotated type by the model."""
        del source
        return handler.generate_schema(table_of(self))


@dataclass(frozen=True)
class OneKind:
    """Marks a field as the table of one of several elements, selected by the key `kind`."""

    choices: tuple[Of, ...]

    def __init__(self, *choices: Of) -> None:
        object.__setattr__(self, "choices", choices)

    def kind_of(self, element: Element) -> str | None:
        """Return the value of `kind` of an element; None if it is of none of these classes."""
        return next((choice.tag for choice in self.choices if choice.element is type(element)), None)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace the annotated type by a union of the models."""
        del source
        union = functools.reduce(
            operator.or_, (Annotated[table_of(choice), Tag(choice.tag)] for choice in self.choices)
        )
        return handler.generate_schema(Annotated[union, Discriminator("kind")])


@functools.cache
def table_of(of: Of) -> type[ElementTable]:
    """Return the model of an element: its fields, and their standard deviations as `tolerance`."""
    declared = {
        name: field
        for name, field in of.element.declared.items()
        if name not in ("name", *of.without, *of.keys.model_fields)
    }
    entries: dict[str, Any] = {}
    if of.tag:
        default: Any = of.tag if of.tag == "point" else ...
        entries["kind"] = (Literal[of.tag], Field(default, description=f'`"{of.tag}"`'))
    for name, field in declared.items():
        kind, default = _key(of.element, name, field, dict(of.defaults))
        named = isinstance(field, Member) and field.kind is Material
        entries[name] = (kind, Field(default, description=f"name of the {field.doc}" if named else field.doc))
    if of.element.toleranced:
        tolerance = tolerance_of(Of(of.element))
        text = "standard deviations of the numbers above, by the same keys"
        entries["tolerance"] = (tolerance, Field(tolerance.default(), description=text))
    doc = of.keys.__doc__ if of.keys is not ElementTable and of.keys.__doc__ else of.element.__doc__ or ""
    name = of.name or f"{of.element.__name__}Table"
    model = create_model(name, __base__=of.keys, __doc__=doc.strip().splitlines()[0], **entries)
    model.origin, model.element = (table_of, of), of.element
    return model


def _key(element: type[Element], name: str, field: Declaration, defaults: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return type and default of a key."""
    (own,) = (one for one in fields(element) if one.name == name)  # type: ignore[arg-type]
    default: Any = defaults.get(name, ... if own.default is MISSING else own.default)
    kind: Any
    if isinstance(field, Number):
        kind = Annotated[float, amount(field.quantity)]
        return (kind | None if default is None else kind), default
    if isinstance(field, Member) and field.kind is Material:
        kind = Annotated[str, name_of("materials")]
        return (kind | None if default is None else kind), default
    if isinstance(field, Member):
        table = table_of(Of(field.kind, name=f"{field.kind.__name__}MemberTable"))
        optional = not any(key.is_required() for key in table.model_fields.values())
        return table, table.default() if optional else ...
    if isinstance(field, Count):
        kind = Annotated[int, Field(ge=field.least, le=field.most)]
        return (kind | None if default is None else kind), default
    if isinstance(field, Choice):
        return Literal[field.words], default
    if name == "position":
        return Position, default
    if name == "part":
        return Annotated[str, name_of("parts", optional=True)], default
    hint = get_args(get_type_hints(element, include_extras=True)[name])[0]
    if hint == tuple[float, ...]:
        return Annotated[list[Annotated[float, Field(ge=0.0)]], Field()], list(default)
    return hint, default


@functools.cache
def tolerance_of(of: Of) -> type[ElementTable]:
    """Return the model of the standard deviations of an element's own numbers."""
    element = of.element
    entries: dict[str, Any] = {}
    for name, field in element.declared.items():
        if isinstance(field, Number) and field.parameter:
            kind = Annotated[Deviation | None, spread(field.quantity)]
            entries[name] = (kind, Field(None, description=f"of the {field.doc.partition(';')[0]}"))
    doc = f"Standard deviations of the numbers of a table of {element.__name__}."
    model = create_model(f"{element.__name__}Tolerance", __base__=ElementTable, __doc__=doc, **entries)
    model.origin, model.element = (tolerance_of, of), element
    return model


Word = Annotated[str, StringConstraints(pattern=r"^[^\W\d]\w*$")]
"""A name that begins addresses."""
Name = Annotated[str, StringConstraints(min_length=1)]
Written = Annotated[str | float, of_types(str, int, float, what="text with a number and a unit, or a plain number")]
"""A quantity as text or number of the file."""
ConditionValue = Annotated[
    float,
    PlainValidator(parse_condition),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]}),
]
"""A number with any unit."""
Conditions = dict[str, ConditionValue]
AssemblyName = Annotated[str, name_of("assemblies")]
SensorName = Annotated[str, name_of("sensors")]
AttachmentNames = list[Annotated[str, name_of("attachments")]]

# Parts and joints ----------------------------------------------------------------------------------------------------


class PartTable(SchemaTable):
    """A tool, a holder, a blank: segments in a row, rigidly connected, from its tip-side end on."""

    segments: Annotated[list[Annotated[ElementTable, Of(Segment)]], Field(min_length=1)]
    """one or more, `[[parts.NAME.segments]]`, in order from the tip-side end"""
    rigid: bool = False
    """whether the part is rigid: only its mass counts"""


_MOST_MODES = 40
"""Largest number of modes of a part; each has four unknowns."""
_MODE = Of(Mode, defaults=(("frequency_hz", None), ("damping_ratio", 0.03), ("y", 0.0), ("theta", 0.0)))
"""A mode; its numbers may be unknowns."""


def _modes_of(given: Any) -> Any:
    """Return a number of modes as so many tables without keys."""
    if isinstance(given, bool) or not isinstance(given, int):
        return given
    if not 1 <= given <= _MOST_MODES:
        raise ValueError(f"is {given}, expected a number of modes from 1 to {_MOST_MODES}")
    return [{}] * given


class _ModalPartKeys(ElementTable):
    """A part known by its modes, a spindle: the last name of a chain. Its numbers may be unknowns."""

    modes: Annotated[
        list[Annotated[ElementTable, _MODE]],
        Field(min_length=1),
        BeforeValidator(_modes_of, json_schema_input_type=int | list[Annotated[ElementTable, _MODE]]),
    ]
    """one or more, `[[modal_parts.NAME.modes]]`, or their number if they are identified"""
    identify: bool = False
    """whether all numbers with real shapes are unknowns, with bounds and starts from FRFs where `unknowns` has none;
    frequencies are then optional"""


class _MicroslipKeys(ElementTable):
    reference_force: Annotated[float, amount(units.FORCE)] | None = None
    """force that is the level 1, where measurements give their `level` as a force"""


ModalPartTable = Annotated[ElementTable, Of(ModalPart, keys=_ModalPartKeys)]
JOINTS = OneKind(
    Of(PointJoint, "point"),
    Of(SpreadJoint, "spread"),
    Of(ColletJoint, "collet"),
    Of(MicroslipJoint, "micro-slip", keys=_MicroslipKeys),
)
ATTACHMENTS = OneKind(Of(PointMass, "mass"), Of(GroundSpring, "ground"), Of(Resonator, "resonator"))
JointTable = Annotated[ElementTable, JOINTS]
SensorTable = Annotated[ElementTable, Of(PointMass, without=("part", "position"), name="SensorTable")]
AttachmentTable = Annotated[ElementTable, ATTACHMENTS]


class CoordinateTable(SchemaTable):
    """A position on a part, a direction and a sign."""

    part: Annotated[str, name_of("parts", optional=True)] = ""
    """name of the part; by default the first one of the chain"""
    position: Position = 0.0
    """distance from the part's tip-side end, or `"end"` for its far end; by default 0"""
    direction: Literal["+y", "-y", "+theta", "-theta"] = "+y"
    """translation y or rotation theta, and the sign in which the channel counts it"""


class AssemblyTable(SchemaTable):
    """A configuration: parts and joints in a row from the tip, and values of its own."""

    chain: Annotated[list[Annotated[str, name_of("parts", "joints", "modal_parts")]], Field(min_length=1)]
    """names of parts and joints from the tip on; begins with a part and ends with a part or a modal part"""
    attachments: AttachmentNames = Field(default=[])
    """names of the masses and ground springs on it"""
    set: Annotated[dict[str, Value], by_address()] = Field(default={})
    """values of this configuration by address, `{ "tool.segment[0].length" = "60 mm" }`"""
    tolerance: Annotated[dict[str, DeviationAtAddress], by_address()] = Field(default={})
    """standard deviations of this configuration by address; one error for this configuration alone"""
    conditions: Conditions = Field(default={})
    """numbers with units that describe the configuration: torque, insertion, drawbar force"""
    motion: Literal["bending", "axial"] = "bending"
    """bending or axial; in axial motion y, k_y and c_y are along the axis, and there is no rotation"""


# Measurements -------------------------------------------------------------------------------------------------------

FrequencyOrZero = Annotated[float, amount(units.FREQUENCY_OR_ZERO)]
Band = Annotated[list[FrequencyOrZero], Field(min_length=2, max_length=2)]
_Which = Annotated[str | int | None, of_types(str, int, what="a number from 0 or a name in the file")]


class EntryTable(SchemaTable):
    """The FRF to read from a file with several FRFs, responses or excitations."""

    number: Annotated[int, Field(ge=0)] | None = None
    """number of the FRF, counted from 0, if the file holds several"""
    response: _Which = None
    """number of the response, counted from 0, or its name in the file"""
    excitation: _Which = None
    """number of the excitation, counted from 0, or its name in the file"""


_KEY_TYPES = {
    "coherence": DataFile | None,
    "unit": str | None,
    "units": dict[str, str] | None,
    "sample_rate": Annotated[float, amount(units.FREQUENCY)] | None,
}
"""Types of keys that differ from those of the keywords of `receptance.io.read`."""


def _reading_table(name: str, *, records: bool) -> type[SchemaTable]:
    """Return the table whose keys are the options of reading an FRF, or time records."""
    declared = reading_options()
    entries: dict[str, Any] = {}
    for keyword, key in campaign_keys(records=records).items():
        kind, option = declared[keyword]
        default = False if kind is bool else None
        entries[key] = (_KEY_TYPES.get(key, kind), Field(default, description=option.text))
    return create_model(name, __base__=SchemaTable, __module__=__name__, **entries)


_FRFReading = _reading_table("FRFReading", records=False)
_RecordsReading = _reading_table("RecordsReading", records=True)


class FileFields(_FRFReading):  # type: ignore[misc, valid-type]
    """A file with an FRF, and properties that are not in the file; the base of tables that name one."""

    file: DataFile
    """path, relative to the campaign file: UFF58, CSV, NPZ, MAT, HDF5, `.frf`, DataPhysics ASCII"""
    entry: EntryTable = EntryTable.default()
    """the FRF to read, if the file holds several FRFs, responses or excitations"""
    averages: Annotated[int, Field(ge=1)] | None = None
    """number of averages, if the file does not state it"""
    standard_deviation: DeviationShare | None = None
    """standard deviation of the FRF on every line, such as `"2 %"`; by default from the file's variance, or from
    coherence and averages"""
    decay_rate: Annotated[float, amount(units.DECAY_RATE)] | None = None
    """decay rate of an exponential window on both channels, if the file does not state it"""


Frequency = Annotated[float, amount(units.FREQUENCY)]
Force = Annotated[float, amount(units.FORCE)]
Level = Annotated[
    tuple[float, bool],
    PlainValidator(parse_level),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]}),
]
"""A level of joints in micro-slip, and whether it is a force in N."""
Time = Annotated[float, amount(units.TIME)]
TimeOrZero = Annotated[float, amount(units.TIME_OR_ZERO)]
ShareAboveZero = Annotated[float, amount(units.SHARE_ABOVE_ZERO)]
Channel = Annotated[str | int, of_types(str, int, what="the name of a channel in the file, or its number from 0")]
Rate = Annotated[float, amount(units.DECAY_RATE)]


class _Measured(SchemaTable):
    assembly: AssemblyName
    """name of the assembly that was measured"""
    role: Literal["identify", "hold out"] = "identify"
    """whether it is used in the fit, or held out for comparison with predictions"""
    sensor: SensorName | None = None
    """name of the sensor at the response coordinate; none for a laser"""
    conditions: Conditions = Field(default={})
    """numbers with units that describe the measurement: a force level, a temperature"""
    attachments: AttachmentNames = Field(default=[])
    """names of masses and ground springs that were attached during this measurement only: a second sensor, a
    suspension"""
    level: Level | None = None
    """level of joints in micro-slip: amplitude over reference, or a force, which their `reference_force` divides"""


class _Response(_Measured):
    response: CoordinateTable = CoordinateTable.default()
    """coordinate of the measured motion"""
    excitation: CoordinateTable = CoordinateTable.default()
    """coordinate of the load"""
    bands: Annotated[list[Band], Field(min_length=1)] | None = None
    """frequency bands to use, `[["300 Hz", "4 kHz"]]`; by default all usable lines"""
    floor: DeviationShare | None = None
    """standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`"""
    integrate: Annotated[int, Field(ge=-2, le=2)] = 0
    """number of additional integrations of the motion, for a file that states a wrong quantity: 1 if it holds
    velocities and states displacements, -1 for the reverse"""
    ends: Time | None = None
    """time from the hit to the end of a record that was truncated while the structure still vibrated; the unknown
    `"observation.end"` estimates it"""


class FRFTable(FileFields, _Response):
    """A frequency response function from a file."""

    kind: Literal["frf"]
    """`"frf"`"""
    force: Force | None = None
    """amplitude of a stepped sine; it determines the level of joints in micro-slip on each line"""


class HammerTable(_RecordsReading, _Response):  # type: ignore[misc, valid-type]
    """Force and response of hammer hits against time, from which the FRF is estimated."""

    kind: Literal["hammer records"]
    """`"hammer records"`"""
    file: Annotated[DataFile | list[DataFile], of_types(str, list, what="the name of a file, or a list of them")]
    """path, relative to the campaign file, with one or several hits, or a list of paths: UFF58, CSV, NPZ, MAT, HDF5"""
    force: Channel
    """name of the force channel, or its number counted from 0"""
    motion: Channel
    """name of the response channel, or its number counted from 0"""
    full_scale_force: Force | None = None
    """full scale of the force channel; without it an overload is detected only by a flat top"""
    trigger: Force | None = None
    """force at which a hit begins; by default a tenth of the largest"""
    duration: Time | None = None
    """length of the block of a hit; by default the time between hits"""
    pre_trigger: TimeOrZero | None = None
    """time from the beginning of a block to the trigger, by default 10 ms, if a record holds several hits"""
    double_hit_loss_db: Annotated[float, Field(ge=0.0)] | None = None
    """largest loss of the force's spectrum, in dB, of a double hit that is used: 0 drops all of them; by default 3"""
    deviating_hits: Literal["drop", "keep"] = "drop"
    """treatment of hits whose FRF has another sign or gain than that of the majority, or none"""
    separation: Time | None = None
    """contacts closer than this are one double hit, if a record holds several hits; by default 100 ms"""
    drop_hits: list[Annotated[int, Field(ge=1)]] = Field(default=[])
    """numbers of hits to drop, counted from 1 in the order in which they are found"""
    estimator: Literal["H1", "H2", "Hv"] = "H1"
    """estimator of the FRF"""
    force_drop_db: Annotated[float, Field(gt=0.0)] = 20.0
    """the usable band ends where the force's spectrum is this many dB below its largest value; with a larger number
    lines with less force are used as well, with their larger variance"""
    decay_rate: Rate = 0.0
    """decay rate of the exponential window to apply to both channels"""
    response_decay_rate: Rate = 0.0
    """decay rate of an exponential window that the recorder applied to the response alone"""
    force_window: ForceWindow = "auto"
    """length of the force window after the contact begins, such as `"2 ms"`; `"auto"`, or `"none"` for the whole
    block"""


class FrequenciesTable(_Measured):
    """Natural frequencies, and damping ratios where these are known, here or in a CSV file."""

    kind: Literal["natural frequencies"]
    """`"natural frequencies"`"""
    frequencies: Annotated[list[Frequency], Field(min_length=1)] | None = None
    """natural frequencies, ascending"""
    modes: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] | None = None
    """numbers of the elastic modes, the lowest is 1; by default 1, 2, and so on"""
    standard_deviation: Annotated[
        str | list[str] | None, of_types(str, list, what='a standard deviation such as "5 Hz", or a list of them')
    ] = None
    """standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each"""
    damping_ratios: Annotated[list[str], Field(min_length=1)] | None = None
    """damping ratios such as `"1.2 %"`, one for each frequency, or `"unknown"`; frequencies are then those of damped
    modes (their magnitudes), else of undamped ones"""
    damping_deviation: Annotated[
        str | float | list[str | float] | None,
        of_types(str, float, list, what='a standard deviation such as "5 %" of the ratio, a number, or a list of them'),
    ] = None
    """standard deviation of the damping ratios, `"5 %"` of them or a number such as 0.0005, one for all or one for
    each"""
    file: DataFile | None = None
    """CSV file instead, with columns `mode`, `frequency [Hz]` and, optionally, `standard_deviation [Hz]`,
    `damping_ratio [%]`, `damping_deviation [%]` (of the ratio); an empty cell is an unknown ratio"""
    response: CoordinateTable = CoordinateTable.default()
    """coordinate of the sensor"""


MeasurementTable = Annotated[
    Annotated[FRFTable, Tag("frf")]
    | Annotated[HammerTable, Tag("hammer records")]
    | Annotated[FrequenciesTable, Tag("natural frequencies")],
    Discriminator("kind"),
]


class _Possible(SchemaTable):
    assembly: AssemblyName
    """name of the assembly to measure; one that was measured before is in the same clamping"""
    sensor: SensorName | None = None
    """name of the sensor at the response coordinate; none for a laser"""
    response: CoordinateTable = CoordinateTable.default()
    """coordinate of the measured motion"""
    conditions: Conditions = Field(default={})
    """numbers with units that describe the measurement"""
    cost: Annotated[float, Field(gt=0.0)] = 1.0
    """cost, in any unit that all candidates share"""


class CandidateFRFTable(_Possible):
    """A frequency response function that could be measured."""

    kind: Literal["frf"]
    """`"frf"`"""
    excitation: CoordinateTable = CoordinateTable.default()
    """coordinate of the load"""
    lower: Frequency | None = None
    """lowest line; by default `step`"""
    upper: Frequency
    """highest line"""
    step: Frequency
    """distance of the lines, whose noise is independent"""
    standard_deviation: DeviationShare
    """expected standard deviation of the FRF on every line, such as `"2 %"`"""
    floor: DeviationShare | None = None
    """standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`"""


class CandidateFrequenciesTable(_Possible):
    """Natural frequencies that could be measured."""

    kind: Literal["natural frequencies"]
    """`"natural frequencies"`"""
    modes: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)]
    """numbers of the elastic modes, the lowest is 1"""
    standard_deviation: Annotated[
        str | list[str], of_types(str, list, what='a standard deviation such as "5 Hz", or a list of them')
    ]
    """expected standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each"""


CandidateTable = Annotated[
    Annotated[CandidateFRFTable, Tag("frf")] | Annotated[CandidateFrequenciesTable, Tag("natural frequencies")],
    Discriminator("kind"),
]


# Unknowns and settings ----------------------------------------------------------------------------------------------


class PriorTable(SchemaTable):
    """Prior knowledge of an unknown: a Gaussian on the scale of the fit."""

    value: Written
    """most likely value, a quantity of the parameter's kind"""
    spread: Written
    """its standard deviation, `"30 %"` or a quantity of the parameter's kind, or `"factor 3"` where the logarithm is
    fitted"""


class UnknownTable(SchemaTable):
    """A parameter to identify; all assemblies that have it share it, unless a law across assemblies is given."""

    lower: Value
    """lower bound, a quantity of the parameter's kind"""
    upper: Value
    """upper bound"""
    start: Value | None = None
    """start value; by default the joint's value, else the middle of the bounds"""
    scale: Literal["log", "linear"] | None = None
    """whether the logarithm or the value is fitted; by default the logarithm where the lower bound is above zero"""
    prior: PriorTable | None = None
    """prior; the measurements then need standard deviations"""
    name: str = ""
    """name in results; by default its address"""
    assemblies: list[AssemblyName] | None = None
    """assemblies that have the unknown; by default all"""
    multiple: float | None = None
    """the parameter is this multiple of the unknown, whose bounds and start are then plain numbers in SI units"""
    also: dict[Address, float] = Field(default={})
    """further parameters by address, as multiples of the unknown"""
    moves: dict[Address, float] = Field(default={})
    """parameters by address that the unknown changes: v becomes v + n u, with the unknown u and the number n; the
    unknown then has a name instead of an address, and plain numbers in SI units"""
    relative: bool = False
    """with `moves`: v becomes v exp(n u)"""
    power_of: str | None = None
    """name of a condition, or an address; the parameter is a power of it across assemblies, or, with `moves`, n is
    multiplied by the logarithm of that condition over its reference"""
    reference: ConditionValue | None = None
    """value of that condition at which the parameter equals the unknown, such as `"135 N m"`, or, with `moves`, at
    which there is no change"""
    exponent: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    """bounds of the exponent, by default `[-4, 4]`"""
    free: bool = False
    """a value for each assembly instead of one for all"""
    along: str | None = None
    """with `free`: name of the condition over which values are interpolated for assemblies that were not measured; by
    default that of the series"""
    individual: Share | None = None
    """standard deviation of the individual deviation of each assembly, such as `"5 %"`"""
    follows: dict[str, float] = Field(default={})
    """further parameters by address that are multiplied by its powers and individual deviations, raised to the number
    given"""


class SettingsTable(SchemaTable):
    """Settings of the fit."""

    objective: Literal["log", "percentage"] = "log"
    """complex logarithm of measured over calculated, or percentage of the magnitude in bands around the peaks"""
    starts: Annotated[int, Field(ge=1, le=1_000_000)] = 8
    """number of starts"""
    seed: Annotated[int, Field(ge=0)] = 0
    """seed of the starts that are drawn"""
    max_evaluations: Annotated[int, Field(ge=1, le=1_000_000)] = 200
    """largest number of evaluations from one start"""
    strategy: Literal["direct", "staged"] = "direct"
    """whether the fit begins at the starts, or is preceded by easier fits, for starts that are decades off"""
    profiles: bool = True
    """whether intervals are also computed from profile likelihoods"""
    band_width: Share = 0.05
    """half width of the bands of the percentage objective, by default `"5 %"`"""


class PredictionTable(SchemaTable):
    """Predictions of assemblies that were not measured, and the level of intervals."""

    lower: Frequency | None = None
    """lowest line; by default a tenth of the first natural frequency"""
    upper: Frequency | None = None
    """highest line and limit of the natural frequencies; by default the highest measured frequency"""
    step: Frequency | None = None
    """distance of the lines; by default a two-thousandth of the band"""
    response: CoordinateTable = CoordinateTable.default()
    """coordinate of the motion"""
    excitation: CoordinateTable = CoordinateTable.default()
    """coordinate of the load"""
    level: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """level of the intervals"""
    force: Force | None = None
    """amplitude of a stepped sine, for FRFs with joints in micro-slip; by default the joints have their own level"""


class SeriesTable(SchemaTable):
    """Levels of repeated measurements; a table with `{level}` in its name is the template of a table for each level."""

    over: Name
    """name of the condition, such as `"drawbar force"`"""
    levels: Annotated[list[Written], Field(min_length=1)]
    """the levels, `["0 kN", "1 kN"]`; `{level}` is replaced by the level as it is written, `{value}` by
    its number"""
    hold_out: list[Written] = Field(default=[])
    """levels whose measurements are held out, written as in `levels`"""


# Cuts and catalogues ------------------------------------------------------------------------------------------------

LengthSpread = Annotated[Deviation | None, spread(units.LENGTH)]
_Speed = Annotated[float, amount(units.SPINDLE_SPEED)]


class TipTable(FileFields):
    """The receptance of the tool tip in one direction: one of an assembly, a measurement or a file."""

    file: DataFile | None = None  # type: ignore[assignment]
    """path of a file with the FRF of the tip"""
    assembly: AssemblyName | None = None
    """name of an assembly whose tip is predicted"""
    measurement: Annotated[str, name_of("measurements")] | None = None
    """name of a measured FRF of the campaign"""
    bands: Annotated[list[Band], Field(min_length=1)] | None = None
    """frequency bands of a file or a measurement in which limits are computed, `[["300 Hz", "4 kHz"]]`; by default all
    usable lines"""


def _across(value: Any) -> Any:
    """Check the value first, for one message instead of one of pydantic for each member of the union."""
    if isinstance(value, (dict, TipTable)) or value in ("as x", "rigid"):
        return value
    raise ValueError(f'is {shown(value)}, expected a table, "as x" or "rigid"')


class _TurningKeys(ElementTable):
    angle: Annotated[float, amount(units.DIRECTION)] = 0.0
    """angle between the force and the direction of the chip thickness"""
    x: TipTable
    """receptance of the tip in the direction of the chip thickness"""


class _MillingKeys(ElementTable):
    x: TipTable
    """receptance of the tip in the direction of feed"""
    y: Annotated[TipTable | Literal["as x", "rigid"], BeforeValidator(_across)] = "as x"
    """receptance across it; `"as x"` the same, `"rigid"` none"""


CutTable = Annotated[
    ElementTable,
    OneKind(
        Of(Milling, "milling", keys=_MillingKeys), Of(Turning, "turning", keys=_TurningKeys, without=("angle_deg",))
    ),
]


class StabilityTable(SchemaTable):
    """Speeds and probability of stable depths."""

    speeds: Annotated[list[_Speed], Field(min_length=2, max_length=2)] | None = None
    """lowest and highest spindle speed, `["4000 rpm", "24000 rpm"]`"""
    step: _Speed | None = None
    """distance of the speeds; by default a four-hundredth of their range, a thirtieth with semi-discretisation"""
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """probability with which recommended depths are stable"""
    draws: Annotated[int, Field(ge=20, le=10_000)] | None = None
    """number of draws of receptances and coefficients; by default 200, with semi-discretisation 40"""
    seed: Annotated[int, Field(ge=0)] = 0
    """seed of the draws"""
    method: Literal["mean force", "semi-discretisation"] = "mean force"
    """mean force over a tooth pitch (zeroth order), or the periodic force, for interrupted cuts"""
    largest_depth: Annotated[float, amount(units.LENGTH)] | None = None
    """largest depth of semi-discretisation; by default ten times the smallest limit by the mean force"""

    @property
    def number_of_draws(self) -> int:
        """Number of draws."""
        return self.draws or (200 if self.method == "mean force" else 40)


class CatalogueSpread(SchemaTable):
    """Standard deviations of the dimensions of every tool of a catalogue; the errors of tools are independent."""

    overhang: LengthSpread = None
    """standard deviation of the overhang"""
    diameter: LengthSpread = None
    """standard deviation of the diameter of the shank"""
    effective_diameter: LengthSpread = None
    """standard deviation of the effective diameter of the flutes"""


class CatalogueTable(SchemaTable):
    """Tools and holders in CSV files, and their machine."""

    tools: DataFile | None = None
    """CSV file with a tool in each row; not needed if the command names one"""
    holders: DataFile | None = None
    """CSV file with a segment of a holder in each row; parts of this file are holders as well"""
    machine: Annotated[list[NameInMachine], Field(min_length=1)]
    """names of joints and parts behind the holder, from its joint on"""
    attachments: AttachmentNames = Field(default=[])
    """names of masses and ground springs on these parts"""
    spindle: str | None = None
    """file with the receptances of a spindle behind the machine: from `write_spindle`, or FRFs"""
    joint: Annotated[str, name_of("joints")] | None = None
    """name of the joint between tool and holder, for rows that name none"""
    tolerance: CatalogueSpread = CatalogueSpread.default()
    """standard deviations of the dimensions of tools"""


# The file -----------------------------------------------------------------------------------------------------------


class CampaignTable(SchemaTable):
    """A measuring campaign: structures, measurements and unknowns."""

    format: Literal[1] = 1
    """version of this format"""
    title: str = ""
    """free text"""
    description: str = ""
    """free text: the origin of the data, and whether they are simulated"""
    materials: dict[Name, Annotated[ElementTable, Of(Material, name="MaterialTable")]]
    """materials by name"""
    parts: dict[Word, PartTable]
    """parts by name"""
    modal_parts: dict[Word, ModalPartTable] = Field(default={})
    """parts known by their modes, such as a spindle, by name"""
    joints: dict[Word, JointTable] = Field(default={})
    """joints by name"""
    sensors: dict[Word, SensorTable] = Field(default={})
    """sensors by name"""
    attachments: dict[Word, AttachmentTable] = Field(default={})
    """masses and ground springs by name"""
    assemblies: dict[Name, AssemblyTable]
    """configurations by name"""
    measurements: dict[Name, MeasurementTable] = Field(default={})
    """measurements by name"""
    candidates: dict[Name, CandidateTable] = Field(default={})
    """candidates for the next measurement, by name"""
    cuts: dict[Name, CutTable] = Field(default={})
    """cuts whose stable depth is computed, by name"""
    unknowns: Annotated[dict[str, UnknownTable], by_address("lower", "upper", "start")] = Field(default={})
    """parameters to identify, by address: `"joint.k_theta"`"""
    series: SeriesTable | None = None
    """levels of a condition at which the same measurements were repeated"""
    settings: SettingsTable = SettingsTable.default()
    """settings of the fit"""
    prediction: PredictionTable = PredictionTable.default()
    """settings of predictions"""
    stability: StabilityTable = StabilityTable.default()
    """speeds and probability of stable depths"""
    catalogue: CatalogueTable | None = None
    """tools and holders in CSV files, and their machine"""
