"""Assemblies: chains of parts and joints with attached point elements."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property, lru_cache
from math import tau
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core
from receptance.model.addresses import (
    Attachment,
    ChainElement,
    check_chain,
    edges_of,
    listed,
    names_of,
    points_of,
    segment_fields,
)
from receptance.model.beams import Material, Part
from receptance.model.coordinates import Coordinate, as_coordinates
from receptance.model.core_tables import MOTIONS, Flat, Motion, Tied, distinct, flatten, force_amplitudes, rows_of
from receptance.model.joints import PointJoint
from receptance.model.terminals import MeasuredPart
from receptance.report import Column, Renderable, Table


@lru_cache(maxsize=256)
def _matches(parameters: tuple[str, ...]) -> dict[str, frozenset[str]]:
    """Return the matches of addresses with parameters; each caller adds its own."""
    return {}


class Assembly(Renderable):
    """A chain of parts and joints from the tip to the far end, with attached masses, springs and resonators.

    Neighbouring parts are rigidly connected, or by a joint: an elastic `PointJoint` (Matthias et al. 2016, eqs. 2 to
    5), a `SpreadJoint` distributed along the insertion, a `ColletJoint` with the mass of a collet, or a
    `MicroslipJoint` with properties that depend on amplitude. The chain may end with a spindle described by its
    receptances, a `MeasuredPart`, or by its modes, a `ModalPart`. Every number is a parameter with an address: see
    `parameters`.

    Parameters
    ----------
    chain : iterable of parts and joints
        Elements from the tip on. The first is a part, the last a part or a spindle. Unnamed elements get the names
        `part`, `joint` and `spindle`, with numbers if there are several.
    attachments : iterable of PointMass, GroundSpring and Resonator, optional
        Point elements, each with its part and position. Unnamed ones get the names `mass`, `ground` and `resonator`.
    motion : {"bending", "axial", "torsion"}, optional
        In axial motion parts are rods, "y", k_y and c_y are axial, and rotational properties are not used. In torsion
        there are parts alone, and "y" is the rotation about their axis, in rad/(N m).

    Raises
    ------
    TypeError, ValueError
        An element of the wrong type, two elements of one name, or a position outside its part.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
    >>> tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    >>> assembly = Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1.0e5, name="joint"), holder])
    >>> assembly.receptance(np.linspace(1.0, 8000.0, 1000)).shape
    (1000,)
    >>> assembly.natural_frequencies(15e3).round(0)
    array([ 2623.,  9314., 13343.])
    """

    plotted_by = "receptance.model.figure:draw_assembly"
    drawn_in_notebooks = True

    notes: Sequence[str] = ()

    def __init__(
        self, chain: Iterable[ChainElement], attachments: Iterable[Attachment] = (), *, motion: Motion = "bending"
    ) -> None:
        _checks.one_of("Assembly", "motion", motion, MOTIONS)
        self.motion = motion
        elements = tuple(chain) if not isinstance(chain, ChainElement) else (chain,)
        points = tuple(attachments)
        check_chain(elements, points, motion)
        # An assembly is immutable, so it is flattened once per set of coordinates.
        self._flats: dict[tuple[Coordinate, ...], Flat] = {}
        self._tied: dict[tuple[Coordinate, ...], tuple[Sequence[str], Tied]] = {}
        self._elements = dict(zip(names_of(elements), elements, strict=True))
        self._attachments = dict(zip(names_of(points), points, strict=True))
        if double := self._elements.keys() & self._attachments.keys():
            raise ValueError(f"Assembly: the name {sorted(double)[0]!r} is given to two elements")
        for name, attachment in self._attachments.items():
            points_of(self._elements, name, attachment)

    @property
    def elements(self) -> dict[str, ChainElement]:
        """Parts and joints by name, from the tip on."""
        return dict(self._elements)

    @property
    def parts(self) -> dict[str, Part]:
        """Parts by name, from the tip on."""
        return {name: element for name, element in self._elements.items() if isinstance(element, Part)}

    @property
    def length(self) -> float:
        """Length in m of all parts, and of joints along an insertion."""
        return float(sum(getattr(element, "length", 0.0) for element in self._elements.values()))

    @property
    def mass(self) -> float:
        """Mass in kg of all parts."""
        return sum(part.mass for part in self.parts.values())

    @property
    def attachments(self) -> dict[str, Attachment]:
        """Point elements by name."""
        return dict(self._attachments)

    @property
    def tabulated(self) -> bool:
        """Whether the assembly ends with a table of receptances, which limits its lines."""
        return any(isinstance(element, MeasuredPart) for element in self._elements.values())

    @property
    def countable(self) -> bool:
        """Whether natural frequencies are available: not for an assembly with a `MeasuredPart` or a `ModalPart`."""
        return all(element.role != "spindle" for element in self._elements.values())

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Addresses of all parameters of the model.

        `<part>.segment[i].length`, `.outer_diameter`, `.inner_diameter`, `.youngs_modulus`, `.density`,
        `.poisson_ratio`, `.loss_factor`, `.core.youngs_modulus` etc.; `<joint>.k_y` and the other fields of a
        `PointJoint`, for a `SpreadJoint` also `.length`, `.shank.outer_diameter` etc., for a `ColletJoint`
        `.inner.k_y`, `.mass` etc., for a `MicroslipJoint` also `.slip_y`, `.level` etc.; `<mass>.mass`, `.inertia`;
        `<ground>.k_y` etc.; `<resonator>.mass`, `.k_y`, `.c_y`; `<spindle>.residual_y`, `.mode[i].frequency_hz` etc.
        `segment[*]` means all segments of a part.
        """
        return tuple(self.flat().entries)

    @cached_property
    def matches(self) -> dict[str, frozenset[str]]:
        """Parameters by the addresses that were matched with them; assemblies with the same parameters share them.

        A diagnosis matches the same addresses with similar assemblies millions of times.
        """
        return _matches(self.parameters)

    @property
    def title(self) -> str:
        """Names of the elements, for `summary` and notebooks."""
        return f"Assembly {', '.join(self._elements)}{'' if self.motion == 'bending' else f' in {self.motion} motion'}"

    def tables(self) -> list[Table]:
        """Return the tables of `summary`: elements and attachments with their values."""
        return _element_tables(self)

    def receptance(
        self,
        frequency_hz: ArrayLike,
        *,
        response: Coordinate | Sequence[Coordinate] | None = None,
        excitation: Coordinate | Sequence[Coordinate] | None = None,
        threads: int | None = None,
        force: ArrayLike | None = None,
    ) -> NDArray[np.complex128]:
        """Return the receptance between coordinates; by default y over force at the tip.

        Parameters
        ----------
        frequency_hz : array_like
            `(n,)` ascending lines in Hz, real or complex.
        response, excitation : Coordinate or sequence of Coordinate, optional
            Coordinates of the motion and of the load.
        threads : int, optional
            Threads over frequency lines; by default RECEPTANCE_THREADS or all that this process may use.
        force : array_like, optional
            Amplitude in N (N m) of a stepped sine, one number or `(n,)`. The level of joints in micro-slip then follows
            from the force on each line instead of the stated level.

        Returns
        -------
        ndarray
            `(n,)` complex for one response and one excitation, else `(n, n_responses, n_excitations)`; in m/N,
            m/(N m), rad/N or rad/(N m).

        Raises
        ------
        ValueError
            Unusable lines, or a coordinate outside the assembly.
        SingularInterfaceError
            A joint without stiffness and damping in a direction.
        ResonanceError
            A line at the frequency of an undamped resonance.
        GrossSlipError
            A line with gross slip of a joint under the force.
        """
        return self._evaluate(frequency_hz, (), response, excitation, threads, force)[0]

    def derivatives(
        self,
        frequency_hz: ArrayLike,
        parameters: Sequence[str],
        *,
        response: Coordinate | Sequence[Coordinate] | None = None,
        excitation: Coordinate | Sequence[Coordinate] | None = None,
        threads: int | None = None,
        force: ArrayLike | None = None,
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the receptance and its derivatives with respect to parameters, see `parameters`.

        The other arguments are those of `receptance`, and so is the first result. The derivatives have an additional
        last axis over the parameters, per SI unit.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> _, slope = bar.derivatives([500.0, 900.0], ["bar.segment[0].length", "bar.segment[0].outer_diameter"])
        >>> slope.shape
        (2, 2)
        """
        return self._evaluate(frequency_hz, listed(parameters), response, excitation, threads, force)

    def natural_frequencies(self, upper_hz: float) -> NDArray[np.float64]:
        """Return the undamped natural frequencies up to `upper_hz`, ascending, in Hz, without rigid-body modes.

        Loss factors and dashpots are ignored. The count of Wittrick and Williams (1971) ensures that none is missed. A
        joint with a dashpot only is a SingularInterfaceError.
        """
        return self.natural_frequency_derivatives(upper_hz, ())[0]

    def natural_frequency_derivatives(
        self, upper_hz: float, parameters: Sequence[str]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return natural frequencies `(n_modes,)` in Hz and derivatives `(n_modes, n_parameters)` in Hz per SI unit."""
        upper = 2.0 * np.pi * _checks.positive("natural_frequencies", "upper_hz", upper_hz, unit="Hz")
        return self._modes(upper, 2**31, listed(parameters))

    def lowest_natural_frequencies(
        self, count: int, parameters: Sequence[str] = ()
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the `count` lowest natural frequencies in Hz, and derivatives in Hz per SI unit.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> frequency, slope = bar.lowest_natural_frequencies(3, ["bar.segment[0].length"])
        >>> frequency.shape, slope.shape
        ((3,), (3, 1))
        """
        return self._modes(None, count, listed(parameters))

    def complex_frequencies(
        self, undamped_hz: ArrayLike, parameters: Sequence[str] = ()
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the complex natural frequencies that undamped ones become under the damping, and derivatives.

        Each mode is followed from its undamped frequency while the damping grows from zero to its value (see
        `damped_modes` for a search that needs no starts). Joints in micro-slip have their stated levels.

        Parameters
        ----------
        undamped_hz : array_like
            `(m,)` undamped natural frequencies in Hz, as `natural_frequencies` returns them.
        parameters : sequence of str, optional
            Addresses, see `parameters`.

        Returns
        -------
        frequency_hz : ndarray
            `(m,)` complex: the magnitude is the natural frequency, imaginary part over magnitude the damping ratio.
        derivatives : ndarray
            `(m, p)` complex, in Hz per SI unit of each parameter.

        Raises
        ------
        ReceptanceError
            A mode that cannot be followed, because it ceases to oscillate or meets another one.
        """
        flat = self.flat()
        rows, matrix = self._weights(flat, listed(parameters))
        undamped = np.ascontiguousarray(undamped_hz, dtype=np.float64).reshape(-1)
        with flat.joints_by_name():
            angular, slope = flat.model.complex_frequencies(tau * undamped, rows)
        return angular / tau, slope @ matrix / tau

    def get(self, address: str) -> float:
        """Return the value of a parameter; for `segment[*]` all segments must have the same value."""
        parameters = self.flat().values
        if address in parameters:
            return parameters[address]
        values = {parameters[name] for name in self._named(address)}
        if len(values) > 1:
            texts = ", ".join(f"{value:g}" for value in sorted(values))
            raise ValueError(f"{address!r} has different values in the segments: {texts}")
        return values.pop()

    def replace(self, values: Mapping[str, float]) -> Assembly:
        """Return a new assembly with other values of some parameters.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> bar.replace({"bar.segment[0].length": 0.2}).get("bar.segment[0].length")
        0.2
        """
        elements: dict[str, Any] = {**self._elements, **self._attachments}
        changes: dict[str, dict[str, float]] = {}
        in_segments: dict[tuple[str, int], dict[str, float]] = {}
        for address, value in values.items():
            owner, rest = self._owner(address)
            name = address.split(".", 1)[0]
            if isinstance(owner, Part):
                for i, field in segment_fields(address, owner, rest):
                    in_segments.setdefault((name, i), {})[field] = value
            else:
                self._named(address)  # raises if there is no such parameter
                changes.setdefault(name, {})[rest] = value
        # All values of an element are replaced together, because only together they may be valid.
        for (name, i), changed in in_segments.items():
            segments = list(elements[name].segments)
            segments[i] = segments[i].with_values(changed)
            elements[name] = replace(elements[name], segments=tuple(segments))
        for name, changed in changes.items():
            elements[name] = elements[name].with_values(changed)
        for name, attachment in self._attachments.items():
            # An attachment at an end of a segment stays there, as its derivative assumes.
            part, along = points_of(self._elements, name, attachment)
            old, new = edges_of(self._elements[part]), edges_of(elements[part])
            if attachment.position == "end" or old == new or not all(x in old for x in along):
                continue
            shifts = [new[old.index(x)] - x for x in along]
            if max(shifts) - min(shifts) <= 1e-9 * old[-1]:
                elements[name] = replace(elements[name], position=along[0] + shifts[0] - attachment.offsets[0])
        named = {
            name: element if element.name == name else replace(element, name=name) for name, element in elements.items()
        }
        points = [named[name] for name in self._attachments]
        return Assembly([named[name] for name in self._elements], points, motion=self.motion)

    def reduced_to_joint(
        self,
        joint: str,
        frequency_hz: ArrayLike,
        *,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        at: PointJoint | None = None,
        planes: bool = False,
        threads: int | None = None,
    ) -> _core.JointReduction:
        """Return a handle of the core for fits and sweeps of one `PointJoint`; the rest is evaluated once.

        The assembly is evaluated with the joint `at`, by default its own. With `planes`, H_0, F_r (2), F_e (2) and Y
        (3) of (T7) are kept on each line, real and imaginary parts, instead of the power series (T7a); the method
        `planes` of the result returns them, `(16, n)`. Lines, coordinates and threads are those of `receptance`.
        """
        if not isinstance(self._elements.get(joint), PointJoint) or self.flat().rows["slips"]:
            raise ValueError(f"{self!r} has no PointJoint {joint!r}, or has a joint in micro-slip")
        if self.motion != "bending":
            raise ValueError(f"{self!r} is in {self.motion} motion, expected bending")
        lines = _checks.frequencies(frequency_hz)
        sides = [as_coordinates(side) for side in (response, excitation)]
        flat = self.flat((sides[0][0], sides[1][0]))
        row = flat.entries[f"{joint}.k_y"][0][1]
        points = np.vstack([self._points(flat, side) for side in sides])
        count = _checks.thread_count(threads)
        with flat.joints_by_name():
            model = flat.model
            if at is not None:
                joints = flat.tables.joints.copy()
                joints[row, 2:] = at.columns
                model = flat.tables._replace(joints=joints).model()
            return model.reduced_to_joint(row, _core.Lines(lines, tau), points, count, flat.by_line(lines), planes)

    def poles(
        self, starts: NDArray[np.complex128], radii: tuple[float, float], angles: tuple[float, float]
    ) -> tuple[NDArray[np.complex128], int]:
        """Return complex natural frequencies in Hz in a sector; `damped_modes` chooses the arguments.

        The search begins at `starts`, in Hz. The sector has magnitudes in Hz and angles from the real axis in rad. The
        second result is the number of further frequencies that were counted by the argument principle and not found.
        """
        flat = self.flat()
        with flat.joints_by_name():
            angular, missed = flat.model.poles(tau * starts, (tau * radii[0], tau * radii[1]), angles)
        return angular / tau, missed

    def flat(self, points: tuple[Coordinate, ...] = ()) -> Flat:
        """Return the tables of the core, with a node at each coordinate; they are computed once."""
        if points not in self._flats:
            self._flats[points] = flatten(self._elements, self._attachments, points, self.motion)
        return self._flats[points]

    def tied(
        self, addresses: Sequence[str], points: tuple[Coordinate, ...] = (), *, others: Collection[str] = ()
    ) -> Tied:
        """Return the model of the core as a function of addresses of parameters.

        Addresses among `others` are those of observations, which are in no table. `points` are coordinates of responses
        and excitations.
        """
        last = self._tied.get(points)
        if last is not None and last[0] == addresses:
            return last[1]
        flat = self.flat(points)
        names = [
            [] if address in others else [address] if address in flat.entries else self._named(address)
            for address in addresses
        ]
        for address, name in zip(addresses, names, strict=True):
            if len(name) > 1:
                self.get(address)  # raises if the segments differ
        tied = Tied(flat, names, self._points(flat, points))
        # A diagnosis varies the same addresses of an assembly in many ways, one after the other.
        self._tied[points] = addresses, tied
        return tied

    def _evaluate(
        self,
        frequency_hz: ArrayLike,
        addresses: tuple[str, ...],
        response: Coordinate | Sequence[Coordinate] | None,
        excitation: Coordinate | Sequence[Coordinate] | None,
        threads: int | None,
        force: ArrayLike | None = None,
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        lines = _checks.frequencies(frequency_hz)
        sides = [as_coordinates(side) for side in (response, excitation)]
        flat = self.flat(tuple(point for side in sides for point in side))
        points = [self._points(flat, side) for side in sides]
        rows, matrix = self._weights(flat, addresses)
        count = _checks.thread_count(threads)
        amplitudes = None if force is None else force_amplitudes(force, lines, len(points[1]))
        properties = flat.by_line(lines, amplitudes)
        with flat.joints_by_name():
            h, dh = flat.model.receptance(_core.Lines(lines, tau), points[1], points[0], rows, count, properties)
        # The product costs as much as the derivatives, so it is skipped for an identity matrix.
        if matrix.shape[0] != matrix.shape[1] or not np.array_equal(matrix, np.eye(len(matrix))):
            dh = dh @ matrix
        if all(isinstance(side, Coordinate) or side is None for side in (response, excitation)):
            return h[:, 0, 0], dh[:, 0, 0]
        return h, dh

    def _modes(
        self, upper: float | None, most: int, addresses: tuple[str, ...]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        flat = self.flat()
        rows, matrix = self._weights(flat, addresses)
        if not self.countable:
            raise ValueError(
                "natural frequencies are not available for an assembly with a MeasuredPart or a ModalPart; use the "
                "peaks of a receptance"
            )
        with flat.joints_by_name():
            angular, slope = flat.model.natural_frequencies(upper, most, rows)
        return angular / (2.0 * np.pi), slope @ matrix / (2.0 * np.pi)

    def _points(self, flat: Flat, side: tuple[Coordinate, ...]) -> NDArray[np.float64]:
        if self.motion != "bending" and any(point.direction == "theta" for point in side):
            raise ValueError(f"a coordinate has the direction 'theta', expected 'y' in {self.motion} motion")
        return rows_of(self._elements, flat, side)

    def _weights(self, flat: Flat, addresses: tuple[str, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the distinct table entries of addresses, and the matrix of their rates; see `distinct`."""
        return distinct(
            [[entry for name in self._named(address) for entry in flat.entries[name]] for address in addresses]
        )

    def _named(self, address: str) -> list[str]:
        """Return the parameters at an address, several with `segment[*]`."""
        entries = self.flat().entries
        if address in entries:
            return [address]
        owner, rest = self._owner(address)
        first = address.split(".", 1)[0] + "."
        if isinstance(owner, Part):
            return [f"{first}segment[{i}].{field}" for i, field in segment_fields(address, owner, rest)]
        names = ", ".join(name.removeprefix(first) for name in entries if name.startswith(first))
        raise ValueError(f"there is no parameter {address!r}; {type(owner).__name__} has {names}")

    def _owner(self, address: str) -> tuple[Any, str]:
        name, dot, rest = str(address).partition(".")
        owner = self._elements.get(name) or self._attachments.get(name)
        if owner is None or not dot:
            owners = ", ".join([*self._elements, *self._attachments])
            raise ValueError(f"there is no parameter {address!r}: its first word must be one of {owners}")
        return owner, rest

    def __repr__(self) -> str:
        names = ", ".join(f"{name}: {type(element).__name__}" for name, element in self._elements.items())
        more = f"; {', '.join(self._attachments)}" if self._attachments else ""
        return f"Assembly({names}{more}{'' if self.motion == 'bending' else '; ' + self.motion})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Assembly):
            return NotImplemented
        # The order of the elements is the structure; that of the attachments has no meaning.
        contents, others = ((a.motion, [*a._elements.items()], a._attachments) for a in (self, other))
        return contents == others

    __hash__ = None  # type: ignore[assignment]


def _element_tables(assembly: Assembly) -> list[Table]:
    """Return the segments of the parts, and the other elements with the values that are not zero."""
    segments: list[tuple[Any, ...]] = []
    others: list[tuple[str, str, str]] = []
    for name, element in {**assembly.elements, **assembly.attachments}.items():
        if isinstance(element, Part):
            for number, segment in enumerate(element.segments):
                segments.append(
                    (
                        name if number == 0 else "",
                        number,
                        1e3 * segment.length,
                        *(_in_mm(*diameters) for diameters in zip(*segment.ends, strict=True)),
                        _material(segment.material),
                        "" if segment.core is None else _material(segment.core),
                    )
                )
        else:
            others.append((name, type(element).__name__, _values(element)))
    columns = (
        "part",
        Column("segment", form="d"),
        Column("length", "mm"),
        Column("outer diameter", "mm"),
        Column("inner diameter", "mm"),
        "material",
        "core",
    )
    tables = [Table("Parts", columns, segments).without_empty()]
    if others:
        tables.append(Table("Joints and attachments, SI units", ("name", "kind", "values"), others))
    return tables


def _in_mm(near: float, far: float) -> float | str:
    """Return a diameter in mm, or those at both ends of a cone as text."""
    return 1e3 * near if near == far else f"{1e3 * near:.4g} to {1e3 * far:.4g}"


def _material(material: Material) -> str:
    constants = f"E {1e-9 * material.youngs_modulus:.4g} GPa, {material.density:.5g} kg/m3"
    return material.name or constants


def _values(element: ChainElement | Attachment) -> str:
    texts = []
    for quantity in fields(element) if is_dataclass(element) else ():
        value = getattr(element, quantity.name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value == 0.0:
            continue
        texts.append(f"{quantity.name} {value:.4g}")
    where = getattr(element, "position", None)
    if where is not None and f"position {where:.4g}" not in texts if isinstance(where, float) else where == "end":
        texts.append(f"position {where}")
    return ", ".join(texts)
