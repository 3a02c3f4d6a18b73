"""A collet between tool and holder: two joints in series with the collet's mass between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from receptance import units
from receptance.fields import Element, Field, Member, Number
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["ColletJoint"]


@dataclass(frozen=True, kw_only=True)
class ColletJoint(Element):
    """A collet: tool to collet and collet to holder are two springs in series, with the collet's mass between.

    Without mass the dynamic stiffnesses are in series, K = (K_inner^-1 + K_outer^-1)^-1, which for each of k_y and
    k_theta alone is k1 k2 / (k1 + k2) (Matthias et al. 2016, eq. 15). From one assembly only K can then be told; what
    changes one of the two springs and not the other (insertion, tightening torque) tells them apart.

    Parameters
    ----------
    {fields}

    Raises
    ------
    TypeError, ValueError
        Springs that are no `PointJoint`, a negative mass or inertia.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, ColletJoint, Part, PointJoint, Segment
    >>> tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    >>> collet = ColletJoint(
    ...     inner=PointJoint(k_y=9e8, k_theta=1.5e5), outer=PointJoint(k_y=2.1e9, k_theta=3e5), mass=0.15, name="collet"
    ... )
    >>> assembly = Assembly([tool, collet, holder])
    >>> assembly.natural_frequency_derivatives(8e3, ["collet.inner.k_y", "collet.mass"])[0].round(0)
    array([2560.])
    """

    inner: Annotated[
        PointJoint, Member(PointJoint, "spring between the part before it (the tool) and the collet", prefix="inner.")
    ]
    outer: Annotated[
        PointJoint, Member(PointJoint, "spring between the collet and the part behind it (the holder)", prefix="outer.")
    ]
    mass: Annotated[float, Number(units.MASS, "mass of the collet, a rigid body at a point")] = 0.0
    inertia: Annotated[float, Number(units.INERTIA, "moment of inertia about its centre in the plane of bending")] = 0.0
    name: Annotated[
        str, Field("first word of the addresses of its parameters, as in `joint.inner.k_y` or `joint.mass`")
    ] = field(default="", compare=False)

    joints_of: ClassVar[tuple[str, ...]] = ("inner", "outer")

    def __post_init__(self) -> None:
        self.check()
        for which in self.joints_of:
            # The address says which one it is; a name of its own would lead nowhere.
            object.__setattr__(self, which, replace(getattr(self, which), name=""))

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Dynamic stiffness of both springs in series, without what the mass does: `(n, 2, 2)` over (y, theta).

        Raises
        ------
        ValueError
            Unusable lines.
        """
        inner, outer = self.inner.stiffness(frequency_hz), self.outer.stiffness(frequency_hz)
        # K1 (K1 + K2)^-1 K2 needs neither of the two to be far from singular.
        result: NDArray[np.complex128] = inner @ np.linalg.solve(inner + outer, outer)
        return result
