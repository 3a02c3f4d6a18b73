"""The tables of a campaign file: their keys, with quantity, default and documentation.

Tables of elements (materials, segments, joints, masses, cuts) have the fields of the elements as keys.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
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
    parse_condition,
    parse_deviation_share,
    parse_force_window,
    parse_level,
    parse_share,
)
from receptance.model.beams import Material, Segment, SpreadJoint
from receptance.model.fields import Choice, Count, Field, Number, Position, T
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


name_or_number = partial(
    Written,
    types=(str, int),
    expected="a number from 0 or a name in the file",
    form=({"type": "string"}, {"type": "integer"}),
)
"""A name in a file, or its number."""
channel = partial(name_or_number, expected="the name of a channel in the file, or its number from 0")
deviations = partial(
    Written,
    types=(str, list),
    expected='a standard deviation such as "5 Hz", or a list of them',
    form=({"type": "string"}, {"type": "array", "items": {"type": "string"}}),
)
"""Standard deviations of natural frequencies, one for all or one for each."""
condition = partial(Parsed, parse=parse_condition, form={"anyOf": PLAIN})
"""A number with any unit."""
share = partial(Parsed, parse=lambda text: parse_share(text, 'a percentage such as "5 %"'))
deviation_share = partial(Parsed, parse=parse_deviation_share)
"""The standard deviation of an FRF, relative to its magnitude."""
texts_by_name = partial(MapOf, item=Text())


def check_word(_: Place, key: str) -> None:
    """Raise unless a key is a word."""
    if not re.search(WORD, key):
        raise ValueError(f"is {shown(key)}, expected one word of letters, digits and underscores")


def check_name(_: Place, key: str) -> None:
    """Raise for an empty key."""
    if not key:
        raise ValueError(f"is {shown(key)}, expected some text")


CONDITION = condition("")

# Parts and joints ----------------------------------------------------------------------------------------------------


MATERIAL = ElementOf(Material)
SEGMENT = ElementOf(Segment)


class PartTable(KeyTable):
    """A tool, a holder, a blank: segments in a row, rigidly connected, from its tip-side end on."""

    segments = ListOf(
        "one or more, `[[parts.NAME.segments]]`, in order from the tip-side end", SEGMENT, least=1
    ).needed()
    rigid = Flag("whether the part is rigid: only its mass counts").default(False)


_MOST_MODES = 40
"""Largest number of modes of a part; each has four unknowns."""
MODE = ElementOf(Mode, defaults={"frequency_hz": None, "damping_ratio": 0.03, "y": 0.0, "theta": 0.0})
"""A mode; its numbers may be unknowns."""


class Modes(ListOf[Any]):
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
    identify = Flag(
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

    part = NameOf("name of the part; by default the first one of the chain", "parts", optional=True).default("")
    position = Position('distance from the part\'s tip-side end, or `"end"` for its far end; by default 0').default(0.0)
    direction: Literal["+y", "-y", "+theta", "-theta"] = Choice(
        "translation y or rotation theta, and the sign in which the channel counts it", ("+y", "-y", "+theta", "-theta")
    ).default("+y")


class AssemblyTable(KeyTable):
    """A configuration: parts and joints in a row from the tip, and values of its own."""

    chain = ListOf(
        "names of parts and joints from the tip on; begins with a part and ends with a part or a modal part",
        NameOf("", "parts", "joints", "modal_parts"),
        least=1,
    ).needed()
    attachments = ListOf("names of the masses and ground springs on it", NameOf("", "attachments")).default(_NONE)
    set = MapOf(
        'values of this configuration by address, `{ "tool.segment[0].length" = "60 mm" }`', ValueAtAddress()
    ).default(_EMPTY)
    tolerance = MapOf(
        "standard deviations of this configuration by address; one error for this configuration alone",
        ValueAtAddress(deviation=True),
    ).default(_EMPTY)
    conditions = MapOf(
        "numbers with units that describe the configuration: torque, insertion, drawbar force", CONDITION
    ).default(_EMPTY)
    motion: Literal["bending", "axial"] = Choice(
        "bending or axial; in axial motion y, k_y and c_y are along the axis, and there is no rotation",
        ("bending", "axial"),
    ).default("bending")


# Measurements --------------------------------------------------------------------------------------------------------


class EntryTable(KeyTable):
    """The FRF to read from a file with several FRFs, responses or excitations."""

    number = Count("number of the FRF, counted from 0, if the file holds several", least=0, most=math.inf).default(None)
    response: str | int | None = name_or_number(
        "number of the response, counted from 0, or its name in the file",
        expected="a number from 0 or a name in the file",
    ).default(None)
    excitation: str | int | None = name_or_number(
        "number of the excitation, counted from 0, or its name in the file",
        expected="a number from 0 or a name in the file",
    ).default(None)


_header = partial(ListOf, item=Text())
_sample_rate = partial(Number, units.FREQUENCY)


def _option(name: str, kind: Callable[[str], Field[T]]) -> Field[T]:
    """Return the declaration of a key that is an option of reading."""
    return kind(reading_options()[name][1].text)


class FRFReading(KeyTable):
    """Options of reading an FRF."""

    format = _option("format", Text).default(None)
    quantity: Form | None = _option("quantity", partial(Choice, words=units.FORMS)).default(None)
    unit = _option("unit", Text).default(None)
    variables = _option("variables", texts_by_name).default(None)
    columns = _option("columns", _header).default(None)
    coherence = _option("coherence", DataFile).default(None)
    coherence_variables = _option("coherence_variables", texts_by_name).default(None)
    coherence_columns = _option("coherence_columns", _header).default(None)
    ignore_coherence = _option("ignore_coherence", Flag).default(False)
    conjugate = _option("conjugate", Flag).default(False)
    reverse = _option("reverse", Flag).default(False)


class RecordsReading(KeyTable):
    """Options of reading time records."""

    format = _option("format", Text).default(None)
    units = _option("unit", texts_by_name).default(None)
    variables = _option("variables", texts_by_name).default(None)
    columns = _option("columns", _header).default(None)
    reverse = _option("reverse", Flag).default(False)
    sample_rate = _option("sample_rate_hz", _sample_rate).default(None)


class FileFields(FRFReading):
    """A file with an FRF, and properties that are not in the file; the base of tables that name one."""

    file = DataFile(
        "path, relative to the campaign file: UFF58, CSV, NPZ, MAT, HDF5, `.frf`, DataPhysics ASCII"
    ).needed()
    entry = TableOf(EntryTable, "the FRF to read, if the file holds several FRFs, responses or excitations").default(
        EntryTable()
    )
    averages = Count("number of averages, if the file does not state it", most=math.inf).default(None)
    standard_deviation = deviation_share(
        'standard deviation of the FRF on every line, such as `"2 %"`; by default from the file\'s variance, or '
        "from coherence and averages"
    ).default(None)
    decay_rate = Number(
        units.DECAY_RATE, "decay rate of an exponential window on both channels, if the file does not state it"
    ).default(None)


class _Measured(KeyTable):
    assembly = NameOf("name of the assembly that was measured", "assemblies").needed()
    role: Literal["identify", "hold out"] = Choice(
        "whether it is used in the fit, or held out for comparison with predictions", ("identify", "hold out")
    ).default("identify")
    sensor = NameOf("name of the sensor at the response coordinate; none for a laser", "sensors").default(None)
    conditions = MapOf(
        "numbers with units that describe the measurement: a force level, a temperature", CONDITION
    ).default(_EMPTY)
    attachments = ListOf(
        "names of masses and ground springs that were attached during this measurement only: a second sensor, a "
        "suspension",
        NameOf("", "attachments"),
    ).default(_NONE)
    level = Parsed(
        "level of joints in micro-slip: amplitude over reference, or a force, which their `reference_force` divides",
        parse_level,
        {"anyOf": PLAIN},
    ).default(None)


class _Response(_Measured):
    response = TableOf(CoordinateTable, "coordinate of the measured motion").default(CoordinateTable())
    excitation = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    bands = ListOf(
        'frequency bands to use, `[["300 Hz", "4 kHz"]]`; by default all usable lines', BAND, least=1
    ).default(None)
    floor = deviation_share(
        'standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`'
    ).default(None)
    integrate = Count(
        "number of additional integrations of the motion, for a file that states a wrong quantity: 1 if it holds "
        "velocities and states displacements, -1 for the reverse",
        least=-2,
        most=2,
    ).default(0)
    ends = Number(
        units.TIME,
        "time from the hit to the end of a record that was truncated while the structure still vibrated; the "
        'unknown `"observation.end"` estimates it',
    ).default(None)


class FRFTable(FileFields, _Response):
    """A frequency response function from a file."""

    kind: Literal["frf"] = Word('`"frf"`').needed()
    force = Number(
        units.FORCE, "amplitude of a stepped sine; it determines the level of joints in micro-slip on each line"
    ).default(None)


class HammerTable(RecordsReading, _Response):
    """Force and response of hammer hits against time, from which the FRF is estimated."""

    kind: Literal["hammer records"] = Word('`"hammer records"`').needed()
    file = DataFiles(
        "path, relative to the campaign file, with one or several hits, or a list of paths: UFF58, CSV, NPZ, MAT, HDF5"
    ).needed()
    force: str | int = channel("name of the force channel, or its number counted from 0").needed()
    motion: str | int = channel("name of the response channel, or its number counted from 0").needed()
    full_scale_force = Number(
        units.FORCE, "full scale of the force channel; without it an overload is detected only by a flat top"
    ).default(None)
    trigger = Number(units.FORCE, "force at which a hit begins; by default a tenth of the largest").default(None)
    duration = Number(units.TIME, "length of the block of a hit; by default the time between hits").default(None)
    pre_trigger = Number(
        units.TIME_OR_ZERO,
        "time from the beginning of a block to the trigger, by default 10 ms, if a record holds several hits",
    ).default(None)
    double_hit_loss_db = Real(
        "largest loss of the force's spectrum, in dB, of a double hit that is used: 0 drops all of them; by default 3",
        least=0.0,
    ).default(None)
    deviating_hits: Literal["drop", "keep"] = Choice(
        "treatment of hits whose FRF has another sign or gain than that of the majority, or none", ("drop", "keep")
    ).default("drop")
    separation = Number(
        units.TIME, "contacts closer than this are one double hit, if a record holds several hits; by default 100 ms"
    ).default(None)
    drop_hits = ListOf(
        "numbers of hits to drop, counted from 1 in the order in which they are found", Count("", most=math.inf)
    ).default(_NONE)
    estimator: Literal["H1", "H2", "Hv"] = Choice("estimator of the FRF", ("H1", "H2", "Hv")).default("H1")
    force_drop_db = Real(
        "the usable band ends where the force's spectrum is this many dB below its largest value; with a larger "
        "number lines with less force are used as well, with their larger variance",
        above=0.0,
    ).default(20.0)
    decay_rate = Number(units.DECAY_RATE, "decay rate of the exponential window to apply to both channels").default(0.0)
    response_decay_rate = Number(
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
    frequencies = ListOf("natural frequencies, ascending", Number(units.FREQUENCY, ""), least=1).default(None)
    modes = ListOf(
        "numbers of the elastic modes, the lowest is 1; by default 1, 2, and so on", Count("", most=math.inf), least=1
    ).default(None)
    standard_deviation: str | list[str] | None = deviations(
        'standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each'
    ).default(None)
    damping_ratios = ListOf(
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
    file = DataFile(
        "CSV file instead, with columns `mode`, `frequency [Hz]` and, optionally, `standard_deviation [Hz]`, "
        "`damping_ratio [%]`, `damping_deviation [%]` (of the ratio); an empty cell is an unknown ratio"
    ).default(None)
    response = TableOf(CoordinateTable, "coordinate of the sensor").default(CoordinateTable())


MEASUREMENTS = OneKind(TableOf(FRFTable), TableOf(HammerTable), TableOf(FrequenciesTable))
MeasurementTable = FRFTable | HammerTable | FrequenciesTable


class _Possible(KeyTable):
    assembly = NameOf(
        "name of the assembly to measure; one that was measured before is in the same clamping", "assemblies"
    ).needed()
    sensor = NameOf("name of the sensor at the response coordinate; none for a laser", "sensors").default(None)
    response = TableOf(CoordinateTable, "coordinate of the measured motion").default(CoordinateTable())
    conditions = MapOf("numbers with units that describe the measurement", CONDITION).default(_EMPTY)
    cost = Real("cost, in any unit that all candidates share", above=0.0).default(1.0)


class CandidateFRFTable(_Possible):
    """A frequency response function that could be measured."""

    kind: Literal["frf"] = Word('`"frf"`').needed()
    excitation = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    lower = Number(units.FREQUENCY, "lowest line; by default `step`").default(None)
    upper = Number(units.FREQUENCY, "highest line").needed()
    step = Number(units.FREQUENCY, "distance of the lines, whose noise is independent").needed()
    standard_deviation = deviation_share(
        'expected standard deviation of the FRF on every line, such as `"2 %"`'
    ).needed()
    floor = deviation_share(
        'standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`'
    ).default(None)


class CandidateFrequenciesTable(_Possible):
    """Natural frequencies that could be measured."""

    kind: Literal["natural frequencies"] = Word('`"natural frequencies"`').needed()
    modes = ListOf("numbers of the elastic modes, the lowest is 1", Count("", most=math.inf), least=1).needed()
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

    lower = ValueOfUnknown("lower bound, a quantity of the parameter's kind").needed()
    upper = ValueOfUnknown("upper bound").needed()
    start = ValueOfUnknown("start value; by default the joint's value, else the middle of the bounds").default(None)
    scale: Literal["log", "linear"] | None = Choice(
        "whether the logarithm or the value is fitted; by default the logarithm where the lower bound is above zero",
        ("log", "linear"),
    ).default(None)
    prior = TableOf(PriorTable, "prior; the measurements then need standard deviations").default(None)
    name = Text("name in results; by default its address").default("")
    assemblies = ListOf("assemblies that have the unknown; by default all", NameOf("", "assemblies")).default(None)
    multiple = Real(
        "the parameter is this multiple of the unknown, whose bounds and start are then plain numbers in SI units"
    ).default(None)
    also = MapOf("further parameters by address, as multiples of the unknown", Real(), Place.address).default(_EMPTY)
    moves = MapOf(
        "parameters by address that the unknown changes: v becomes v + n u, with the unknown u and the number n; "
        "the unknown then has a name instead of an address, and plain numbers in SI units",
        Real(),
        Place.address,
    ).default(_EMPTY)
    relative = Flag("with `moves`: v becomes v exp(n u)").default(False)
    power_of = Text(
        "name of a condition, or an address; the parameter is a power of it across assemblies, or, with `moves`, "
        "n is multiplied by the logarithm of that condition over its reference"
    ).default(None)
    reference = condition(
        'value of that condition at which the parameter equals the unknown, such as `"135 N m"`, or, with '
        "`moves`, at which there is no change"
    ).default(None)
    exponent = ListOf("bounds of the exponent, by default `[-4, 4]`", Real(), least=2, most=2).default(None)
    free = Flag("a value for each assembly instead of one for all").default(False)
    along = Text(
        "with `free`: name of the condition over which values are interpolated for assemblies that were not "
        "measured; by default that of the series"
    ).default(None)
    individual = share('standard deviation of the individual deviation of each assembly, such as `"5 %"`').default(None)
    follows = MapOf(
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
    starts = Count("number of starts", most=1000000).default(8)
    seed = Count("seed of the starts that are drawn", least=0, most=math.inf).default(0)
    max_evaluations = Count("largest number of evaluations from one start", most=1000000).default(200)
    strategy: Literal["direct", "staged"] = Choice(
        "whether the fit begins at the starts, or is preceded by easier fits, for starts that are decades off",
        ("direct", "staged"),
    ).default("direct")
    profiles = Flag("whether intervals are also computed from profile likelihoods").default(True)
    band_width = share('half width of the bands of the percentage objective, by default `"5 %"`').default(0.05)


class PredictionTable(KeyTable):
    """Predictions of assemblies that were not measured, and the level of intervals."""

    lower = Number(units.FREQUENCY, "lowest line; by default a tenth of the first natural frequency").default(None)
    upper = Number(
        units.FREQUENCY, "highest line and limit of the natural frequencies; by default the highest measured frequency"
    ).default(None)
    step = Number(units.FREQUENCY, "distance of the lines; by default a two-thousandth of the band").default(None)
    response = TableOf(CoordinateTable, "coordinate of the motion").default(CoordinateTable())
    excitation = TableOf(CoordinateTable, "coordinate of the load").default(CoordinateTable())
    level = Real("level of the intervals", above=0.0, below=1.0).default(0.95)
    force = Number(
        units.FORCE,
        "amplitude of a stepped sine, for FRFs with joints in micro-slip; by default the joints have their own level",
    ).default(None)


class SeriesTable(KeyTable):
    """Levels of repeated measurements; a table with `{level}` in its name is the template of a table for each level."""

    over = Text('name of the condition, such as `"drawbar force"`').needed()
    levels = ListOf(
        'the levels, `["0 kN", "1 kN"]`; `{level}` is replaced by the level as it is written, `{value}` by its number',
        Written(),
        least=1,
    ).needed()
    hold_out = ListOf("levels whose measurements are held out, written as in `levels`", Written()).default(_NONE)


# Cuts and catalogues -------------------------------------------------------------------------------------------------


class TipTable(FileFields):
    """The receptance of the tool tip in one direction: one of an assembly, a measurement or a file."""

    file: str | None = DataFile("path of a file with the FRF of the tip").default(None)  # type: ignore[assignment]
    assembly = NameOf("name of an assembly whose tip is predicted", "assemblies").default(None)
    measurement = NameOf("name of a measured FRF of the campaign", "measurements").default(None)
    bands = ListOf(
        'frequency bands of a file or a measurement in which limits are computed, `[["300 Hz", "4 kHz"]]`; by '
        "default all usable lines",
        BAND,
        least=1,
    ).default(None)


class TipAcross(TableOf[Any]):
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

    angle = Number(units.DIRECTION, "angle between the force and the direction of the chip thickness").default(0.0)
    x = TableOf(TipTable, "receptance of the tip in the direction of the chip thickness").needed()


class MillingKeys(KeyTable):
    """A milling cut with straight, evenly spaced teeth."""

    x = TableOf(TipTable, "receptance of the tip in the direction of feed").needed()
    y: TipTable | Literal["as x", "rigid"] = TipAcross(
        TipTable, 'receptance across it; `"as x"` the same, `"rigid"` none'
    ).default("as x")


CUTS = OneKind(
    ElementOf(Milling, kind="milling", keys=MillingKeys),
    ElementOf(Turning, kind="turning", keys=TurningKeys, without=("angle_deg",)),
)


class StabilityTable(KeyTable):
    """Speeds and probability of stable depths."""

    speeds = ListOf(
        'lowest and highest spindle speed, `["4000 rpm", "24000 rpm"]`',
        Number(units.SPINDLE_SPEED, ""),
        least=2,
        most=2,
    ).default(None)
    step = Number(
        units.SPINDLE_SPEED,
        "distance of the speeds; by default a four-hundredth of their range, a thirtieth with semi-discretisation",
    ).default(None)
    probability = Real("probability with which recommended depths are stable", above=0.0, below=1.0).default(0.95)
    draws = Count(
        "number of draws of receptances and coefficients; by default 200, with semi-discretisation 40",
        least=20,
        most=10000,
    ).default(None)
    seed = Count("seed of the draws", least=0, most=math.inf).default(0)
    method: Literal["mean force", "semi-discretisation"] = Choice(
        "mean force over a tooth pitch (zeroth order), or the periodic force, for interrupted cuts",
        ("mean force", "semi-discretisation"),
    ).default("mean force")
    largest_depth = Number(
        units.LENGTH, "largest depth of semi-discretisation; by default ten times the smallest limit by the mean force"
    ).default(None)

    @property
    def number_of_draws(self) -> int:
        """Number of draws."""
        return self.draws or (200 if self.method == "mean force" else 40)


class CatalogueSpread(KeyTable):
    """Standard deviations of the dimensions of every tool of a catalogue; the errors of tools are independent."""

    overhang = Deviated(units.LENGTH, "standard deviation of the overhang").default(None)
    diameter = Deviated(units.LENGTH, "standard deviation of the diameter of the shank").default(None)
    effective_diameter = Deviated(units.LENGTH, "standard deviation of the effective diameter of the flutes").default(
        None
    )


class CatalogueTable(KeyTable):
    """Tools and holders in CSV files, and their machine."""

    tools = DataFile("CSV file with a tool in each row; not needed if the command names one").default(None)
    holders = DataFile(
        "CSV file with a segment of a holder in each row; parts of this file are holders as well"
    ).default(None)
    machine = ListOf(
        "names of joints and parts behind the holder, from its joint on", NameInMachine(), least=1
    ).needed()
    attachments = ListOf("names of masses and ground springs on these parts", NameOf("", "attachments")).default(_NONE)
    spindle = Text("file with the receptances of a spindle behind the machine: from `write_spindle`, or FRFs").default(
        None
    )
    joint = NameOf("name of the joint between tool and holder, for rows that name none", "joints").default(None)
    tolerance = TableOf(CatalogueSpread, "standard deviations of the dimensions of tools").default(CatalogueSpread())


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

    format = Version("version of this format").default(1)
    title = Text("free text").default("")
    description = Text("free text: the origin of the data, and whether they are simulated").default("")
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
    series = TableOf(SeriesTable, "levels of a condition at which the same measurements were repeated").default(None)
    settings = TableOf(SettingsTable, "settings of the fit").default(SettingsTable())
    prediction = TableOf(PredictionTable, "settings of predictions").default(PredictionTable())
    stability = TableOf(StabilityTable, "speeds and probability of stable depths").default(StabilityTable())
    catalogue = TableOf(CatalogueTable, "tools and holders in CSV files, and their machine").default(None)
