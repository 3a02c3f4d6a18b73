"""The tables of a campaign file: their keys, with quantity, default and documentation.

Tables of elements (materials, segments, joints, masses, cuts) have the fields of the elements as keys.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Literal

from receptance import units
from receptance._reading import reading_options
from receptance._text import shown
from receptance.campaign.keys import (
    PLAIN,
    DataFile,
    DataFiles,
    Deviated,
    ElementOf,
    ElementTable,
    Flag,
    KeyTable,
    ListOf,
    MapOf,
    NamedTables,
    NameInMachine,
    NameOf,
    OneKind,
    Parsed,
    Place,
    Real,
    TableOf,
    Text,
    ValueAtAddress,
    ValueOfUnknown,
    Word,
    Written,
)
from receptance.campaign.values import (
    Deviation,
    parse_condition,
    parse_deviation_share,
    parse_force_window,
    parse_level,
    parse_share,
)
from receptance.model.beams import Material, Segment, SpreadJoint
from receptance.model.fields import Choice, Count, Field, Number, Position
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import ModalPart, Mode
from receptance.stability.cutting import Milling, Turning
from receptance.units import Form

_EMPTY: Mapping[str, Any] = {}
_NONE: list[Any] = []
WORD = r"^[^\W\d]\w*$"
"""Pattern of a name that begins addresses."""
BAND = ListOf("", Number(units.FREQUENCY_OR_ZERO, ""), least=2, most=2)
"""Lowest and highest frequency."""


def name_or_number(doc: str, expected: str) -> Written:
    """Return the declaration of a name in a file, or its number."""
    return Written(doc, types=(str, int), expected=expected, form=({"type": "string"}, {"type": "integer"}))


def deviations(doc: str) -> Written:
    """Return the declaration of standard deviations of natural frequencies, one for all or one for each."""
    form = ({"type": "string"}, {"type": "array", "items": {"type": "string"}})
    return Written(doc, types=(str, list), expected='a standard deviation such as "5 Hz", or a list of them', form=form)


def check_word(key: str, place: Place) -> None:
    """Raise unless a key is a word."""
    del place
    if not re.search(WORD, key):
        raise ValueError(f"is {shown(key)}, expected one word of letters, digits and underscores")


def check_name(key: str, place: Place) -> None:
    """Raise for an empty key."""
    del place
    if not key:
        raise ValueError(f"is {shown(key)}, expected some text")


def check_address(key: str, place: Place) -> None:
    """Raise unless a key is the address of a parameter."""
    place.address(key)


def condition(doc: str) -> Parsed:
    """Return the declaration of a number with any unit."""
    return Parsed(doc, parse_condition, {"anyOf": PLAIN})


def level(doc: str) -> Parsed:
    """Return the declaration of a level of joints in micro-slip, and whether it is a force in N."""
    return Parsed(doc, parse_level, {"anyOf": PLAIN})


def share(doc: str) -> Parsed:
    """Return the declaration of a percentage."""
    return Parsed(doc, lambda text: parse_share(text, 'a percentage such as "5 %"'))


def deviation_share(doc: str) -> Parsed:
    """Return the declaration of the standard deviation of an FRF, relative to its magnitude."""
    return Parsed(doc, parse_deviation_share)


def text_by_text(doc: str) -> MapOf:
    """Return the declaration of texts by name."""
    return MapOf(doc, Text())


CONDITION = condition("")

# Parts and joints ----------------------------------------------------------------------------------------------------


MATERIAL = ElementOf(Material)
SEGMENT = ElementOf(Segment)


class PartTable(KeyTable):
    """A tool, a holder, a blank: segments in a row, rigidly connected, from its tip-side end on."""

    segments: list[ElementTable] = ListOf(
        "one or more, `[[parts.NAME.segments]]`, in order from the tip-side end", SEGMENT, least=1
    ).needed()
    rigid: bool = Flag("whether the part is rigid: only its mass counts").default(False)


_MOST_MODES = 40
"""Largest number of modes of a part; each has four unknowns."""
MODE = ElementOf(Mode, defaults={"frequency_hz": None, "damping_ratio": 0.03, "y": 0.0, "theta": 0.0})
"""A mode; its numbers may be unknowns."""


class Modes(ListOf):
    """Modes, or their number if they are identified."""

    def read(self, written: Any, place: Place) -> Any:
        if isinstance(written, bool) or not isinstance(written, int):
            return super().read(written, place)
        if not 1 <= written <= _MOST_MODES:
            raise ValueError(f"is {written}, expected a number of modes from 1 to {_MOST_MODES}")
        return [MODE.made({})] * written

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [{"type": "integer"}, super().schema()]}


class ModalPartKeys(KeyTable):
    """A part known by its modes, a spindle: the last name of a chain. Its numbers may be unknowns."""

    modes: list[ElementTable] = Modes(
        "one or more, `[[modal_parts.NAME.modes]]`, or their number if they are identified",
        MODE,
        least=1,
        most=_MOST_MODES,
    ).needed()
    identify: bool = Flag(
        "whether all numbers with real shapes are unknowns, with bounds and starts from FRFs where `unknowns` has "
        "none; frequencies are then optional"
    ).default(False)


MODAL_PART = ElementOf(ModalPart, keys=ModalPartKeys)
JOINTS = OneKind(
    ElementOf(PointJoint, kind="point"),
    ElementOf(SpreadJoint, kind="spread"),
    ElementOf(ColletJoint, kind="collet"),
    ElementOf(MicroslipJoint, kind="micro-slip"),
)
ATTACHMENTS = OneKind(
    ElementOf(PointMass, kind="mass"), ElementOf(GroundSpring, kind="ground"), ElementOf(Resonator, kind="resonator")
)
SENSOR = ElementOf(PointMass, without=("part", "position"), name="SensorTable")


class CoordinateTable(KeyTable):
    """A position on a part, a direction and a sign."""

    part: str = NameOf("name of the part; by default the first one of the chain", "parts", optional=True).default("")
    position: float | Literal["end"] = Position(
        'distance from the part\'s tip-side end, or `"end"` for its far end; by default 0'
    ).default(0.0)
    direction: Literal["+y", "-y", "+theta", "-theta"] = Choice(
        "translation y or rotation theta, and the sign in which the channel counts it", ("+y", "-y", "+theta", "-theta")
    ).default("+y")


class AssemblyTable(KeyTable):
    """A configuration: parts and joints in a row from the tip, and values of its own."""

    chain: list[str] = ListOf(
        "names of parts and joints from the tip on; begins with a part and ends with a part or a modal part",
        NameOf("", "parts", "joints", "modal_parts"),
        least=1,
    ).needed()
    attachments: list[str] = ListOf("names of the masses and ground springs on it", NameOf("", "attachments")).default(
        _NONE
    )
    set: Mapping[str, float] = MapOf(
        'values of this configuration by address, `{ "tool.segment[0].length" = "60 mm" }`', ValueAtAddress()
    ).default(_EMPTY)
    tolerance: Mapping[str, Deviation] = MapOf(
        "standard deviations of this configuration by address; one error for this configuration alone",
        ValueAtAddress(deviation=True),
    ).default(_EMPTY)
    conditions: Mapping[str, float] = MapOf(
        "numbers with units that describe the configuration: torque, insertion, drawbar force", CONDITION
    ).default(_EMPTY)
    motion: Literal["bending", "axial"] = Choice(
        "bending or axial; in axial motion y, k_y and c_y are along the axis, and there is no rotation",
        ("bending", "axial"),
    ).default("bending")


# Measurements --------------------------------------------------------------------------------------------------------


class EntryTable(KeyTable):
    """The FRF to read from a file with several FRFs, responses or excitations."""

    number: int | None = Count(
        "number of the FRF, counted from 0, if the file holds several", least=0, most=math.inf
    ).default(None)
    response: str | int | None = name_or_number(
        "number of the response, counted from 0, or its name in the file", "a number from 0 or a name in the file"
    ).default(None)
    excitation: str | int | None = name_or_number(
        "number of the excitation, counted from 0, or its name in the file", "a number from 0 or a name in the file"
    ).default(None)


def _option(name: str, kind: Callable[[str], Field]) -> Field:
    """Return the declaration of a key that is an option of reading."""
    return kind(reading_options()[name][1].text)


def _header(doc: str) -> ListOf:
    return ListOf(doc, Text())


def _form(doc: str) -> Choice:
    return Choice(doc, units.FORMS)


def _sample_rate(doc: str) -> Number:
    return Number(units.FREQUENCY, doc)


class FRFReading(KeyTable):
    """Options of reading an FRF."""

    format: str | None = _option("format", Text).default(None)
    quantity: Form | None = _option("quantity", _form).default(None)
    unit: str | None = _option("unit", Text).default(None)
    variables: Mapping[str, str] | None = _option("variables", text_by_text).default(None)
    columns: list[str] | None = _option("columns", _header).default(None)
    coherence: str | None = _option("coherence", DataFile).default(None)
    coherence_variables: Mapping[str, str] | None = _option("coherence_variables", text_by_text).default(None)
    coherence_columns: list[str] | None = _option("coherence_columns", _header).default(None)
    ignore_coherence: bool = _option("ignore_coherence", Flag).default(False)
    conjugate: bool = _option("conjugate", Flag).default(False)
    reverse: bool = _option("reverse", Flag).default(False)


class RecordsReading(KeyTable):
    """Options of reading time records."""

    format: str | None = _option("format", Text).default(None)
    units: Mapping[str, str] | None = _option("unit", text_by_text).default(None)
    variables: Mapping[str, str] | None = _option("variables", text_by_text).default(None)
    columns: list[str] | None = _option("columns", _header).default(None)
    reverse: bool = _option("reverse", Flag).default(False)
    sample_rate: float | None = _option("sample_rate_hz", _sample_rate).default(None)


class FileFields(FRFReading):
    """A file with an FRF, and properties that are not in the file; the base of tables that name one."""

    file: str = DataFile(
        "path, relative to the campaign file: UFF58, CSV, NPZ, MAT, HDF5, `.frf`, DataPhysics ASCII"
    ).needed()
    entry: EntryTable = TableOf(
        EntryTable, "the FRF to read, if the file holds several FRFs, responses or excitations"
    ).default(EntryTable())
    averages: int | None = Count("number of averages, if the file does not state it", most=math.inf).default(None)
    standard_deviation: float | None = deviation_share(
        'standard deviation of the FRF on every line, such as `"2 %"`; by default from the file\'s variance, or '
        "from coherence and averages"
    ).default(None)
    decay_rate: float | None = Number(
        units.DECAY_RATE, "decay rate of an exponential window on both channels, if the file does not state it"
    ).default(None)


class _Measured(KeyTable):
    assembly: str = NameOf("name of the assembly that was measured", "assemblies").needed()
    role: Literal["identify", "hold out"] = Choice(
        "whether it is used in the fit, or held out for comparison with predictions", ("identify", "hold out")
    ).default("identify")
    sensor: str | None = NameOf("name of the sensor at the response coordinate; none for a laser", "sensors").default(
        None
    )
    conditions: Mapping[str, float] = MapOf(
        "numbers with units that describe the measurement: a force level, a temperature", CONDITION
    ).default(_EMPTY)
    attachments: list[str] = ListOf(
        "names of masses and ground springs that were attached during this measurement only: a second sensor, a "
        "suspension",
        NameOf("", "attachments"),
    ).default(_NONE)
    level: tuple[float, bool] | None = level(
        "level of joints in micro-slip: amplitude over reference, or a force, which their `reference_force` divides"
    ).default(None)


class _Response(_Measured):
    response: CoordinateTable = TableOf(CoordinateTable, "coordinate of the measured motion").default(CoordinateTable())
    excitation: CoordinateTable = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    bands: list[list[float]] | None = ListOf(
        'frequency bands to use, `[["300 Hz", "4 kHz"]]`; by default all usable lines', BAND, least=1
    ).default(None)
    floor: float | None = deviation_share(
        'standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`'
    ).default(None)
    integrate: int = Count(
        "number of additional integrations of the motion, for a file that states a wrong quantity: 1 if it holds "
        "velocities and states displacements, -1 for the reverse",
        least=-2,
        most=2,
    ).default(0)
    ends: float | None = Number(
        units.TIME,
        "time from the hit to the end of a record that was truncated while the structure still vibrated; the "
        'unknown `"observation.end"` estimates it',
    ).default(None)


class FRFTable(FileFields, _Response):
    """A frequency response function from a file."""

    kind: Literal["frf"] = Word('`"frf"`').needed()
    force: float | None = Number(
        units.FORCE, "amplitude of a stepped sine; it determines the level of joints in micro-slip on each line"
    ).default(None)


class HammerTable(RecordsReading, _Response):
    """Force and response of hammer hits against time, from which the FRF is estimated."""

    kind: Literal["hammer records"] = Word('`"hammer records"`').needed()
    file: str | list[str] = DataFiles(
        "path, relative to the campaign file, with one or several hits, or a list of paths: UFF58, CSV, NPZ, MAT, HDF5"
    ).needed()
    force: str | int = name_or_number(
        "name of the force channel, or its number counted from 0",
        "the name of a channel in the file, or its number from 0",
    ).needed()
    motion: str | int = name_or_number(
        "name of the response channel, or its number counted from 0",
        "the name of a channel in the file, or its number from 0",
    ).needed()
    full_scale_force: float | None = Number(
        units.FORCE, "full scale of the force channel; without it an overload is detected only by a flat top"
    ).default(None)
    trigger: float | None = Number(
        units.FORCE, "force at which a hit begins; by default a tenth of the largest"
    ).default(None)
    duration: float | None = Number(
        units.TIME, "length of the block of a hit; by default the time between hits"
    ).default(None)
    pre_trigger: float | None = Number(
        units.TIME_OR_ZERO,
        "time from the beginning of a block to the trigger, by default 10 ms, if a record holds several hits",
    ).default(None)
    double_hit_loss_db: float | None = Real(
        "largest loss of the force's spectrum, in dB, of a double hit that is used: 0 drops all of them; by default 3",
        least=0.0,
    ).default(None)
    deviating_hits: Literal["drop", "keep"] = Choice(
        "treatment of hits whose FRF has another sign or gain than that of the majority, or none", ("drop", "keep")
    ).default("drop")
    separation: float | None = Number(
        units.TIME, "contacts closer than this are one double hit, if a record holds several hits; by default 100 ms"
    ).default(None)
    drop_hits: list[int] = ListOf(
        "numbers of hits to drop, counted from 1 in the order in which they are found", Count("", most=math.inf)
    ).default(_NONE)
    estimator: Literal["H1", "H2", "Hv"] = Choice("estimator of the FRF", ("H1", "H2", "Hv")).default("H1")
    force_drop_db: float = Real(
        "the usable band ends where the force's spectrum is this many dB below its largest value; with a larger "
        "number lines with less force are used as well, with their larger variance",
        above=0.0,
    ).default(20.0)
    decay_rate: float = Number(
        units.DECAY_RATE, "decay rate of the exponential window to apply to both channels"
    ).default(0.0)
    response_decay_rate: float = Number(
        units.DECAY_RATE, "decay rate of an exponential window that the recorder applied to the response alone"
    ).default(0.0)
    force_window: float | Literal["auto", "none"] = Parsed(
        'length of the force window after the contact begins, such as `"2 ms"`; `"auto"`, or `"none"` for the '
        "whole block",
        parse_force_window,
    ).default("auto")


class FrequenciesTable(_Measured):
    """Natural frequencies, and damping ratios where these are known, here or in a CSV file."""

    kind: Literal["natural frequencies"] = Word('`"natural frequencies"`').needed()
    frequencies: list[float] | None = ListOf(
        "natural frequencies, ascending", Number(units.FREQUENCY, ""), least=1
    ).default(None)
    modes: list[int] | None = ListOf(
        "numbers of the elastic modes, the lowest is 1; by default 1, 2, and so on", Count("", most=math.inf), least=1
    ).default(None)
    standard_deviation: str | list[str] | None = deviations(
        'standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each'
    ).default(None)
    damping_ratios: list[str] | None = ListOf(
        'damping ratios such as `"1.2 %"`, one for each frequency, or `"unknown"`; frequencies are then those of '
        "damped modes (their magnitudes), else of undamped ones",
        Text(),
        least=1,
    ).default(None)
    damping_deviation: str | float | list[str | float] | None = Written(
        'standard deviation of the damping ratios, `"5 %"` of them or a number such as 0.0005, one for all or one '
        "for each",
        types=(str, float, list),
        expected='a standard deviation such as "5 %" of the ratio, a number, or a list of them',
        form=(*PLAIN, {"type": "array", "items": {"anyOf": PLAIN}}),
    ).default(None)
    file: str | None = DataFile(
        "CSV file instead, with columns `mode`, `frequency [Hz]` and, optionally, `standard_deviation [Hz]`, "
        "`damping_ratio [%]`, `damping_deviation [%]` (of the ratio); an empty cell is an unknown ratio"
    ).default(None)
    response: CoordinateTable = TableOf(CoordinateTable, "coordinate of the sensor").default(CoordinateTable())


MEASUREMENTS = OneKind(TableOf(FRFTable), TableOf(HammerTable), TableOf(FrequenciesTable))
MeasurementTable = FRFTable | HammerTable | FrequenciesTable


class _Possible(KeyTable):
    assembly: str = NameOf(
        "name of the assembly to measure; one that was measured before is in the same clamping", "assemblies"
    ).needed()
    sensor: str | None = NameOf("name of the sensor at the response coordinate; none for a laser", "sensors").default(
        None
    )
    response: CoordinateTable = TableOf(CoordinateTable, "coordinate of the measured motion").default(CoordinateTable())
    conditions: Mapping[str, float] = MapOf("numbers with units that describe the measurement", CONDITION).default(
        _EMPTY
    )
    cost: float = Real("cost, in any unit that all candidates share", above=0.0).default(1.0)


class CandidateFRFTable(_Possible):
    """A frequency response function that could be measured."""

    kind: Literal["frf"] = Word('`"frf"`').needed()
    excitation: CoordinateTable = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    lower: float | None = Number(units.FREQUENCY, "lowest line; by default `step`").default(None)
    upper: float = Number(units.FREQUENCY, "highest line").needed()
    step: float = Number(units.FREQUENCY, "distance of the lines, whose noise is independent").needed()
    standard_deviation: float = deviation_share(
        'expected standard deviation of the FRF on every line, such as `"2 %"`'
    ).needed()
    floor: float | None = deviation_share(
        'standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`'
    ).default(None)


class CandidateFrequenciesTable(_Possible):
    """Natural frequencies that could be measured."""

    kind: Literal["natural frequencies"] = Word('`"natural frequencies"`').needed()
    modes: list[int] = ListOf(
        "numbers of the elastic modes, the lowest is 1", Count("", most=math.inf), least=1
    ).needed()
    standard_deviation: str | list[str] = deviations(
        'expected standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each'
    ).needed()


CANDIDATES = OneKind(TableOf(CandidateFRFTable), TableOf(CandidateFrequenciesTable))
CandidateTable = CandidateFRFTable | CandidateFrequenciesTable

# Unknowns and settings -----------------------------------------------------------------------------------------------


class PriorTable(KeyTable):
    """Prior knowledge of an unknown: a Gaussian on the scale of the fit."""

    value: str | float = Written("most likely value, a quantity of the parameter's kind").needed()
    spread: str | float = Written(
        'its standard deviation, `"30 %"` or a quantity of the parameter\'s kind, or `"factor 3"` where the '
        "logarithm is fitted"
    ).needed()


class UnknownTable(KeyTable):
    """A parameter to identify; all assemblies that have it share it, unless a law across assemblies is given."""

    lower: float = ValueOfUnknown("lower bound, a quantity of the parameter's kind").needed()
    upper: float = ValueOfUnknown("upper bound").needed()
    start: float | None = ValueOfUnknown(
        "start value; by default the joint's value, else the middle of the bounds"
    ).default(None)
    scale: Literal["log", "linear"] | None = Choice(
        "whether the logarithm or the value is fitted; by default the logarithm where the lower bound is above zero",
        ("log", "linear"),
    ).default(None)
    prior: PriorTable | None = TableOf(PriorTable, "prior; the measurements then need standard deviations").default(
        None
    )
    name: str = Text("name in results; by default its address").default("")
    assemblies: list[str] | None = ListOf(
        "assemblies that have the unknown; by default all", NameOf("", "assemblies")
    ).default(None)
    multiple: float | None = Real(
        "the parameter is this multiple of the unknown, whose bounds and start are then plain numbers in SI units"
    ).default(None)
    also: Mapping[str, float] = MapOf(
        "further parameters by address, as multiples of the unknown", Real(), check_address
    ).default(_EMPTY)
    moves: Mapping[str, float] = MapOf(
        "parameters by address that the unknown changes: v becomes v + n u, with the unknown u and the number n; "
        "the unknown then has a name instead of an address, and plain numbers in SI units",
        Real(),
        check_address,
    ).default(_EMPTY)
    relative: bool = Flag("with `moves`: v becomes v exp(n u)").default(False)
    power_of: str | None = Text(
        "name of a condition, or an address; the parameter is a power of it across assemblies, or, with `moves`, "
        "n is multiplied by the logarithm of that condition over its reference"
    ).default(None)
    reference: float | None = condition(
        'value of that condition at which the parameter equals the unknown, such as `"135 N m"`, or, with '
        "`moves`, at which there is no change"
    ).default(None)
    exponent: list[float] | None = ListOf(
        "bounds of the exponent, by default `[-4, 4]`", Real(), least=2, most=2
    ).default(None)
    free: bool = Flag("a value for each assembly instead of one for all").default(False)
    along: str | None = Text(
        "with `free`: name of the condition over which values are interpolated for assemblies that were not "
        "measured; by default that of the series"
    ).default(None)
    individual: float | None = share(
        'standard deviation of the individual deviation of each assembly, such as `"5 %"`'
    ).default(None)
    follows: Mapping[str, float] = MapOf(
        "further parameters by address that are multiplied by its powers and individual deviations, raised to the "
        "number given",
        Real(),
    ).default(_EMPTY)


class SettingsTable(KeyTable):
    """Settings of the fit."""

    objective: Literal["log", "percentage"] = Choice(
        "complex logarithm of measured over calculated, or percentage of the magnitude in bands around the peaks",
        ("log", "percentage"),
    ).default("log")
    starts: int = Count("number of starts", most=1000000).default(8)
    seed: int = Count("seed of the starts that are drawn", least=0, most=math.inf).default(0)
    max_evaluations: int = Count("largest number of evaluations from one start", most=1000000).default(200)
    strategy: Literal["direct", "staged"] = Choice(
        "whether the fit begins at the starts, or is preceded by easier fits, for starts that are decades off",
        ("direct", "staged"),
    ).default("direct")
    profiles: bool = Flag("whether intervals are also computed from profile likelihoods").default(True)
    band_width: float = share('half width of the bands of the percentage objective, by default `"5 %"`').default(0.05)


class PredictionTable(KeyTable):
    """Predictions of assemblies that were not measured, and the level of intervals."""

    lower: float | None = Number(
        units.FREQUENCY, "lowest line; by default a tenth of the first natural frequency"
    ).default(None)
    upper: float | None = Number(
        units.FREQUENCY, "highest line and limit of the natural frequencies; by default the highest measured frequency"
    ).default(None)
    step: float | None = Number(
        units.FREQUENCY, "distance of the lines; by default a two-thousandth of the band"
    ).default(None)
    response: CoordinateTable = TableOf(CoordinateTable, "coordinate of the motion").default(CoordinateTable())
    excitation: CoordinateTable = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    level: float = Real("level of the intervals", above=0.0, below=1.0).default(0.95)
    force: float | None = Number(
        units.FORCE,
        "amplitude of a stepped sine, for FRFs with joints in micro-slip; by default the joints have their own level",
    ).default(None)


class SeriesTable(KeyTable):
    """Levels of repeated measurements; a table with `{level}` in its name is the template of a table for each level."""

    over: str = Text('name of the condition, such as `"drawbar force"`').needed()
    levels: list[str | float] = ListOf(
        'the levels, `["0 kN", "1 kN"]`; `{level}` is replaced by the level as it is written, `{value}` by its number',
        Written(),
        least=1,
    ).needed()
    hold_out: list[str | float] = ListOf(
        "levels whose measurements are held out, written as in `levels`", Written()
    ).default(_NONE)


# Cuts and catalogues -------------------------------------------------------------------------------------------------


class TipTable(FileFields):
    """The receptance of the tool tip in one direction: one of an assembly, a measurement or a file."""

    file: str | None = DataFile("path of a file with the FRF of the tip").default(None)  # type: ignore[assignment]
    assembly: str | None = NameOf("name of an assembly whose tip is predicted", "assemblies").default(None)
    measurement: str | None = NameOf("name of a measured FRF of the campaign", "measurements").default(None)
    bands: list[list[float]] | None = ListOf(
        'frequency bands of a file or a measurement in which limits are computed, `[["300 Hz", "4 kHz"]]`; by '
        "default all usable lines",
        BAND,
        least=1,
    ).default(None)


class TipAcross(TableOf):
    """The tip across the feed: a table, or a word."""

    def read(self, written: Any, place: Place) -> Any:
        if written in ("as x", "rigid"):
            return written
        if not isinstance(written, dict):
            raise ValueError(f'is {shown(written)}, expected a table, "as x" or "rigid"')
        return super().read(written, place)

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [super().schema(), {"type": "string", "enum": ["as x", "rigid"]}]}


class TurningKeys(KeyTable):
    """A turning cut: one tooth in continuous engagement."""

    angle: float = Number(units.DIRECTION, "angle between the force and the direction of the chip thickness").default(
        0.0
    )
    x: TipTable = TableOf(TipTable, "receptance of the tip in the direction of the chip thickness").needed()


class MillingKeys(KeyTable):
    """A milling cut with straight, evenly spaced teeth."""

    x: TipTable = TableOf(TipTable, "receptance of the tip in the direction of feed").needed()
    y: TipTable | Literal["as x", "rigid"] = TipAcross(
        TipTable, 'receptance across it; `"as x"` the same, `"rigid"` none'
    ).default("as x")


CUTS = OneKind(
    ElementOf(Milling, kind="milling", keys=MillingKeys),
    ElementOf(Turning, kind="turning", keys=TurningKeys, without=("angle_deg",)),
)


class StabilityTable(KeyTable):
    """Speeds and probability of stable depths."""

    speeds: list[float] | None = ListOf(
        'lowest and highest spindle speed, `["4000 rpm", "24000 rpm"]`',
        Number(units.SPINDLE_SPEED, ""),
        least=2,
        most=2,
    ).default(None)
    step: float | None = Number(
        units.SPINDLE_SPEED,
        "distance of the speeds; by default a four-hundredth of their range, a thirtieth with semi-discretisation",
    ).default(None)
    probability: float = Real("probability with which recommended depths are stable", above=0.0, below=1.0).default(
        0.95
    )
    draws: int | None = Count(
        "number of draws of receptances and coefficients; by default 200, with semi-discretisation 40",
        least=20,
        most=10000,
    ).default(None)
    seed: int = Count("seed of the draws", least=0, most=math.inf).default(0)
    method: Literal["mean force", "semi-discretisation"] = Choice(
        "mean force over a tooth pitch (zeroth order), or the periodic force, for interrupted cuts",
        ("mean force", "semi-discretisation"),
    ).default("mean force")
    largest_depth: float | None = Number(
        units.LENGTH, "largest depth of semi-discretisation; by default ten times the smallest limit by the mean force"
    ).default(None)

    @property
    def number_of_draws(self) -> int:
        """Number of draws."""
        return self.draws or (200 if self.method == "mean force" else 40)


class CatalogueSpread(KeyTable):
    """Standard deviations of the dimensions of every tool of a catalogue; the errors of tools are independent."""

    overhang: Deviation | None = Deviated(units.LENGTH, "standard deviation of the overhang").default(None)
    diameter: Deviation | None = Deviated(units.LENGTH, "standard deviation of the diameter of the shank").default(None)
    effective_diameter: Deviation | None = Deviated(
        units.LENGTH, "standard deviation of the effective diameter of the flutes"
    ).default(None)


class CatalogueTable(KeyTable):
    """Tools and holders in CSV files, and their machine."""

    tools: str | None = DataFile("CSV file with a tool in each row; not needed if the command names one").default(None)
    holders: str | None = DataFile(
        "CSV file with a segment of a holder in each row; parts of this file are holders as well"
    ).default(None)
    machine: list[str] = ListOf(
        "names of joints and parts behind the holder, from its joint on", NameInMachine(), least=1
    ).needed()
    attachments: list[str] = ListOf(
        "names of masses and ground springs on these parts", NameOf("", "attachments")
    ).default(_NONE)
    spindle: str | None = Text(
        "file with the receptances of a spindle behind the machine: from `write_spindle`, or FRFs"
    ).default(None)
    joint: str | None = NameOf("name of the joint between tool and holder, for rows that name none", "joints").default(
        None
    )
    tolerance: CatalogueSpread = TableOf(CatalogueSpread, "standard deviations of the dimensions of tools").default(
        CatalogueSpread()
    )


# The file ------------------------------------------------------------------------------------------------------------


class Version(Count):
    """The version of the format, 1."""

    def read(self, written: Any, place: Place) -> int:
        if written != 1 or isinstance(written, (bool, float)):
            raise ValueError(f"is {shown(written)}, expected 1")
        return 1

    def schema(self) -> dict[str, Any]:
        return {"const": 1}


class CampaignTable(KeyTable):
    """A measuring campaign: structures, measurements and unknowns."""

    format: Literal[1] = Version("version of this format").default(1)
    title: str = Text("free text").default("")
    description: str = Text("free text: the origin of the data, and whether they are simulated").default("")
    materials: Mapping[str, ElementTable] = NamedTables("materials by name", MATERIAL, check_name).needed()
    parts: Mapping[str, PartTable] = NamedTables("parts by name", TableOf(PartTable), check_word, WORD).needed()
    modal_parts: Mapping[str, ElementTable] = NamedTables(
        "parts known by their modes, such as a spindle, by name", MODAL_PART, check_word, WORD
    ).default(_EMPTY)
    joints: Mapping[str, ElementTable] = NamedTables("joints by name", JOINTS, check_word, WORD).default(_EMPTY)
    sensors: Mapping[str, ElementTable] = NamedTables("sensors by name", SENSOR, check_word, WORD).default(_EMPTY)
    attachments: Mapping[str, ElementTable] = NamedTables(
        "masses and ground springs by name", ATTACHMENTS, check_word, WORD
    ).default(_EMPTY)
    assemblies: Mapping[str, AssemblyTable] = NamedTables(
        "configurations by name", TableOf(AssemblyTable), check_name
    ).needed()
    measurements: Mapping[str, MeasurementTable] = NamedTables(
        "measurements by name", MEASUREMENTS, check_name
    ).default(_EMPTY)
    candidates: Mapping[str, CandidateTable] = NamedTables(
        "candidates for the next measurement, by name", CANDIDATES, check_name
    ).default(_EMPTY)
    cuts: Mapping[str, ElementTable] = NamedTables(
        "cuts whose stable depth is computed, by name", CUTS, check_name
    ).default(_EMPTY)
    unknowns: Mapping[str, UnknownTable] = NamedTables(
        'parameters to identify, by address: `"joint.k_theta"`', TableOf(UnknownTable)
    ).default(_EMPTY)
    series: SeriesTable | None = TableOf(
        SeriesTable, "levels of a condition at which the same measurements were repeated"
    ).default(None)
    settings: SettingsTable = TableOf(SettingsTable, "settings of the fit").default(SettingsTable())
    prediction: PredictionTable = TableOf(PredictionTable, "settings of predictions").default(PredictionTable())
    stability: StabilityTable = TableOf(StabilityTable, "speeds and probability of stable depths").default(
        StabilityTable()
    )
    catalogue: CatalogueTable | None = TableOf(
        CatalogueTable, "tools and holders in CSV files, and their machine"
    ).default(None)
