"""Beams: uniform segments and parts made of them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np

from receptance import _checks, _core, units
from receptance.errors import ReceptanceWarning
from receptance.fields import Choice, Element, Member, Number
from receptance.joints import WIDTHS
from receptance.materials import Material

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Part", "Section", "Segment"]

ShearModel = Literal["cowper", "hutchinson"]
_COMMON = {"length": 10.0, "outer_diameter": 2.0}
"""Dimensions in m above these are unusual in a machine tool; they were probably meant in mm."""


@dataclass(frozen=True, kw_only=True)
class _Round(Element):
    """A circular cross-section."""

    outer_diameter: Annotated[float, Number(units.LENGTH, "outer diameter")]
    inner_diameter: Annotated[float, Number(units.LENGTH_OR_ZERO, "diameter of the bore; 0 for a solid section")] = 0.0
    material: Annotated[Material, Member(Material, "material of the ring, or of the solid section", prefix="")]
    core: Annotated[
        Material | None,
        Member(
            Material,
            "material that fills the bore and shares its motion, such as an inserted shank; stiffness and inertia add",
            prefix="core.",
        ),
    ] = None
    shear: Annotated[
        ShearModel,
        Choice(
            "shear coefficient, of Cowper (J. Appl. Mech. 33, 1966, 335) or Hutchinson (J. Appl. Mech. 68, 2001, 87)",
            get_args(ShearModel),
        ),
    ] = "cowper"

    def __post_init__(self) -> None:
        self.check()
        if self.inner_diameter >= self.outer_diameter:
            raise ValueError(
                f"{self.owner}: inner_diameter is {self.inner_diameter:g} m, expected less than the outer diameter "
                f"{self.outer_diameter:g} m"
            )
        if self.core is not None and self.inner_diameter == 0.0:
            raise ValueError(
                f"{self.owner}: core is given but inner_diameter is 0, expected a bore that the core fills"
            )
        for quantity, common in _COMMON.items():
            if (value := getattr(self, quantity, 0.0)) > common:
                text = f"{self.owner}: {quantity} is {value:g} m; lengths are in metres, is this in millimetres?"
                warnings.warn(text, ReceptanceWarning, stacklevel=3)


@dataclass(frozen=True, kw_only=True)
class _Long(Element):
    length: Annotated[float, Number(units.LENGTH, "length")]


@dataclass(frozen=True, kw_only=True)
class Section(_Round):
    """A circular section without a length: solid, hollow, or hollow and filled.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A dimension out of its bounds; the message names it.

    Examples
    --------
    >>> from receptance import STEEL, Section
    >>> Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL).shear
    'cowper'
    """


@dataclass(frozen=True, kw_only=True)
class Segment(_Round, _Long):
    """A uniform circular Timoshenko beam: solid, hollow, or hollow and filled.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A dimension out of its bounds; the message names it.

    Examples
    --------
    >>> from receptance import STEEL, Segment
    >>> tube = Segment(length=0.1, outer_diameter=0.05, inner_diameter=0.02, material=STEEL)
    >>> round(tube.mass, 3)
    1.295
    """

    @property
    def mass(self) -> float:
        """Mass in kg."""
        ring = (self.outer_diameter - self.inner_diameter) * (self.outer_diameter + self.inner_diameter)
        core = self.core.density * self.inner_diameter**2 if self.core else 0.0
        return float(self.length * np.pi / 4.0 * (self.material.density * ring + core))


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
        return _core.Model(motion, self.table(), *(np.zeros((0, width)) for width in WIDTHS))

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
