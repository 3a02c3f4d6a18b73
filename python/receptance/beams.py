"""Beams: uniform segments and parts made of them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks, _core
from receptance.errors import ReceptanceWarning
from receptance.materials import Material

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Part", "Section", "Segment"]

ShearModel = Literal["cowper", "hutchinson"]
_NO_CORE = (0.0, 0.0, 0.0, 0.0)
_COMMON = {"length": 10.0, "outer_diameter": 2.0}
"""Larger dimensions in m are unusual in a machine tool and usual where somebody thought in millimetres."""


def _check_section(owner: Any, dimensions: tuple[str, ...]) -> None:
    """Check what a section and a segment share, and replace the dimensions by their checked values."""
    kind = type(owner).__name__
    for quantity in dimensions:
        object.__setattr__(owner, quantity, _checks.positive(kind, quantity, getattr(owner, quantity), unit="m"))
    inner = _checks.not_negative(kind, "inner_diameter", owner.inner_diameter, unit="m")
    object.__setattr__(owner, "inner_diameter", inner)
    if inner >= owner.outer_diameter:
        raise ValueError(
            f"{kind}: inner_diameter is {inner:g} m, expected less than the outer diameter {owner.outer_diameter:g} m"
        )
    if not isinstance(owner.material, Material):
        raise TypeError(f"{kind}: material is {owner.material!r}, expected a Material")
    if owner.core is not None and not isinstance(owner.core, Material):
        raise TypeError(f"{kind}: core is {owner.core!r}, expected a Material or None")
    if owner.core is not None and inner == 0.0:
        raise ValueError(f"{kind}: core is given but inner_diameter is 0, expected a bore that the core fills")
    for quantity in dimensions:
        value = getattr(owner, quantity)
        if value > _COMMON[quantity]:
            text = f"{kind}: {quantity} is {value:g} m; lengths are in metres, is this in millimetres?"
            warnings.warn(text, ReceptanceWarning, stacklevel=4)
    if owner.shear not in get_args(ShearModel):
        raise ValueError(f"{kind}: shear is {owner.shear!r}, expected one of {', '.join(get_args(ShearModel))}")


def _section_columns(owner: Any) -> tuple[float, ...]:
    """Return the columns of the segment table from the outer diameter on."""
    core = owner.core.columns() if owner.core else _NO_CORE
    dimensions = (owner.outer_diameter, owner.inner_diameter)
    return (*dimensions, *owner.material.columns(), *core, float(get_args(ShearModel).index(owner.shear)))


@dataclass(frozen=True, kw_only=True)
class Section:
    """A circular section without a length, solid, hollow, or hollow and filled; parameters as in `Segment`.

    Parameters
    ----------
    outer_diameter, inner_diameter : float
        Outer diameter and bore in m; 0 for no bore.
    material : Material
        What the ring (or the solid section) is made of.
    core : Material, optional
        A second material that fills the bore and shares its motion.
    shear : {"cowper", "hutchinson"}, optional
        Shear coefficient.

    Raises
    ------
    ValueError, TypeError
        A dimension without meaning; the message names it.

    Examples
    --------
    >>> from receptance import STEEL, Section
    >>> Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL).shear
    'cowper'
    """

    outer_diameter: float
    inner_diameter: float = 0.0
    material: Material
    core: Material | None = None
    shear: ShearModel = "cowper"

    def __post_init__(self) -> None:
        _check_section(self, ("outer_diameter",))

    def columns(self) -> tuple[float, ...]:
        """Return the columns of one beam of the overlap table."""
        return _section_columns(self)


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A uniform circular Timoshenko beam, solid, hollow, or hollow and filled.

    Parameters
    ----------
    length : float
        Length in m.
    outer_diameter : float
        Outer diameter in m.
    inner_diameter : float, optional
        Bore in m, less than the outer diameter; 0 for a solid section.
    material : Material
        What the ring (or the solid section) is made of.
    core : Material, optional
        A second material that fills the bore and shares its motion: a holder's nose with an inserted shank is
        such a composite section. Stiffness and inertia of the two add.
    shear : {"cowper", "hutchinson"}, optional
        Shear coefficient: Cowper (J. Appl. Mech. 33, 1966, 335) or Hutchinson (J. Appl. Mech. 68, 2001, 87).

    Raises
    ------
    ValueError, TypeError
        A dimension without meaning; the message names it.

    Examples
    --------
    >>> from receptance import STEEL, Segment
    >>> tube = Segment(length=0.1, outer_diameter=0.05, inner_diameter=0.02, material=STEEL)
    >>> round(tube.mass, 3)
    1.295
    """

    length: float
    outer_diameter: float
    inner_diameter: float = 0.0
    material: Material
    core: Material | None = None
    shear: ShearModel = "cowper"

    def __post_init__(self) -> None:
        _check_section(self, ("length", "outer_diameter"))

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return self.length * self._mass_per_length()

    def _mass_per_length(self) -> float:
        ring = (self.outer_diameter - self.inner_diameter) * (self.outer_diameter + self.inner_diameter)
        core = self.core.density * self.inner_diameter**2 if self.core else 0.0
        return float(np.pi / 4.0 * (self.material.density * ring + core))

    def columns(self) -> tuple[float, ...]:
        """Return the columns of the segment table that follow the two nodes."""
        return (self.length, *_section_columns(self))


