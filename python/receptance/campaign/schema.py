"""The tables of a campaign file: their keys, with quantity, default and documentation.

Tables of elements (materials, segments, joints, masses, cuts) have the fields of the elements as keys.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

from receptance import drawing, units
from receptance._reading import reading_options
from receptance._text import shown
from receptance.campaign.keys import (
    PLAIN,
    TEXT,
    WORD,
    ElementTable,
    KeyTable,
    ListOf,
    MapOf,
    NamedTables,
    OneKind,
    Place,
    Real,
    Value,
    check_name,
    check_word,
    data_file,
    deviation_at_address,
    deviation_of,
    element_keys,
    flag,
    name_in,
    name_in_machine,
    one_or_list,
    plain,
    spindle_file,
    text,
    text_of,
    value_at_address,
    value_of_unknown,
    word,
)
from receptance.campaign.shapes import ShapeTable
from receptance.campaign.values import (
    parse_condition,
    parse_damping_deviation,
    parse_damping_ratio,
    parse_deviation_share,
    parse_force_window,
    parse_frequency_deviation,
    parse_level,
    parse_radial_depth,
    parse_share,
)
from receptance.model.beams import Material, Segment, SpreadJoint
from receptance.model.contour import TOLERANCE
from receptance.model.fields import Choice, Count, Field, Number, Position, T
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import ModalPart, Mode
from receptance.stability.cutting import Milling, Turning
from receptance.units import Form

_EMPTY: Mapping[str, Any] = {}
_NONE: list[Any] = []
BAND = ListOf("", Number(units.FREQUENCY_OR_ZERO, ""), least=2, most=2)
"""Lowest and highest frequency."""


name_or_number = partial(
    plain, types=(str, int), expected="a number from 0 or a name in the file", form=[TEXT, {"type": "integer"}]
)
channel = partial(name_or_number, expected="the name of a channel in the file, or its number from 0")
deviations = partial(
    one_or_list,
    item=Value("", lambda written, _: parse_frequency_deviation(text_of(written))),
    expected='a standard deviation such as "5 Hz", or a list of them',
)
condition = partial(Value, parse=lambda written, _: parse_condition(written), form={"anyOf": PLAIN})
"""A number with any unit."""
share = partial(Value, parse=lambda written, _: parse_share(written, 'a percentage such as "5 %"'))
deviation_share = partial(Value, parse=lambda written, _: parse_deviation_share(written))
"""The standard deviation of an FRF, relative to its magnitude."""
texts_by_name = partial(MapOf, item=text())


CONDITION = condition("")
_FLOOR = deviation_share(
    'standard deviation of errors other than noise, added in quadrature on every line, such as `"0.3 %"`'
)

# Parts and joints ----------------------------------------------------------------------------------------------------


MATERIAL = element_keys(Material)


class SegmentKeys(KeyTable):
    """A Timoshenko beam: a cylinder or a cone, solid, hollow, or hollow and filled; or one with a shape of its own."""

    outer_diameter: float | None = Number(
        units.LENGTH, "outer diameter; not needed with a shape that has a size of its own"
    ).default(None)
    shape: ShapeTable | None = ShapeTable.keys("shape of the section; by default a circle or ring").default(None)


SEGMENT = element_keys(Segment, more=SegmentKeys)


class ContourSpread(KeyTable):
    """Standard deviations of the dimensions of a drawing; each is one error of all segments together."""

    diameter = deviation_of(units.LENGTH, "of all outer diameters, which are too large or too small together").default(
        None
    )
    bore = deviation_of(units.LENGTH, "of all diameters of bores, likewise").default(None)
    length = deviation_of(units.LENGTH, "of the whole length, of which every segment has its share").default(None)


class PartTable(KeyTable):
    """A tool, a holder, a blank: segments in a row, rigidly connected, from its tip-side end on, or a contour."""

    segments = ListOf(
        "one or more, `[[parts.NAME.segments]]`, in order from the tip-side end; not needed with `contour`",
        SEGMENT,
        least=1,
    ).default(_NONE)
    contour = data_file(
        "drawing of the contour, in place of segments: CSV with `x [mm]` and `diameter [mm]`, or DXF; the following "
        "keys are only for it"
    ).default(None)
    material = name_in("name of the material of a contour", "materials").default(None)
    layer: str | list[str] | None = one_or_list(
        "layers of a DXF file with the profile; by default the only one, or CUT and NOCUT",
        text(),
        "the name of a layer, or a list of them",
    ).default(None)
    bore_layer: str | list[str] | None = one_or_list(
        "layers of a DXF file with the bores; by default those named BORE, BORES, HOLE or HOLES",
        text(),
        "the name of a layer, or a list of them",
    ).default(None)
    unit = text("unit of the coordinates, if the file does not state it").default(None)
    axis = text(
        'axis of a DXF file, `"x"`, `"y"` or `"y = 12 mm"`; by default the line in the layer AXIS, else `"x"`'
    ).default(None)
    tip: drawing.Tip | None = Choice(
        "end of the drawing at which the tip is; by default that of the layer CUT, else left or bottom", drawing.TIPS
    ).default(None)
    within = Number(
        units.LENGTH, "largest distance between a curve of the drawing and the cones that replace it"
    ).default(TOLERANCE)
    tolerance = ContourSpread.keys("standard deviations of the dimensions of a contour").default(ContourSpread())
    rigid = flag("whether the part is rigid: only its mass counts").default(False)


_MOST_MODES = 40
"""Largest number of modes of a part; each has four unknowns."""
MODE = element_keys(Mode, defaults={"frequency_hz": None, "damping_ratio": 0.03, "y": 0.0, "theta": 0.0})
"""A mode; its numbers may be unknowns."""


_MODES = ListOf(
    'one or more, `[[modal_parts.NAME.modes]]`; or, if they are identified, their number, or `"auto"`, with which the '
    "records choose it",
    MODE,
    least=1,
    most=_MOST_MODES,
)
_AUTOMATIC = "auto"
_ROOM = 15
"""Largest number of modes that the records choose."""


class AutomaticModes(list[ElementTable]):
    """Tables of as many modes as the records may show; the fit chooses their number."""


def _read_modes(written: Any, place: Place) -> Any:
    """Return the tables of modes; a number stands for modes that are identified."""
    if written == _AUTOMATIC:
        return AutomaticModes([MODE.made({})] * _ROOM)
    if isinstance(written, str):
        raise ValueError(f'is "{written}", expected "{_AUTOMATIC}", a number of modes, or their tables')
    if isinstance(written, bool) or not isinstance(written, int):
        return _MODES.read(written, place)
    if not 1 <= written <= _MOST_MODES:
        raise ValueError(f"is {written}, expected a number of modes from 1 to {_MOST_MODES}")
    return [MODE.made({})] * written


class ModalPartKeys(KeyTable):
    """A part known by its modes, a spindle: the last name of a chain. Its numbers may be unknowns."""

    modes: list[ElementTable] = Value(
        _MODES.doc, _read_modes, {"anyOf": [{"const": _AUTOMATIC}, {"type": "integer"}, _MODES.schema()]}
    ).needed()
    identify = flag(
        "whether all numbers with real shapes are unknowns, with bounds and starts from FRFs where `unknowns` has "
        "none; frequencies are then optional"
    ).default(False)


MODAL_PART = element_keys(ModalPart, more=ModalPartKeys)


class SpindleTable(KeyTable):
    """A spindle that is measured with a blank in it: the last name of a chain. It has a file, or blanks, or both."""

    file = spindle_file(
        "file that assemblies with this spindle read, and that `receptance spindle` writes: receptances (.npz), modes "
        "(.toml), or an FRF matrix over y and theta of any program"
    ).default(None)
    blanks = ListOf(
        'names of assemblies that are a known blank in this spindle, `chain = ["blank", "spindle"]`; from their FRFs '
        "`receptance spindle` identifies it, other commands do not use them",
        name_in("", "assemblies"),
        least=1,
    ).default(_NONE)


JOINTS = OneKind(
    (
        element_keys(PointJoint, kind="point"),
        element_keys(SpreadJoint, kind="spread"),
        element_keys(ColletJoint, kind="collet"),
        element_keys(MicroslipJoint, kind="micro-slip"),
    )
)
ATTACHMENTS = OneKind(
    (
        element_keys(PointMass, kind="mass"),
        element_keys(GroundSpring, kind="ground"),
        element_keys(Resonator, kind="resonator"),
    )
)
SENSOR = element_keys(PointMass, without=("part", "position"), title="SensorTable")


class CoordinateTable(KeyTable):
    """A position on a part, a direction and a sign."""

    part = name_in("name of the part; by default the first one of the chain", "parts", optional=True).default("")
    position = Position('distance from the part\'s tip-side end, or `"end"` for its far end; by default 0').default(0.0)
    direction: Literal["+y", "-y", "+theta", "-theta"] = Choice(
        "translation y or rotation theta, and the sign in which the channel counts it", ("+y", "-y", "+theta", "-theta")
    ).default("+y")


class AssemblyTable(KeyTable):
    """A configuration: parts and joints in a row from the tip, and values of its own."""

    chain = ListOf(
        "names of parts and joints from the tip on; begins with a part and ends with a part, a modal part or a spindle",
        name_in("", "parts", "joints", "modal_parts", "spindles"),
        least=1,
    ).needed()
    insertion = Number(
        units.LENGTH,
        "length of the shank in the bore of the holder, if the parts on both sides of the first joint are those of "
        "their drawings, with the whole shank and the empty bore; `set` and `tolerance` then have their addresses",
    ).default(None)
    attachments = ListOf("names of the masses and ground springs on it", name_in("", "attachments")).default(_NONE)
    set = MapOf(
        'values of this configuration by address, `{ "tool.segment[0].length" = "60 mm" }`', value_at_address()
    ).default(_EMPTY)
    tolerance = MapOf(
        "standard deviations of this configuration by address; one error for this configuration alone",
        deviation_at_address(),
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
        "number of the response, counted from 0, or its name in the file"
    ).default(None)
    excitation: str | int | None = name_or_number(
        "number of the excitation, counted from 0, or its name in the file"
    ).default(None)


_header = partial(ListOf, item=text())
_sample_rate = partial(Number, units.FREQUENCY)


def _option(name: str, kind: Callable[[str], Field[T]]) -> Field[T]:
    """Return the declaration of a key that is an option of reading."""
    return kind(reading_options()[name][1].text)


class FRFReading(KeyTable):
    """Options of reading an FRF."""

    format = _option("format", text).default(None)
    quantity: Form | None = _option("quantity", partial(Choice, words=units.FORMS)).default(None)
    unit = _option("unit", text).default(None)
    variables = _option("variables", texts_by_name).default(None)
    columns = _option("columns", _header).default(None)
    coherence = _option("coherence", data_file).default(None)
    coherence_variables = _option("coherence_variables", texts_by_name).default(None)
    coherence_columns = _option("coherence_columns", _header).default(None)
    ignore_coherence = _option("ignore_coherence", flag).default(False)
    conjugate = _option("conjugate", flag).default(False)
    reverse = _option("reverse", flag).default(False)


class RecordsReading(KeyTable):
    """Options of reading time records."""

    format = _option("format", text).default(None)
    units = _option("unit", texts_by_name).default(None)
    variables = _option("variables", texts_by_name).default(None)
    columns = _option("columns", _header).default(None)
    reverse = _option("reverse", flag).default(False)
    sample_rate = _option("sample_rate_hz", _sample_rate).default(None)


class FileFields(FRFReading):
    """A file with an FRF, and properties that are not in the file; the base of tables that name one."""

    file = data_file(
        "path, relative to the campaign file: UFF58, CSV, NPZ, MAT, HDF5, `.frf`, DataPhysics ASCII"
    ).needed()
    entry = EntryTable.keys("the FRF to read, if the file holds several FRFs, responses or excitations").default(
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
    assembly = name_in("name of the assembly that was measured", "assemblies").needed()
    role: Literal["identify", "hold out"] = Choice(
        "whether it is used in the fit, or held out for comparison with predictions", ("identify", "hold out")
    ).default("identify")
    sensor = name_in("name of the sensor at the response coordinate; none for a laser", "sensors").default(None)
    conditions = MapOf(
        "numbers with units that describe the measurement: a force level, a temperature", CONDITION
    ).default(_EMPTY)
    attachments = ListOf(
        "names of masses and ground springs that were attached during this measurement only: a second sensor, a "
        "suspension",
        name_in("", "attachments"),
    ).default(_NONE)
    level = Value(
        "level of joints in micro-slip: amplitude over reference, or a force, which their `reference_force` divides",
        lambda written, _: parse_level(written),
        {"anyOf": PLAIN},
    ).default(None)


class _Response(_Measured):
    response = CoordinateTable.keys("coordinate of the measured motion").default(CoordinateTable())
    excitation = CoordinateTable.keys("coordinate of the load").default(CoordinateTable())
    bands = ListOf(
        'frequency bands to use, `[["300 Hz", "4 kHz"]]`; by default all usable lines', BAND, least=1
    ).default(None)
    floor = _FLOOR.default(None)
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

    kind: Literal["frf"] = word("frf").needed()
    force = Number(
        units.FORCE, "amplitude of a stepped sine; it determines the level of joints in micro-slip on each line"
    ).default(None)


class HammerTable(RecordsReading, _Response):
    """Force and response of hammer hits against time, from which the FRF is estimated."""

    kind: Literal["hammer records"] = word("hammer records").needed()
    file = one_or_list(
        "path, relative to the campaign file, with one or several hits, or a list of paths: UFF58, CSV, NPZ, MAT, HDF5",
        data_file(),
        "the name of a file, or a list of them",
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
    force_window: float | Literal["auto", "none"] = Value(
        'length of the force window after the contact begins, such as `"2 ms"`; `"auto"`, or `"none"` for the '
        "whole block",
        lambda written, _: parse_force_window(written),
    ).default("auto")


class FrequenciesTable(_Measured):
    """Natural frequencies, and damping ratios where these are known, here or in a CSV file."""

    kind: Literal["natural frequencies"] = word("natural frequencies").needed()
    frequencies = ListOf("natural frequencies, ascending", Number(units.FREQUENCY, ""), least=1).default(None)
    modes = ListOf(
        "numbers of the elastic modes, the lowest is 1; by default 1, 2, and so on", Count("", most=math.inf), least=1
    ).default(None)
    standard_deviation = deviations(
        'standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each'
    ).default(None)
    damping_ratios = ListOf(
        'damping ratios such as `"1.2 %"`, one for each frequency, or `"unknown"`; frequencies are then those of '
        "damped modes (their magnitudes), else of undamped ones",
        Value("", lambda written, _: parse_damping_ratio(text_of(written))),
        least=1,
    ).default(None)
    damping_deviation = one_or_list(
        'standard deviation of the damping ratios, `"5 %"` of them or a number such as 0.0005, one for all or one '
        "for each",
        Value("", lambda written, _: parse_damping_deviation(written), {"anyOf": PLAIN}),
        'a standard deviation such as "5 %" of the ratio, a number, or a list of them',
        (str, float),
    ).default(None)
    file = data_file(
        "CSV file instead, with columns `mode`, `frequency [Hz]` and, optionally, `standard_deviation [Hz]`, "
        "`damping_ratio [%]`, `damping_deviation [%]` (of the ratio); an empty cell is an unknown ratio"
    ).default(None)
    response = CoordinateTable.keys("coordinate of the sensor").default(CoordinateTable())


MEASUREMENTS = OneKind((FRFTable.keys(), HammerTable.keys(), FrequenciesTable.keys()))
MeasurementTable = FRFTable | HammerTable | FrequenciesTable


class _Possible(KeyTable):
    assembly = name_in(
        "name of the assembly to measure; one that was measured before is in the same clamping", "assemblies"
    ).needed()
    sensor = name_in("name of the sensor at the response coordinate; none for a laser", "sensors").default(None)
    response = CoordinateTable.keys("coordinate of the measured motion").default(CoordinateTable())
    conditions = MapOf("numbers with units that describe the measurement", CONDITION).default(_EMPTY)
    cost = Real("cost, in any unit that all candidates share", above=0.0).default(1.0)


class CandidateFRFTable(_Possible):
    """A frequency response function that could be measured."""

    kind: Literal["frf"] = word("frf").needed()
    excitation = CoordinateTable.keys("coordinate of the load").default(CoordinateTable())
    lower = Number(units.FREQUENCY, "lowest line; by default `step`").default(None)
    upper = Number(units.FREQUENCY, "highest line").needed()
    step = Number(units.FREQUENCY, "distance of the lines, whose noise is independent").needed()
    standard_deviation = deviation_share(
        'expected standard deviation of the FRF on every line, such as `"2 %"`'
    ).needed()
    floor = _FLOOR.default(None)


class CandidateFrequenciesTable(_Possible):
    """Natural frequencies that could be measured."""

    kind: Literal["natural frequencies"] = word("natural frequencies").needed()
    modes = ListOf("numbers of the elastic modes, the lowest is 1", Count("", most=math.inf), least=1).needed()
    standard_deviation = deviations(
        'expected standard deviation of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each'
    ).needed()


CANDIDATES = OneKind((CandidateFRFTable.keys(), CandidateFrequenciesTable.keys()))
CandidateTable = CandidateFRFTable | CandidateFrequenciesTable

# Unknowns and settings -----------------------------------------------------------------------------------------------


class PriorTable(KeyTable):
    """Prior knowledge of an unknown: a Gaussian on the scale of the fit."""

    value: str | float = plain("most likely value, a quantity of the parameter's kind").needed()
    spread: str | float = plain(
        'its standard deviation, `"30 %"` or a quantity of the parameter\'s kind, or `"factor 3"` where the '
        "logarithm is fitted"
    ).needed()


class UnknownTable(KeyTable):
    """A parameter to identify; all assemblies that have it share it, unless a law across assemblies is given."""

    lower = value_of_unknown("lower bound, a quantity of the parameter's kind").needed()
    upper = value_of_unknown("upper bound").needed()
    start = value_of_unknown("start value; by default the joint's value, else the middle of the bounds").default(None)
    scale: Literal["log", "linear"] | None = Choice(
        "whether the logarithm or the value is fitted; by default the logarithm where the lower bound is above zero",
        ("log", "linear"),
    ).default(None)
    prior = PriorTable.keys("prior; the measurements then need standard deviations").default(None)
    name = text("name in results; by default its address").default("")
    assemblies = ListOf("assemblies that have the unknown; by default all", name_in("", "assemblies")).default(None)
    measurements = ListOf("measurements that have the unknown; by default all", name_in("", "measurements")).default(
        None
    )
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
    relative = flag("with `moves`: v becomes v exp(n u)").default(False)
    power_of = text(
        "name of a condition, or an address; the parameter is a power of it across assemblies, or, with `moves`, "
        "n is multiplied by the logarithm of that condition over its reference"
    ).default(None)
    reference = condition(
        'value of that condition at which the parameter equals the unknown, such as `"135 N m"`, or, with '
        "`moves`, at which there is no change"
    ).default(None)
    exponent = ListOf("bounds of the exponent, by default `[-4, 4]`", Real(), least=2, most=2).default(None)
    free = flag("a value for each assembly instead of one for all").default(False)
    along = text(
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
    profiles = flag("whether `identify` also computes profile likelihoods of the joints").default(True)
    band_width = share('half width of the bands of the percentage objective, by default `"5 %"`').default(0.05)


class PredictionTable(KeyTable):
    """Predictions of assemblies that were not measured, and the level of intervals."""

    lower = Number(units.FREQUENCY, "lowest line; by default a tenth of the first natural frequency").default(None)
    upper = Number(
        units.FREQUENCY, "highest line and limit of the natural frequencies; by default the highest measured frequency"
    ).default(None)
    step = Number(units.FREQUENCY, "distance of the lines; by default a two-thousandth of the band").default(None)
    response = CoordinateTable.keys("coordinate of the motion").default(CoordinateTable())
    excitation = CoordinateTable.keys("coordinate of the load").default(CoordinateTable())
    level = Real("level of the intervals", above=0.0, below=1.0).default(0.95)
    force = Number(
        units.FORCE,
        "amplitude of a stepped sine, for FRFs with joints in micro-slip; by default the joints have their own level",
    ).default(None)


class SeriesTable(KeyTable):
    """Levels of repeated measurements; a table with `{level}` in its name is the template of a table for each level."""

    over = text('name of the condition, such as `"drawbar force"`').needed()
    levels = ListOf(
        'the levels, `["0 kN", "1 kN"]`; `{level}` is replaced by the level as it is written, `{value}` by its number',
        plain(),
        least=1,
    ).needed()
    hold_out = ListOf("levels whose measurements are held out, written as in `levels`", plain()).default(_NONE)


# Cuts and catalogues -------------------------------------------------------------------------------------------------


class TipTable(FileFields):
    """The receptance of the tool tip in one direction: one of an assembly, a measurement or a file."""

    file: str | None = data_file("path of a file with the FRF of the tip").default(None)  # type: ignore[assignment]
    assembly = name_in("name of an assembly whose tip is predicted", "assemblies").default(None)
    measurement = name_in("name of a measured FRF of the campaign", "measurements").default(None)
    bands = ListOf(
        'frequency bands of a file or a measurement in which limits are computed, `[["300 Hz", "4 kHz"]]`; by '
        "default all usable lines",
        BAND,
        least=1,
    ).default(None)


_TIP = TipTable.keys()


def _read_across(written: Any, place: Place) -> Any:
    """Return the tip across the feed: a table, or a word."""
    if written in ("as x", "rigid"):
        return written
    if not isinstance(written, dict):
        raise ValueError(f'is {shown(written)}, expected a table, "as x" or "rigid"')
    return _TIP.read(written, place)


class TurningKeys(KeyTable):
    """A turning cut: one tooth in continuous engagement."""

    angle = Number(units.DIRECTION, "angle between the force and the direction of the chip thickness").default(0.0)
    x = TipTable.keys("receptance of the tip in the direction of the chip thickness").needed()


class MillingKeys(KeyTable):
    """A milling cut."""

    radial_depth: tuple[float, bool] = Value(
        "radial depth (width) of cut: a share of the diameter, or a length, which needs `diameter`; 1 for a slot",
        lambda written, _: parse_radial_depth(written),
        {"anyOf": PLAIN, "examples": [0.5, "50 %", "6 mm"]},
    ).default((1.0, False))
    pitch = ListOf(
        "angle from each tooth to the one that follows it, for all teeth, their sum is a turn; by default equal. "
        "Unequal ones need semi-discretisation",
        Number(units.PITCH, ""),
        least=1,
    ).default(None)
    helix = one_or_list(
        "helix angle, one for all teeth, or a list with one for each; it needs `diameter`. Different ones need "
        "semi-discretisation",
        Number(units.HELIX, ""),
        'an angle such as "30 deg", or a list of them',
    ).default(None)
    rotation = Number(
        units.DIRECTION,
        "angle from the feed to the direction in which `x` was measured, positive to the left of the feed seen from "
        "the spindle; for tips that were measured along the axes of the machine",
    ).default(0.0)
    x = TipTable.keys("receptance of the tip in the direction of feed").needed()
    y: TipTable | Literal["as x", "rigid"] = Value(
        'receptance across it; `"as x"` the same, `"rigid"` none',
        _read_across,
        {"anyOf": [_TIP.schema(), {**TEXT, "enum": ["as x", "rigid"]}]},
    ).default("as x")


CUTS = OneKind(
    (
        element_keys(Milling, kind="milling", more=MillingKeys, without=("immersion", "pitch_deg", "helix_deg")),
        element_keys(Turning, kind="turning", more=TurningKeys, without=("angle_deg",)),
    )
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

    overhang = deviation_of(units.LENGTH, "standard deviation of the overhang").default(None)
    diameter = deviation_of(units.LENGTH, "standard deviation of the diameter of the shank").default(None)
    effective_diameter = deviation_of(
        units.LENGTH, "standard deviation of the effective diameter of the flutes"
    ).default(None)


class CatalogueTable(KeyTable):
    """Tools and holders in CSV files, and their machine."""

    tools = data_file("CSV file with a tool in each row; not needed if the command names one").default(None)
    holders = data_file(
        "CSV file with a segment of a holder in each row; parts of this file are holders as well"
    ).default(None)
    machine = ListOf(
        "names of joints and parts behind the holder, from its joint on; empty where `spindle` begins at the holder",
        name_in_machine(),
    ).needed()
    attachments = ListOf("names of masses and ground springs on these parts", name_in("", "attachments")).default(_NONE)
    spindle = name_in("name of the measured spindle behind the machine", "spindles").default(None)
    joint = name_in("name of the joint between tool and holder, for rows that name none", "joints").default(None)
    tolerance = CatalogueSpread.keys("standard deviations of the dimensions of tools").default(CatalogueSpread())


# The file ------------------------------------------------------------------------------------------------------------


def _read_version(written: Any, _: Place) -> int:
    """Return the version of the format, 1."""
    if written != 1 or isinstance(written, (bool, float)):
        raise ValueError(f"is {shown(written)}, expected 1")
    return 1


_named = partial(NamedTables, check_key=check_name)
_named_by_word = partial(NamedTables, check_key=check_word, pattern=WORD)


class CampaignTable(KeyTable):
    """A measuring campaign: structures, measurements and unknowns."""

    format = Value("version of this format", _read_version, {"const": 1}).default(1)
    title = text("free text").default("")
    description = text("free text: the origin of the data, and whether they are simulated").default("")
    materials: Mapping[str, ElementTable] = _named(
        "materials by name; those of `receptance materials` need no table", MATERIAL
    ).default(_EMPTY)
    parts: Mapping[str, PartTable] = _named_by_word("parts by name", PartTable.keys()).needed()
    modal_parts: Mapping[str, ElementTable] = _named_by_word(
        "parts known by their modes, such as a spindle, by name", MODAL_PART
    ).default(_EMPTY)
    spindles: Mapping[str, SpindleTable] = _named_by_word(
        "spindles measured with blanks, by name", SpindleTable.keys()
    ).default(_EMPTY)
    joints: Mapping[str, ElementTable] = _named_by_word("joints by name", JOINTS).default(_EMPTY)
    sensors: Mapping[str, ElementTable] = _named_by_word("sensors by name", SENSOR).default(_EMPTY)
    attachments: Mapping[str, ElementTable] = _named_by_word("masses and ground springs by name", ATTACHMENTS).default(
        _EMPTY
    )
    assemblies: Mapping[str, AssemblyTable] = _named("configurations by name", AssemblyTable.keys()).needed()
    measurements: Mapping[str, MeasurementTable] = _named("measurements by name", MEASUREMENTS).default(_EMPTY)
    candidates: Mapping[str, CandidateTable] = _named(
        "candidates for the next measurement, by name", CANDIDATES
    ).default(_EMPTY)
    cuts: Mapping[str, ElementTable] = _named("cuts whose stable depth is computed, by name", CUTS).default(_EMPTY)
    unknowns: Mapping[str, UnknownTable] = NamedTables(
        'parameters to identify, by address: `"joint.k_theta"`', UnknownTable.keys()
    ).default(_EMPTY)
    series = SeriesTable.keys("levels of a condition at which the same measurements were repeated").default(None)
    settings = SettingsTable.keys("settings of the fit").default(SettingsTable())
    prediction = PredictionTable.keys("settings of predictions").default(PredictionTable())
    stability = StabilityTable.keys("speeds and probability of stable depths").default(StabilityTable())
    catalogue = CatalogueTable.keys("tools and holders in CSV files, and their machine").default(None)
