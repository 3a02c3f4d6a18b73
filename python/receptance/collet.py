"""A collet between tool and holder: two joints in series with the collet's mass between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from receptance import _checks
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["ColletJoint"]


@dataclass(frozen=True, kw_only=True)
class ColletJoint:
    """A collet: tool to collet and collet to holder are two springs in series, with the collet's mass between.

    Without mass the dynamic stiffnesses are in series, K = (K_inner^-1 + K_outer^-1)^-1, which for each of k_y and
    k_theta alone is k1 k2 / (k1 + k2) (Matthias et al. 2016, eq. 15). From one assembly only K can then be told; what
    changes one of the two springs and not the other (insertion, tightening torque) tells them apart.

    Parameters
    ----------
    inner, outer : PointJoint
        Between the part before it in the chain (towards the tip: the tool) and the collet, and between the collet and
        the part behind it (the holder).
    mass : float
        Mass of the collet in kg; a rigid body at a point.
    inertia : float
        Its moment of inertia about its centre, in the plane of bending, in kg m2.
    name : str, optional
        First word of the addresses of its parameters, as in `joint.inner.k_y` or `joint.mass`.

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

    inner: PointJoint
    outer: PointJoint
    mass: float = 0.0
    inertia: float = 0.0
    name: str = field(default="", compare=False)

    columns_of: ClassVar[tuple[str, ...]] = ("mass", "inertia")
    joints_of: ClassVar[tuple[str, ...]] = ("inner", "outer")

    def __post_init__(self) -> None:
        owner = f"ColletJoint {self.name!r}" if self.name else "ColletJoint"
        for which in self.joints_of:
            joint = getattr(self, which)
            if not isinstance(joint, PointJoint):
                raise TypeError(f"{owner}: {which} is {joint!r}, expected a PointJoint")
            # The address says which one it is; a name of its own would lead nowhere.
            object.__setattr__(self, which, replace(joint, name=""))
        object.__setattr__(self, "mass", _checks.not_negative(owner, "mass", self.mass, unit="kg"))
        object.__setattr__(self, "inertia", _checks.not_negative(owner, "inertia", self.inertia, unit="kg m2"))

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
