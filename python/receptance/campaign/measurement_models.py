"""What a campaign file may hold: measurements, unknowns, settings, and the whole file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from receptance.campaign.candidate_models import CandidateTable
from receptance.campaign.catalogue_models import CatalogueTable
from receptance.campaign.cut_models import CutTable, StabilityTable
from receptance.campaign.file_models import Band, FileFields
from receptance.campaign.joint_models import JointTable
from receptance.campaign.models import (
    AssemblyTable,
    AttachmentTable,
    CoordinateTable,
    MaterialTable,
    ModalPartTable,
    Name,
    PartTable,
    SensorTable,
    Table,
    Word,
    Written,
)
from receptance.campaign.quantities import KINDS, Amount, OneOf
from receptance.campaign.series_models import SeriesTable

__all__ = [
    "CampaignTable",
    "FRFTable",
    "FrequenciesTable",
    "HammerTable",
    "MeasurementTable",
    "PredictionTable",
    "PriorTable",
    "SettingsTable",
    "UnknownTable",
]

Frequency = Annotated[float, Amount(KINDS["a frequency"])]
Force = Annotated[float, Amount(KINDS["a force"])]
Time = Annotated[float, Amount(KINDS["a time"])]
TimeOrZero = Annotated[float, Amount(KINDS["a time or zero"])]
Channel = Annotated[str | int, OneOf(str, int, what="the name of a channel in the file, or its number from 0")]
Rate = Annotated[float, Amount(KINDS["a rate of decay"])]


class _Measured(Table):
    assembly: str
    """name of the assembly that was measured"""
    role: Literal["identify", "hold out"] = "identify"
    """whether the fit sees it, or predictions are compared with it"""
    sensor: str | None = None
    """name of the sensor that sat at the response coordinate; none for a laser"""
    conditions: dict[str, Written] = Field(default={})
    """numbers with units that describe the measurement: a force level, a temperature"""
    attachments: list[str] = Field(default=[])
    """names of masses and ground springs that were on it only while it was measured: a second sensor, a suspension"""
    level: Annotated[str | float | None, OneOf(str, int, float, what='a number, or a force such as "50 N"')] = None
    """level of joints in micro-slip: amplitude over reference, or a force, which their `reference_force` divides"""


class _Response(_Measured):
    response: CoordinateTable = CoordinateTable()
    """where motion was seen"""
    excitation: CoordinateTable = CoordinateTable()
    """where the load acted"""
    bands: Annotated[list[Band], Field(min_length=1)] | None = None
    """bands of frequency that count, `[["300 Hz", "4 kHz"]]`; by default all usable lines"""
    floor: str | None = None
    """what no noise model covers, as a standard deviation added in squares on every line, such as `"0.3 %"`"""
    integrate: Annotated[int, Field(ge=-2, le=2)] = 0
    """how often the motion is integrated in addition, where a file holds another quantity than it says: 1 where it
    holds velocities and says displacements, -1 the other way round"""
    ends: Time | None = None
    """how long after the hit the record ended, where the structure still rang; `"observation.end"` as an unknown
    finds it exactly"""


class FRFTable(FileFields, _Response):
    """A frequency response function from a file."""

    kind: Literal["frf"]
    """`"frf"`"""
    force: Force | None = None
    """amplitude of a stepped sine: joints in micro-slip are then at the level that it brings about on each line"""


class HammerTable(_Response):
    """Force and response of hammer hits against time, from which the FRF is estimated."""

    kind: Literal["hammer records"]
    """`"hammer records"`"""
    file: Annotated[str | list[str], OneOf(str, list, what="the name of a file, or a list of them")]
    """file beside the campaign with one or several hits, or a list of files: UFF58, CSV, NPZ, MAT, HDF5"""
    format: str | None = None
    """format of the files where their ending does not tell"""
    force: Channel
    """name or number (from 0) of the hammer's channel"""
    motion: Channel
    """name or number (from 0) of the response's channel"""
    units: dict[str, str] = Field(default={})
    """units of channels, where the files do not say, `{ hammer = "N", tip = "m/s^2" }`"""
    variables: dict[str, str] = Field(default={})
    """which variables of NPZ, MAT or HDF5 files of another program are the time, `time_s`, and the channels"""
    columns: list[str] = Field(default=[])
    """header of tables that have none, `["time [s]", "hammer [N]", "tip [m/s^2]"]`"""
    sample_rate: Frequency | None = None
    """samples per second, where the files do not say"""
    full_scale_force: Force | None = None
    """largest force that the recorder can hold; without it only a flat top tells an overload"""
    trigger: Force | None = None
    """force that begins a hit; by default a tenth of the largest"""
    duration: Time | None = None
    """length of the block of a hit; by default as much as is free between hits"""
    pre_trigger: TimeOrZero | None = None
    """how long before the trigger a block begins, by default 10 ms, where a record holds several hits"""
    double_hits: Literal["drop", "keep"] = "drop"
    """what to do with double hits: leave them out, or use them with a force window that spans all contacts"""
    double_share: Annotated[float, Amount(KINDS["a share above zero"])] | None = None
    """smallest second contact that makes a hit a double one, over the first one's peak; by default 0.02"""
    separation: Time | None = None
    """contacts closer than this are one double hit, where a record holds several hits; by default 100 ms"""
    drop_hits: list[Annotated[int, Field(ge=1)]] = Field(default=[])
    """numbers of hits that are to be dropped by hand, counted from 1 as they are found"""
    estimator: Literal["H1", "H2", "Hv"] = "H1"
    """how the FRF is estimated"""
    force_drop_db: Annotated[float, Field(gt=0.0)] = 20.0
    """the usable band ends where the force's spectrum is this many dB below its largest value; with a larger number
    lines with less force count as well, and their larger scatter is in the variance"""
    decay_rate: Rate = 0.0
    """of the exponential window that is put on both channels"""
    response_decay_rate: Rate = 0.0
    """of an exponential window that the recorder has put on the response alone"""
    force_window: str = "auto"
    """how long the force counts after the contact begins, such as `"2 ms"`; `"auto"`, or `"none"`: the whole block"""


