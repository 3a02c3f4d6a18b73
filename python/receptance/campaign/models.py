"""What a campaign file may hold: materials, parts, joints, what is attached, and assemblies."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, StringConstraints, Tag

from receptance.campaign.deviations import Deviation, Spread
from receptance.campaign.quantities import KINDS, Amount, OneOf

__all__ = [
    "AssemblyTable",
    "AttachmentTable",
    "CoordinateTable",
    "GroundTable",
    "MassSpread",
    "MassTable",
    "MaterialTable",
    "ModalPartTable",
    "Name",
    "PartTable",
    "SegmentTable",
    "SensorTable",
    "SpringFields",
    "SpringSpread",
    "Table",
    "Word",
    "Written",
]

Word = Annotated[str, StringConstraints(pattern=r"^[^\W\d]\w*$")]
"""A name that is the first word of addresses."""
Name = Annotated[str, StringConstraints(min_length=1)]
Written = Annotated[str | float, OneOf(str, int, float, what="text with a number and a unit, or a plain number")]
"""A quantity whose kind follows from the address or key that it stands at; read when that is known."""
WrittenSpread = Annotated[
    str | float | dict[str, str | float],
    OneOf(str, int, float, dict, what='a standard deviation such as "0.1 mm" or "2 %"'),
]


class Table(BaseModel):
    """A table of the file: unknown keys are mistakes, text is not taken for a number."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)


_Length = Annotated[float, Amount(KINDS["a length"])]
_Bore = Annotated[float, Amount(KINDS["a length or zero"])]
_Modulus = Annotated[float, Amount(KINDS["a modulus"])]
_Density = Annotated[float, Amount(KINDS["a density"])]
_Poisson = Annotated[float, Amount(KINDS["a Poisson's ratio"])]
_Loss = Annotated[float, Amount(KINDS["a loss factor"])]
_Mass = Annotated[float, Amount(KINDS["a mass"])]
_Inertia = Annotated[float, Amount(KINDS["a moment of inertia"])]
_Stiffness = Annotated[float, Amount(KINDS["a stiffness"])]
_Rotational = Annotated[float, Amount(KINDS["a rotational stiffness"])]
_Coupling = Annotated[float, Amount(KINDS["a coupling stiffness"])]
_Damping = Annotated[float, Amount(KINDS["a damping"])]
_RotationalDamping = Annotated[float, Amount(KINDS["a rotational damping"])]
_CouplingDamping = Annotated[float, Amount(KINDS["a coupling damping"])]

_LengthSpread = Annotated[Deviation | None, Spread(KINDS["a length"])]
_MassSpread = Annotated[Deviation | None, Spread(KINDS["a mass"])]
_InertiaSpread = Annotated[Deviation | None, Spread(KINDS["a moment of inertia"])]


class MaterialSpread(Table):
    """Standard deviations of a material; one error for everything that is made of it."""

    youngs_modulus: Annotated[Deviation | None, Spread(KINDS["a modulus"])] = None
    """of Young's modulus"""
    density: Annotated[Deviation | None, Spread(KINDS["a density"])] = None
    """of the density"""
    poisson_ratio: Annotated[Deviation | None, Spread(KINDS["a Poisson's ratio"])] = None
    """of Poisson's ratio"""
    loss_factor: Annotated[Deviation | None, Spread(KINDS["a loss factor"])] = None
    """of the loss factor"""


class MaterialTable(Table):
    """A linear isotropic material."""

    youngs_modulus: _Modulus
    """Young's modulus"""
    density: _Density
    """mass density"""
    poisson_ratio: _Poisson
    """Poisson's ratio, more than -1 and at most 0.5"""
    loss_factor: _Loss = 0.0
    """hysteretic loss factor of both moduli"""
    tolerance: MaterialSpread = MaterialSpread()
    """standard deviations of what stands above, by the same keys"""


class SegmentSpread(Table):
    """Standard deviations of the dimensions of a segment; one error wherever the part is used."""

    length: _LengthSpread = None
    """of the length; where an assembly sets another length, an error of its own of that size"""
    outer_diameter: _LengthSpread = None
    """of the outer diameter"""
    inner_diameter: _LengthSpread = None
    """of the bore"""


