"""The rigid holder on two radial springs and one axial one (Xu et al. 2012, eqs. 1 to 13, corrected)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.taper.body import Body

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["AxialJoint", "RadialJoint", "RigidModes"]


@dataclass(frozen=True, eq=False)
class RigidModes:
    """Modes of a rigid holder, in ascending frequency.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` natural frequencies |lambda| / 2 pi.
    damping_ratio : ndarray
        `(n,)` -Re(lambda) / |lambda|.
    shapes : ndarray
        `(2, n)` displacement of the centre of gravity in m and rotation in rad of each mode, complex where damping
        couples the modes.
    """

    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    shapes: NDArray[np.complex128]

    def ratio(self, first: float, second: float) -> NDArray[np.complex128]:
        """`(n,)` motion at one place over that at another, both as z in m."""
        values = self.shapes[0] + np.array([[first], [second]]) * self.shapes[1]
        return np.asarray(values[0] / values[1])


@dataclass(frozen=True, kw_only=True)
class RadialJoint:
    """A rigid holder held by springs and dashpots at the big and the small end of its taper, moving across.

    z is measured from the centre of gravity towards the tip: L1 at the big end and -L2 at the small end in the letters
    of the paper, and of either sign in general. With v = (1, z), each spring adds K v v^T, so

    K = [[K1 + K2, K1 z1 + K2 z2], [K1 z1 + K2 z2, K1 z1^2 + K2 z2^2]], and C alike.

    The paper prints K1 L1 - K2 L2 below the diagonal only and K1 L1^2 - K2 L2^2 on it (eqs. 1, 3, 4): see
    `printed_matrices`.

    Parameters
    ----------
    body : Body
        The holder.
    z1, z2 : float
        Where the springs act, in m.
    k_x1, k_x2 : float
        Stiffnesses K_X1 and K_X2 in N/m.
    c_x1, c_x2 : float, optional
        Dampings C_X1 and C_X2 in N s/m.

    Raises
    ------
    ValueError, TypeError
        Springs at the same place, or a stiffness that is not positive.

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
            raise ValueError(f"RadialJoint: z1 and z2 are both {self.z1:g} m, expected two places")

    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Mass, damping and stiffness over (X_c, theta): eqs. 2 to 4, corrected."""
        mass = np.diag([self.body.mass, self.body.inertia])
        return mass, self._held(self.c_x1, self.c_x2), self._held(self.k_x1, self.k_x2)

    def _held(self, first: float, second: float) -> NDArray[np.float64]:
        both = first * self.z1 + second * self.z2
        return np.array([[first + second, both], [both, first * self.z1**2 + second * self.z2**2]])

    def printed_matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Mass, damping and stiffness as eqs. 2 to 4 are printed; only to see what that does.

        They are not symmetric, so a force here and a motion there are not those of the reverse, and the lower right
        entry can be zero or negative: a spring that pushes the way it is pulled. Nothing here computes with them.
        """
        first, second = self.z1, -self.z2
        found = []
        for a, b in ((self.c_x1, self.c_x2), (self.k_x1, self.k_x2)):
            upper = [a + b, a * first + b * second]
            found.append(np.array([upper, [a * first - b * second, a * first**2 - b * second**2]]))
        return self.matrices()[0], found[0], found[1]

    def state_matrix(self) -> NDArray[np.float64]:
        """`(4, 4)` A of u' = A u with u = (X_c, theta, X_c', theta'): eq. 11 with the matrices corrected."""
        mass, damping, stiffness = self.matrices()
        inverse = np.linalg.inv(mass)
        return np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])

    def modes(self) -> RigidModes:
        """Both modes with their damping, from the state matrix.

        Raises
        ------
        ValueError
            A mode that does not oscillate.
        """
        values, vectors = np.linalg.eig(self.state_matrix())
        upper = np.flatnonzero(values.imag > 0.0)
        if upper.size != 2:
            raise ValueError(f"{self!r}: a mode is damped so much that it does not oscillate")
        order = upper[np.argsort(np.abs(values[upper]))]
        poles = values[order]
        return RigidModes(np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), vectors[:2, order])

    def undamped_modes(self) -> RigidModes:
        """Both modes without damping; shapes are real and of unit modal mass."""
        mass, _, stiffness = self.matrices()
        root = np.sqrt(np.diag(mass))
        squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
        # The smaller square is a difference of large numbers; the determinant is a product.
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
        The holder; only its mass counts.
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
        object.__setattr__(self, "k_z1", _checks.positive("AxialJoint", "k_z1", self.k_z1, unit="N/m"))
        object.__setattr__(self, "c_z1", _checks.number("AxialJoint", "c_z1", self.c_z1, unit="N s/m"))

    def modes(self) -> RigidModes:
        """Return its one mode."""
        w = np.sqrt(self.k_z1 / self.body.mass)
        ratio = self.c_z1 / (2.0 * np.sqrt(self.k_z1 * self.body.mass))
        return RigidModes(np.array([w / (2.0 * np.pi)]), np.array([ratio]), np.ones((1, 1), dtype=np.complex128))
