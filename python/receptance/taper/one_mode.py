"""What one mode alone says: the axial joint (eqs. 14 and 15), and the paper's formula for rotation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.taper.body import Body
from receptance.taper.rigid import AxialJoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["AxialSolution", "axial_from_mode", "rotation_alone"]

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class AxialSolution:
    """The axial joint of one mode, with intervals where standard errors were given."""

    joint: AxialJoint
    intervals: dict[str, Interval]


def axial_from_mode(
    body: Body,
    frequency_hz: float,
    damping_ratio: float = 0.0,
    *,
    frequency_standard_error_hz: float | None = None,
    damping_standard_error: float | None = None,
    level: float = 0.95,
) -> AxialSolution:
    """Return the axial joint of a rigid holder: K = m (2 pi f)^2 and C = 4 pi m f zeta (eqs. 14 and 15).

    Raises
    ------
    ValueError
        A frequency that is not positive; a damping ratio below 0, or from 1 on.

    Examples
    --------
    >>> from receptance.taper import Body, axial_from_mode
    >>> joint = axial_from_mode(Body(mass=4.5, inertia=0.01), 5250.0, 0.005).joint
    >>> f"{joint.k_z1:.4g} N/m, {joint.c_z1:.0f} N s/m"
    '4.897e+09 N/m, 1484 N s/m'
    """
    from receptance.identification.spread import quantile

    f = _checks.positive("axial_from_mode", "frequency_hz", frequency_hz, unit="Hz")
    zeta = _checks.not_negative("axial_from_mode", "damping_ratio", damping_ratio)
    if zeta >= 1.0:
        raise ValueError(f"axial_from_mode: damping_ratio is {zeta:g}, expected a share of critical damping, below 1")
    w = 2.0 * np.pi * f
    joint = AxialJoint(body=body, k_z1=body.mass * w**2, c_z1=2.0 * body.mass * w * zeta)
    intervals: dict[str, Interval] = {}
    reach = quantile(level, None)
    if frequency_standard_error_hz is not None:
        share = reach * frequency_standard_error_hz / f
        intervals["k_z1"] = (joint.k_z1 * (1.0 - share) ** 2, joint.k_z1 * (1.0 + share) ** 2)
        if damping_standard_error is not None:
            half = float(np.hypot(joint.c_z1 * share, 2.0 * body.mass * w * reach * damping_standard_error))
            intervals["c_z1"] = (joint.c_z1 - half, joint.c_z1 + half)
    return AxialSolution(joint=joint, intervals=intervals)


def rotation_alone(
    body: Body, frequency_hz: ArrayLike, damping_ratio: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K_theta = 4 pi^2 I f^2 and C_theta = 4 pi I f zeta, as if a mode were rotation alone.

    The paper has these without a number. They leave the coupling of translation and rotation out: an estimate, which is
    right only where the centre of gravity stands still.

    Returns
    -------
    k_theta, c_theta : ndarray
        In N m/rad and N m s/rad, of each mode.
    """
    f = _checks.unmasked("", "frequency_hz", frequency_hz, np.float64)
    zeta = _checks.unmasked("", "damping_ratio", damping_ratio, np.float64)
    return 4.0 * np.pi**2 * body.inertia * f**2, 4.0 * np.pi * body.inertia * f * zeta