class SegmentTable(Table):
    """A uniform circular piece of a part, solid, hollow, or hollow and filled."""

    length: _Length
    """length"""
    outer_diameter: _Length
    """outer diameter"""
    inner_diameter: _Bore = 0.0
    """bore; none for a solid segment"""
    material: str
    """name of a material"""
    core: str | None = None
    """name of the material that fills the bore and moves with it, such as an inserted shank"""
    shear: Literal["cowper", "hutchinson"] = "cowper"
    """whose shear coefficient"""
    tolerance: SegmentSpread = SegmentSpread()
    """standard deviations of the dimensions, by the same keys"""


class PartTable(Table):
    """A tool, a holder, a blank: segments in a row, rigidly connected, from its tip-side end on."""

    segments: Annotated[list[SegmentTable], Field(min_length=1)]
    """one or more, `[[parts.NAME.segments]]`, in order from the tip-side end"""
    rigid: bool = False
    """whether nothing of it yields: only its mass counts"""


class ModeTable(Table):
    """A mode of a modal part, as seen at the plane where it joins the part before it."""

    frequency_hz: Annotated[float | None, Amount(KINDS["a frequency or zero"])] = None
    """undamped natural frequency with the plane free; zero for a rigid-body mode; not needed with `identify`"""
    damping_ratio: Annotated[float, Amount(KINDS["a damping ratio"])] = 0.03
    """share of critical damping"""
    y: Annotated[float, Amount(KINDS["a mode shape"])] = 0.0
    """mass-normalised mode shape at the plane; one that is unknown and not given starts in the middle of its bounds"""
    theta: Annotated[float, Amount(KINDS["a slope of a mode shape"])] = 0.0
    """its rotation, likewise"""
    y_imaginary: Annotated[float, Amount(KINDS["a mode shape"])] = 0.0
    """imaginary part of the shape, where dampers couple the modes"""
    theta_imaginary: Annotated[float, Amount(KINDS["a slope of a mode shape"])] = 0.0
    """imaginary part of its rotation"""


class ModalPartTable(Table):
    """A part known by its modes, a spindle: the last name of a chain. Its numbers may be unknowns."""

    modes: Annotated[list[ModeTable], Field(min_length=1)]
    """one or more, `[[modal_parts.NAME.modes]]`"""
    identify: bool = False
    """whether all numbers with real shapes are unknowns, with bounds and starts from FRFs where `unknowns` has none"""
    residual_y: Annotated[float, Amount(KINDS["a receptance"])] = 0.0
    """what modes above the band add to y over force"""
    residual_theta: Annotated[float, Amount(KINDS["a rotational receptance"])] = 0.0
    """to theta over moment"""
    residual_ytheta: Annotated[float, Amount(KINDS["a coupling receptance"])] = 0.0
    """to y over moment"""


class SpringFields(Table):
    """A spring and dashpot; the base of joints and ground springs."""

    k_y: _Stiffness = 0.0
    """translational stiffness"""
    k_theta: _Rotational = 0.0
    """rotational stiffness"""
    k_ytheta: _Coupling = 0.0
    """coupling stiffness"""
    c_y: _Damping = 0.0
    """translational viscous damping"""
    c_theta: _RotationalDamping = 0.0
    """rotational viscous damping"""
    c_ytheta: _CouplingDamping = 0.0
    """coupling damping"""
    loss_factor: _Loss = 0.0
    """hysteretic loss factor of the three stiffnesses"""


class SpringSpread(Table):
    """Standard deviations of the numbers of a joint or spring that are not identified."""

    k_y: Annotated[Deviation | None, Spread(KINDS["a stiffness"])] = None
    """of k_y"""
    k_theta: Annotated[Deviation | None, Spread(KINDS["a rotational stiffness"])] = None
    """of k_theta"""
    k_ytheta: Annotated[Deviation | None, Spread(KINDS["a coupling stiffness"])] = None
    """of k_ytheta"""
    c_y: Annotated[Deviation | None, Spread(KINDS["a damping"])] = None
    """of c_y"""
    c_theta: Annotated[Deviation | None, Spread(KINDS["a rotational damping"])] = None
    """of c_theta"""
    c_ytheta: Annotated[Deviation | None, Spread(KINDS["a coupling damping"])] = None
    """of c_ytheta"""
    loss_factor: Annotated[Deviation | None, Spread(KINDS["a loss factor"])] = None
    """of the loss factor"""