class FrequenciesTable(_Measured):
    """Natural frequencies, and damping ratios where these are known, here or in a CSV file."""

    kind: Literal["natural frequencies"]
    """`"natural frequencies"`"""
    frequencies: Annotated[list[Frequency], Field(min_length=1)] | None = None
    """natural frequencies, ascending"""
    modes: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] | None = None
    """which elastic modes they are, the lowest is 1; by default 1, 2, and so on"""
    standard_deviation: Annotated[
        str | list[str] | None, OneOf(str, list, what='a standard deviation such as "5 Hz", or a list of them')
    ] = None
    """of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each"""
    damping_ratios: Annotated[list[str], Field(min_length=1)] | None = None
    """damping ratios such as `"1.2 %"`, one for each frequency, or `"unknown"`; frequencies are then those of damped
    modes (their magnitudes), else of undamped ones"""
    damping_deviation: Annotated[
        str | float | list[str | float] | None,
        OneOf(str, float, list, what='a standard deviation such as "5 %" of the ratio, a number, or a list of them'),
    ] = None
    """standard deviation of the damping ratios, `"5 %"` of them or a number such as 0.0005, one for all or one for
    each"""
    file: str | None = None
    """CSV file instead, with columns `mode`, `frequency [Hz]` and, if you like, `standard_deviation [Hz]`,
    `damping_ratio [%]`, `damping_deviation [%]` (of the ratio); an empty cell is an unknown ratio"""
    response: CoordinateTable = CoordinateTable()
    """where the sensor sat"""


MeasurementTable = Annotated[
    Annotated[FRFTable, Tag("frf")]
    | Annotated[HammerTable, Tag("hammer records")]
    | Annotated[FrequenciesTable, Tag("natural frequencies")],
    Discriminator("kind"),
]


class PriorTable(Table):
    """What is known of an unknown before the measurement: a Gaussian on the scale of the fit."""

    value: Written
    """most likely value, a quantity of the parameter's kind"""
    spread: Written
    """its standard deviation, `"30 %"` or a quantity of the parameter's kind, or `"factor 3"` where the logarithm is
    fitted"""


