"""Rigid holders on radial and axial springs (Xu et al. 2012, eqs. 1 to 13, corrected)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.model.beams import Part


@dataclass(frozen=True, eq=False)
class RigidModes:
    """Modes of a rigid holder, in ascending frequency.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` natural frequencies |lambda| / (2 pi) in Hz.
    damping_ratio : ndarray
        `(n,)` -Re(lambda) / |lambda|.
    shapes : ndarray
        `(2, n)` displacement of the centre of gravity in m and rotation in rad of each mode, complex if damping couples
        the modes.
    """

    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    shapes: NDArray[np.complex128]

    def ratio(self, first: float, second: float) -> NDArray[np.complex128]:
        """Ratio `(n,)` of the motions at two points, given as z in m."""
        values = self.shapes[0] + np.array([[first], [second]]) * self.shapes[1]
        return np.asarray(values[0] / values[1])


@dataclass(frozen=True, kw_only=True)
class RadialJoint:
    """A rigid holder on radial springs and dashpots at the big and the small end of its taper.

    z is measured from the centre of gravity towards the tip: L1 at the big end and -L2 at the small end in the notation
    of the paper. With v = (1, z), each spring adds K v v^T, so

    K = [[K1 + K2, K1 z1 + K2 z2], [K1 z1 + K2 z2, K1 z1^2 + K2 z2^2]], and C has the same form.

    The paper prints K1 L1 - K2 L2 below the diagonal only and K1 L1^2 - K2 L2^2 on it (eqs. 1, 3, 4): see
    `printed_matrices`.

    Parameters
    ----------
    body : Body
        The holder.
    z1, z2 : float
        Positions of the springs in m.
    k_x1, k_x2 : float
        Stiffnesses K_X1 and K_X2 in N/m.
    c_x1, c_x2 : float, optional
        Dampings C_X1 and C_X2 in N s/m.

    Raises
    ------
    ValueError, TypeError
        Springs at the same position, or a stiffness that is not positive.

    Examples
    --------
    >>> from receptance.taper import Body, RadialJoint
    >>> body = Body(mass=4.5, inertia=0.01)
    >>> joint = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=5e8, c_x1=900.0, c_x2=500.0)
    >>> joint.modes().frequency_hz.round(1)
    array([2523.7, 3345.6])
    """

    body: Body
    z1: float
    z2: float
    k_x1: float
    k_x2: float
    c_x1: float = 0.0
    c_x2: float = 0.0

    def __post_init__(self) -> None:
        for quantity in ("z1", "z2", "c_x1", "c_x2"):
            unit = "m" if quantity[0] == "z" else "N s/m"
            object.__setattr__(
                self, quantity, _checks.number("RadialJoint", quantity, getattr(self, quantity), unit=unit)
            )
        for quantity in ("k_x1", "k_x2"):
            value = _checks.positive("RadialJoint", quantity, getattr(self, quantity), unit="N/m")
            object.__setattr__(self, quantity, value)
        if self.z1 == self.z2:
            raise ValueError(f"RadialJoint: z1 and z2 are both {self.z1:g} m, expected two positions")

    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return mass, damping and stiffness over (X_c, theta): eqs. 2 to 4, corrected."""
        mass = np.diag([self.body.mass, self.body.inertia])
        return mass, self._spring_matrix(self.c_x1, self.c_x2), self._spring_matrix(self.k_x1, self.k_x2)

    def _spring_matrix(self, first: float, second: float) -> NDArray[np.float64]:
        coupling = first * self.z1 + second * self.z2
        return np.array([[first + second, coupling], [coupling, first * self.z1**2 + second * self.z2**2]])

    def printed_matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return mass, damping and stiffness as eqs. 2 to 4 are printed, for comparison.

        The matrices violate reciprocity because they are not symmetric, and the lower right entry can be zero or
        negative. The library does not use them.
        """
        l1, l2 = self.z1, -self.z2
        damping, stiffness = (
            np.array([[a + b, a * l1 + b * l2], [a * l1 - b * l2, a * l1**2 - b * l2**2]])
            for a, b in ((self.c_x1, self.c_x2), (self.k_x1, self.k_x2))
        )
        return self.matrices()[0], damping, stiffness

    def state_matrix(self) -> NDArray[np.float64]:
        """Return A `(4, 4)` of u' = A u with u = (X_c, theta, X_c', theta'): eq. 11 with the corrected matrices."""
        mass, damping, stiffness = self.matrices()
        inverse = np.linalg.inv(mass)
        return np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])

    def modes(self) -> RigidModes:
        """Return both damped modes, from the state matrix.

        Raises
        ------
        ValueError
            A mode that does not oscillate.
        """
        values, vectors = np.linalg.eig(self.state_matrix())
        upper = np.flatnonzero(values.imag > 0.0)
        if upper.size != 2:
            raise ValueError(f"{self!r}: a mode is overdamped, expected two oscillating modes")
        order = upper[np.argsort(np.abs(values[upper]))]
        poles = values[order]
        return RigidModes(np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), vectors[:2, order])

    def undamped_modes(self) -> RigidModes:
        """Return both undamped modes; shapes are real and mass-normalised."""
        mass, _, stiffness = self.matrices()
        root = np.sqrt(np.diag(mass))
        squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
        # The smaller square would be a difference of large numbers; the determinant is a product.
        determinant = self.k_x1 * self.k_x2 * (self.z1 - self.z2) ** 2 / (self.body.mass * self.body.inertia)
        squares[0] = determinant / squares[1]
        shapes = (vectors / root[:, None]).astype(np.complex128)
        return RigidModes(np.sqrt(squares) / (2.0 * np.pi), np.zeros(2), shapes)


@dataclass(frozen=True, kw_only=True)
class AxialJoint:
    """A rigid holder on one axial spring and dashpot (eqs. 12 and 13).

    Parameters
    ----------
    body : Body
        The holder, of which only the mass matters.
    k_z1 : float
        Stiffness K_Z1 in N/m.
    c_z1 : float, optional
        Damping C_Z1 in N s/m.

    Examples
    --------
    >>> from receptance.taper import AxialJoint, Body
    >>> AxialJoint(body=Body(mass=4.5, inertia=0.01), k_z1=4.9e9, c_z1=1500.0).modes().frequency_hz.round(1)
    array([5251.8])
    """

    body: Body
    k_z1: float
    c_z1: float = 0.0

    def __post_init__(self) -> None:
        stiffness = _checks.positive("AxialJoint", "k_z1", self.k_z1, unit="N/m")
        damping = _checks.number("AxialJoint", "c_z1", self.c_z1, unit="N s/m")
        _checks.set_fields(self, {"k_z1": stiffness, "c_z1": damping})

    def modes(self) -> RigidModes:
        """Return the axial mode."""
        w = np.sqrt(self.k_z1 / self.body.mass)
        ratio = self.c_z1 / (2.0 * np.sqrt(self.k_z1 * self.body.mass))
        return RigidModes(np.array([w / (2.0 * np.pi)]), np.array([ratio]), np.ones((1, 1), dtype=np.complex128))


_RIGID = 1e9
"""Factor of Young's modulus for rigid parts; assemblies then agree with a rigid body to nine digits."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body of revolution.

    Parameters
    ----------
    mass : float
        Mass in kg.
    inertia : float
        Moment of inertia in kg m2 about a transverse axis through the centre of gravity.
    centre : float, optional
        Distance of the centre of gravity in m from the tip-side end of the part.

    Raises
    ------
    ValueError, TypeError
        A mass or an inertia that is not positive.

    Examples
    --------
    >>> from receptance.taper import Body
    >>> Body(mass=4.5, inertia=0.01, centre=0.5).position(0.25)
    0.25
    """

    mass: float
    inertia: float
    centre: float = 0.0

    def __post_init__(self) -> None:
        mass = _checks.positive("Body", "mass", self.mass, unit="kg")
        inertia = _checks.positive("Body", "inertia", self.inertia, unit="kg m2")
        centre = _checks.number("Body", "centre", self.centre, unit="m")
        _checks.set_fields(self, {"mass": mass, "inertia": inertia, "centre": centre})

    def position(self, x: float) -> float:
        """Distance z in m from the centre of gravity towards the tip of a point x m from the tip-side end."""
        return self.centre - x


def as_rigid(part: Part) -> Part:
    """Return a part of the same mass that is rigid to nine digits.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.taper import as_rigid
    >>> rod = as_rigid(Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="rod"))
    >>> rod.segments[0].material.youngs_modulus / STEEL.youngs_modulus
    1000000000.0
    """
    stiff = [
        replace(
            segment,
            material=replace(segment.material, youngs_modulus=_RIGID * segment.material.youngs_modulus),
            core=segment.core and replace(segment.core, youngs_modulus=_RIGID * segment.core.youngs_modulus),
        )
        for segment in part.segments
    ]
    return Part(stiff, name=part.name)


def body_of(part: Part) -> Body:
    """Return mass, centre of gravity and moment of inertia of a rigid part.

    A segment of mass m, length L and radius of gyration r of its section adds m (L^2 / 12 + r^2 + e^2), where e is its
    distance from the centre of gravity. Cores are included.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.taper import body_of
    >>> rod = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)])
    >>> body_of(rod).centre
    0.1
    """
    masses, middles, squared_radii = [], [], []
    start = 0.0
    for segment in part.segments:
        core = segment.core.density if segment.core else 0.0
        outer, inner = segment.outer_diameter**2, segment.inner_diameter**2
        ring = segment.material.density
        # The square of the radius of gyration: second moments d^4 / 64 over areas d^2 / 4.
        gyration = (ring * (outer**2 - inner**2) + core * inner**2) / (ring * (outer - inner) + core * inner) / 16.0
        masses.append(segment.mass)
        middles.append(start + 0.5 * segment.length)
        squared_radii.append(segment.length**2 / 12.0 + gyration)
        start += segment.length
    mass = sum(masses)
    centre = sum(m * x for m, x in zip(masses, middles, strict=True)) / mass
    inertia = sum(m * (r + (x - centre) ** 2) for m, x, r in zip(masses, middles, squared_radii, strict=True))
    return Body(mass=mass, inertia=inertia, centre=centre)