class MassSpread(Table):
    """Standard deviations of a mass."""

    mass: _MassSpread = None
    """of the mass"""
    inertia: _InertiaSpread = None
    """of the moment of inertia"""


class ResonatorSpread(Table):
    """Standard deviations of a resonator."""

    mass: _MassSpread = None
    """of the mass"""
    k_y: Annotated[Deviation | None, Spread(KINDS["a stiffness"])] = None
    """of k_y"""
    c_y: Annotated[Deviation | None, Spread(KINDS["a damping"])] = None
    """of c_y"""


class SensorTable(Table):
    """A sensor that weighs something: where a measurement names it, its mass sits at the response coordinate."""

    mass: _Mass
    """mass"""
    inertia: _Inertia = 0.0
    """moment of inertia about its own centre, in the plane of bending"""
    tolerance: MassSpread = MassSpread()
    """standard deviations, by the same keys"""


Position = Annotated[str, StringConstraints(min_length=1)]


class _Placed(Table):
    part: str = ""
    """name of the part that carries it; by default the first one of the chain"""
    position: Position = "0 mm"
    """distance from the part's tip-side end, or `"end"` for its far end"""


class MassTable(_Placed):
    """A rigid mass on a part."""

    kind: Literal["mass"]
    """`"mass"`"""
    mass: _Mass
    """mass"""
    inertia: _Inertia = 0.0
    """moment of inertia about its own centre, in the plane of bending"""
    tolerance: MassSpread = MassSpread()
    """standard deviations, by the same keys"""


class GroundTable(_Placed, SpringFields):
    """A spring and dashpot from a part to ground: a suspension, a fixture."""

    kind: Literal["ground"]
    """`"ground"`"""
    length: _Bore = 0.0
    """length over which it is shared out, from the position on; 0 for a spring at a point"""
    points: Annotated[int, Field(ge=1, le=1000)] = 8
    """at how many points, each in the middle of an equal part of the length"""
    weights: list[Annotated[float, OneOf(int, float, what="a number"), Field(ge=0.0)]] = Field(default=[])
    """what the points carry, in proportion, from the tip on; by default all the same"""
    tolerance: SpringSpread = SpringSpread()
    """standard deviations, by the same keys"""


class ResonatorTable(_Placed):
    """A mass on a spring and a dashpot: a mode of a structure that is not modelled, or an absorber."""

    kind: Literal["resonator"]
    """`"resonator"`"""
    mass: _Mass
    """mass"""
    k_y: _Stiffness
    """stiffness; above zero"""
    c_y: _Damping = 0.0
    """viscous damping"""
    tolerance: ResonatorSpread = ResonatorSpread()
    """standard deviations, by the same keys"""


AttachmentTable = Annotated[
    Annotated[MassTable, Tag("mass")]
    | Annotated[GroundTable, Tag("ground")]
    | Annotated[ResonatorTable, Tag("resonator")],
    Discriminator("kind"),
]


class CoordinateTable(Table):
    """A place on a part, a direction and a sign."""

    part: str = ""
    """name of the part; by default the first one of the chain"""
    position: Position = "0 mm"
    """distance from the part's tip-side end, or `"end"` for its far end"""
    direction: Literal["+y", "-y", "+theta", "-theta"] = "+y"
    """translation y or rotation theta, and the sign in which the channel counts it"""


class AssemblyTable(Table):
    """A configuration: parts and joints in a row from the tip, and what is set differently in it."""

    chain: Annotated[list[str], Field(min_length=1)]
    """names of parts and joints from the tip on; begins with a part and ends with a part or a modal part"""
    attachments: list[str] = Field(default=[])
    """names of masses and ground springs that are on it"""
    set: dict[str, Written] = Field(default={})
    """values of this configuration by address, `{ "tool.segment[0].length" = "60 mm" }`"""
    tolerance: dict[str, WrittenSpread] = Field(default={})
    """standard deviations of this configuration by address; one error for this configuration alone"""
    conditions: dict[str, Written] = Field(default={})
    """numbers with units that describe the configuration: torque, insertion, drawbar force"""
    motion: Literal["bending", "axial"] = "bending"
    """across, or along the axis: then y, k_y and c_y are along it, and nothing turns"""
