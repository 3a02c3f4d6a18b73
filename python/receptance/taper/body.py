"""Mass, centre of gravity and inertia of a holder from its sections."""

from __future__ import annotations

from dataclasses import dataclass, replace

from receptance import _checks
from receptance.beams import Part

__all__ = ["Body", "as_rigid", "body_of"]

_RIGID = 1e9
"""Times stiffer than its material: an assembly is then that of the rigid body to nine digits."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body of revolution.

    Parameters
    ----------
    mass : float
        Mass in kg.
    inertia : float
        Moment of inertia in kg m2 about an axis across, through the centre of gravity.
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
        object.__setattr__(self, "mass", _checks.positive("Body", "mass", self.mass, unit="kg"))
        object.__setattr__(self, "inertia", _checks.positive("Body", "inertia", self.inertia, unit="kg m2"))
        object.__setattr__(self, "centre", _checks.number("Body", "centre", self.centre, unit="m"))

    def position(self, x: float) -> float:
        """Signed distance z in m from the centre of gravity, towards the tip, of a place x from the tip-side end."""
        return self.centre - x


def as_rigid(part: Part) -> Part:
    """Return a part of the same mass that is as good as rigid.

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
            one,
            material=replace(one.material, youngs_modulus=_RIGID * one.material.youngs_modulus),
            core=one.core and replace(one.core, youngs_modulus=_RIGID * one.core.youngs_modulus),
        )
        for one in part.segments
    ]
    return Part(stiff, name=part.name)


def body_of(part: Part) -> Body:
    """Return the rigid body that a part is if nothing of it yields.

    A segment of mass m, length L and radius of gyration r of its section adds m (L^2 / 12 + r^2 + e^2), e its distance
    from the centre of gravity; the core counts as well.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.taper import body_of
    >>> rod = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)])
    >>> body_of(rod).centre
    0.1
    """
    masses, middles, own = [], [], []
    start = 0.0
    for segment in part.segments:
        core = segment.core.density if segment.core else 0.0
        outer, inner = segment.outer_diameter**2, segment.inner_diameter**2
        ring = segment.material.density
        # The square of the radius of gyration, from moments d^4 / 64 of areas d^2 / 4.
        gyration = (ring * (outer**2 - inner**2) + core * inner**2) / (ring * (outer - inner) + core * inner) / 16.0
        masses.append(segment.mass)
        middles.append(start + 0.5 * segment.length)
        own.append(segment.length**2 / 12.0 + gyration)
        start += segment.length
    mass = sum(masses)
    centre = sum(m * x for m, x in zip(masses, middles, strict=True)) / mass
    inertia = sum(m * (r + (x - centre) ** 2) for m, x, r in zip(masses, middles, own, strict=True))
    return Body(mass=mass, inertia=inertia, centre=centre)