class UnknownTable(Table):
    """A parameter to identify; shared by all assemblies that have it, unless it says how it goes across them."""

    lower: Written
    """lower bound, a quantity of the parameter's kind"""
    upper: Written
    """upper bound"""
    start: Written | None = None
    """where the first fit starts; by default the joint's value, else the middle of the bounds"""
    scale: Literal["log", "linear"] | None = None
    """whether the logarithm or the value is fitted; by default the logarithm where the lower bound is above zero"""
    prior: PriorTable | None = None
    """what is known of it beforehand; the measurements then need standard deviations"""
    name: str = ""
    """what results call it; by default its address"""
    assemblies: list[str] | None = None
    """only measurements of these assemblies have it; by default all"""
    multiple: float | None = None
    """the parameter is so many times the unknown, which then has plain numbers in SI units"""
    also: dict[str, float] = Field(default={})
    """further parameters by address, and how many times the unknown they are"""
    moves: dict[str, float] = Field(default={})
    """parameters by address that it moves, whatever else they are made of: v becomes v + n u, with the unknown u and
    the number n given here; it stands under a name of its own then, and has plain numbers in SI units"""
    relative: bool = False
    """with `moves`: v becomes v exp(n u)"""
    power_of: str | None = None
    """name of a condition, or an address: the parameter is a power of it across assemblies, or, with `moves`, n is
    multiplied by the logarithm of that condition over its reference"""
    reference: Written | None = None
    """value of that condition at which the parameter has the value that is identified, such as `"135 N m"`, or at
    which nothing moves"""
    exponent: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    """bounds of the exponent, by default `[-4, 4]`"""
    free: bool = False
    """a value for each assembly instead of one for all"""
    along: str | None = None
    """of a free one: name of a condition; assemblies that were not measured have what lies between their neighbours in
    it, by default that of the series"""
    individual: str | None = None
    """standard deviation of the part that every assembly has of its own, such as `"5 %"`"""
    follows: dict[str, float] = Field(default={})
    """further parameters by address that its powers and individual parts multiply too, raised to the number given"""


class SettingsTable(Table):
    """How the fit is done."""

    objective: Literal["log", "percentage"] = "log"
    """complex logarithm of measured over calculated, or percentage of the magnitude in bands around the peaks"""
    starts: Annotated[int, Field(ge=1)] = 8
    """number of starts"""
    seed: Annotated[int, Field(ge=0)] = 0
    """seed of the starts that are drawn"""
    max_evaluations: Annotated[int, Field(ge=1)] = 200
    """most evaluations from one start"""
    strategy: Literal["direct", "staged"] = "direct"
    """whether starts go straight into the fit, or are led to it by way of easier ones, from decades off"""
    profiles: bool = True
    """whether intervals are found by profile likelihoods too"""
    band_width: str = "5 %"
    """with the percentage objective, how far a band reaches to either side of its peak"""


class PredictionTable(Table):
    """What is predicted of assemblies that were not measured, and how sure intervals are."""

    lower: Frequency | None = None
    """lowest line; by default a tenth of the first natural frequency"""
    upper: Frequency | None = None
    """highest line and limit of the natural frequencies; by default the highest measured frequency"""
    step: Frequency | None = None
    """distance of the lines; by default a two-thousandth of the band"""
    response: CoordinateTable = CoordinateTable()
    """where motion is seen"""
    excitation: CoordinateTable = CoordinateTable()
    """where the load acts"""
    level: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """level of the intervals"""
    force: Force | None = None
    """amplitude of a stepped sine, for FRFs with joints in micro-slip; by default these are at their stated level"""


class CampaignTable(Table):
    """A measuring campaign: what was measured, on what, and what is to be found."""

    format: Literal[1] = 1
    """version of this format"""
    title: str = ""
    """for people"""
    description: str = ""
    """for people: where the data come from, whether they are simulated"""
    materials: dict[Name, MaterialTable]
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
    """measurements that could be taken next, by name"""
    cuts: dict[Name, CutTable] = Field(default={})
    """cuts whose stable depths are asked for, by name"""
    unknowns: dict[str, UnknownTable] = Field(default={})
    """what is to be identified, by address: `"joint.k_theta"`"""
    series: SeriesTable | None = None
    """levels at which the same was measured"""
    settings: SettingsTable = SettingsTable()
    """how the fit is done"""
    prediction: PredictionTable = PredictionTable()
    """what is predicted"""
    stability: StabilityTable = StabilityTable()
    """at which speeds cuts are looked at, and how sure a depth is to be"""
    catalogue: CatalogueTable | None = None
    """tools and holders in tables of their own, and the machine they are put into"""
