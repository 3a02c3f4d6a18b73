"""What a campaign file may hold: joints at a point, along an insertion, through a collet, and in micro-slip."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from receptance import units
from receptance.campaign.models import MassSpread, SpringFields, SpringSpread, Table
from receptance.campaign.quantities import Amount, Deviation, Spread

__all__ = [
    "ColletJointTable",
    "ColletSpringTable",
    "JointTable",
    "MicroslipJointTable",
    "PointJointTable",
    "SectionTable",
    "SpreadJointTable",
]

_Length = Annotated[float, Amount(units.LENGTH)]
_Bore = Annotated[float, Amount(units.LENGTH_OR_ZERO)]
_Stiffness = Annotated[float, Amount(units.STIFFNESS)]
_Rotational = Annotated[float, Amount(units.ROTATIONAL_STIFFNESS)]
_Damping = Annotated[float, Amount(units.DAMPING)]
_RotationalDamping = Annotated[float, Amount(units.ROTATIONAL_DAMPING)]
_Loss = Annotated[float, Amount(units.LOSS_FACTOR)]
_Mass = Annotated[float, Amount(units.MASS)]
_Inertia = Annotated[float, Amount(units.INERTIA)]
_Share = Annotated[float, Amount(units.SHARE)]
_Exponent = Annotated[float, Amount(units.EXPONENT)]
_Level = Annotated[float, Amount(units.LEVEL)]
_Travel = Annotated[float, Amount(units.AMPLITUDE)]
_Turn = Annotated[float, Amount(units.ANGLE)]
_Force = Annotated[float, Amount(units.FORCE)]
_LengthSpread = Annotated[Deviation | None, Spread(units.LENGTH)]


class PointJointTable(SpringFields):
    """A joint at a point between two parts. What is among the unknowns need not be given."""

    kind: Literal["point"] = "point"
    """what kind of joint it is"""
    tolerance: SpringSpread = SpringSpread()
    """standard deviations, by the same keys"""


class SectionSpread(Table):
    """Standard deviations of the diameters of a section."""

    outer_diameter: _LengthSpread = None
    """of the outer diameter"""
    inner_diameter: _LengthSpread = None
    """of the bore"""


class SectionTable(Table):
    """A circular section, solid, hollow, or hollow and filled."""

    outer_diameter: _Length
    """outer diameter"""
    inner_diameter: _Bore = 0.0
    """bore; none for a solid section"""
    material: str
    """name of a material"""
    core: str | None = None
    """name of the material that fills the bore and moves with it"""
    shear: Literal["cowper", "hutchinson"] = "cowper"
    """whose shear coefficient"""
    tolerance: SectionSpread = SectionSpread()
    """standard deviations of the diameters, by the same keys"""


class SpreadJointSpread(Table):
    """Standard deviations of the numbers of a spread joint that are not identified."""

    length: _LengthSpread = None
    """of the length"""
    k_y: Annotated[Deviation | None, Spread(units.STIFFNESS)] = None
    """of k_y"""
    k_theta: Annotated[Deviation | None, Spread(units.ROTATIONAL_STIFFNESS)] = None
    """of k_theta"""
    c_y: Annotated[Deviation | None, Spread(units.DAMPING)] = None
    """of c_y"""
    c_theta: Annotated[Deviation | None, Spread(units.ROTATIONAL_DAMPING)] = None
    """of c_theta"""
    loss_factor: Annotated[Deviation | None, Spread(units.LOSS_FACTOR)] = None
    """of the loss factor"""


class SpreadJointTable(Table):
    """A joint along the insertion: shank and bore side by side. Neither part of the chain contains the insertion."""

    kind: Literal["spread"]
    """`"spread"`"""
    length: _Length
    """length of the insertion"""
    shank: SectionTable
    """section of the tool within it"""
    sleeve: SectionTable
    """section of the holder within it; its bore is where the shank lies"""
    k_y: _Stiffness = 0.0
    """translational stiffness of the whole insertion"""
    k_theta: _Rotational = 0.0
    """its stiffness against a relative rotation at each place"""
    c_y: _Damping = 0.0
    """translational viscous damping"""
    c_theta: _RotationalDamping = 0.0
    """rotational viscous damping"""
    loss_factor: _Loss = 0.0
    """hysteretic loss factor of both stiffnesses"""
    points: Annotated[int, Field(ge=1, le=1000)] | None = None
    """number of springs instead of a layer"""
    tolerance: SpreadJointSpread = SpreadJointSpread()
    """standard deviations, by the same keys"""


class ColletSpringTable(SpringFields):
    """One of the two springs of a collet."""

    tolerance: SpringSpread = SpringSpread()
    """standard deviations, by the same keys"""


class ColletJointTable(Table):
    """A collet: two springs in series with its mass between them. Unknowns are `"joint.inner.k_y"` and the like."""

    kind: Literal["collet"]
    """`"collet"`"""
    inner: ColletSpringTable = ColletSpringTable()
    """spring between the part before it (the tool) and the collet"""
    outer: ColletSpringTable = ColletSpringTable()
    """spring between the collet and the part behind it (the holder)"""
    mass: _Mass = 0.0
    """mass of the collet"""
    inertia: _Inertia = 0.0
    """moment of inertia about its own centre, in the plane of bending"""
    tolerance: MassSpread = MassSpread()
    """standard deviations of mass and inertia, by the same keys"""


class MicroslipJointTable(SpringFields):
    """A joint whose stiffness falls and whose loss grows with the amplitude; its springs are those of small ones."""

    kind: Literal["micro-slip"]
    """`"micro-slip"`"""
    slip_y: _Share = 0.0
    """share of k_y that is lost at the level 1"""
    slip_theta: _Share = 0.0
    """share of k_theta that is lost at the level 1"""
    exponent: _Exponent = 1.0
    """how the lost share grows with the level"""
    level: _Level = 0.0
    """level where no measurement says another, amplitude over reference; 0 for small amplitudes"""
    reference_y: _Travel = 0.0
    """amplitude of the relative motion at the level 1; where measurements say a `force` of a stepped sine"""
    reference_theta: _Turn = 0.0
    """amplitude of the relative rotation at the level 1; likewise"""
    reference_force: _Force | None = None
    """force that is the level 1, where measurements say their `level` as a force"""
    tolerance: SpringSpread = SpringSpread()
    """standard deviations, by the same keys"""


JointTable = Annotated[
    Annotated[PointJointTable, Tag("point")]
    | Annotated[SpreadJointTable, Tag("spread")]
    | Annotated[ColletJointTable, Tag("collet")]
    | Annotated[MicroslipJointTable, Tag("micro-slip")],
    Discriminator("kind"),
]