@dataclass(frozen=True)
class Part:
    """A part: segments in a row, rigidly connected, x running from its tip-side end to its far end.

    Parameters
    ----------
    segments : iterable of Segment
        At least one, in the order of x.
    name : str, optional
        First word of the addresses of its parameters, as in `tool.segment[0].outer_diameter`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Part, Segment
    >>> bar = Part([Segment(length=0.125, outer_diameter=0.01, material=STEEL)], name="bar")
    >>> bar.receptance(np.linspace(100.0, 5000.0, 50)).shape
    (50, 4, 4)
    """

    segments: tuple[Segment, ...]
    name: str = field(default="", kw_only=True, compare=False)

    def __init__(self, segments: Iterable[Segment], *, name: str = "") -> None:
        if isinstance(segments, Segment):
            segments = (segments,)
        segments = tuple(segments)
        owner = f"Part {name!r}" if name else "Part"
        if not segments:
            raise ValueError(f"{owner}: segments is empty, expected at least one Segment")
        for index, segment in enumerate(segments):
            if not isinstance(segment, Segment):
                raise TypeError(f"{owner}: segments[{index}] is {segment!r}, expected a Segment")
        object.__setattr__(self, "segments", segments)
        object.__setattr__(self, "name", name)

    @property
    def length(self) -> float:
        """Length in m."""
        return sum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return sum(segment.mass for segment in self.segments)

    def table(self) -> NDArray[np.float64]:
        """Return the segment table of the part alone, nodes numbered along x; shape `(n_segments, 14)`."""
        rows = [(float(i), float(i + 1), *segment.columns()) for i, segment in enumerate(self.segments)]
        return np.array(rows)

    def receptance(self, frequency_hz: ArrayLike, *, threads: int | None = None) -> NDArray[np.complex128]:
        """Receptance matrix of the free part over both ends.

        Parameters
        ----------
        frequency_hz : array_like
            `(n,)` ascending lines in Hz; complex ones (w - i sigma)/(2 pi) are what an exponential window sees.
        threads : int, optional
            Threads over frequency lines; by default RECEPTANCE_THREADS or all that this process may use.

        Returns
        -------
        ndarray
            `(n, 4, 4)` complex, rows y1 [m], theta1 [rad], y2, theta2; columns F1 [N], M1 [N m], F2, M2.

        Raises
        ------
        ValueError
            Lines that are empty, unsorted, not finite or not positive.
        ResonanceError
            A line that meets an undamped resonance exactly.
        """
        ends = np.array([[node, way] for node in (0, len(self.segments)) for way in (0, 1)], dtype=np.float64)
        return self._receptance(frequency_hz, 0, ends, threads)

    def axial_receptance(self, frequency_hz: ArrayLike, *, threads: int | None = None) -> NDArray[np.complex128]:
        """Axial receptance of the free part, shape `(n, 2, 2)` over the ends, in m/N; see `receptance`."""
        return self._receptance(frequency_hz, 1, np.array([[0.0, 0.0], [len(self.segments), 0.0]]), threads)

    def torsional_receptance(self, frequency_hz: ArrayLike, *, threads: int | None = None) -> NDArray[np.complex128]:
        """Torsional receptance of the free part, shape `(n, 2, 2)` over the ends, in rad/(N m); see `receptance`."""
        return self._receptance(frequency_hz, 2, np.array([[0.0, 0.0], [len(self.segments), 0.0]]), threads)

    def _receptance(
        self, frequency_hz: ArrayLike, motion: int, ends: NDArray[np.float64], threads: int | None
    ) -> NDArray[np.complex128]:
        lines = _core.Lines(_checks.frequencies(frequency_hz), 2.0 * np.pi)
        count = _checks.thread_count(threads)
        return self._model(motion).receptance(lines, ends, ends, np.zeros((0, 3)), count)[0]

    def _model(self, motion: int = 0) -> _core.Model:
        return _core.Model(motion, self.table(), np.zeros((0, 9)), np.zeros((0, 3)), np.zeros((0, 8)))

    def natural_frequencies(self, upper_hz: float) -> NDArray[np.float64]:
        """Undamped natural frequencies in bending of the free part up to `upper_hz`, in Hz, zero modes left out.

        Examples
        --------
        >>> from receptance import Material, Part, Segment
        >>> steel = Material(youngs_modulus=200e9, density=7800.0, poisson_ratio=0.29)
        >>> Part([Segment(length=0.125, outer_diameter=0.010, material=steel)]).natural_frequencies(15e3).round(2)
        array([ 2837.3 ,  7597.39, 14325.63])
        """
        upper = 2.0 * np.pi * _checks.positive("natural_frequencies", "upper_hz", upper_hz, unit="Hz")
        angular, _ = self._model().natural_frequencies(upper, 2**31, np.zeros((0, 3)))
        return angular / (2.0 * np.pi)

    def _repr_html_(self) -> str:
        from receptance.report import Column, Table
        from receptance.report.html import table_html

        columns = (
            Column("segment", form="d"),
            Column("length", "mm"),
            Column("outer", "mm"),
            Column("inner", "mm"),
            Column("E", "GPa"),
            Column("density", "kg/m3", ".5g"),
        )
        rows = [
            (
                index,
                1e3 * one.length,
                1e3 * one.outer_diameter,
                1e3 * one.inner_diameter,
                1e-9 * one.material.youngs_modulus,
                one.material.density,
            )
            for index, one in enumerate(self.segments)
        ]
        return table_html(Table(f"Part {self.name}".rstrip(), columns, rows))

    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        return (self.segments,), {"name": self.name}
