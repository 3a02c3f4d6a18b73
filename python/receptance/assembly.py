"""Assemblies: parts and joints in a row, with point elements, observed between coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks, _core
from receptance._addresses import (
    check_chain,
    edges_of,
    interfaces_by_name,
    listed,
    named,
    names_of,
    segment_fields,
)
from receptance._evaluation import by_line, log_determinant, modes, responses
from receptance._flatten import MOTIONS, Element, Flat, Motion
from receptance._placing import distinct, flattened, places_of, rows_of
from receptance.beams import Part
from receptance.coordinates import Coordinate, as_coordinates
from receptance.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.terminals import MeasuredPart, Terminal

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Assembly"]

Attachment = PointMass | GroundSpring | Resonator


class Assembly:
    """Parts and joints in a row from the tip to the far end, with masses and ground springs attached.

    Two parts that follow each other are rigidly connected; a `PointJoint` between them makes the connection
    elastic (Matthias et al. 2016, eqs. 2 to 5), a `SpreadJoint` spreads it along the insertion, a `ColletJoint` puts a
    mass between two of them, and a `MicroslipJoint` depends on its amplitude. A spindle that is known by its
    receptances or by its modes, a `MeasuredPart` or a `ModalPart`, ends the chain. Every number is a parameter with an
    address: see `parameters`.

    Parameters
    ----------
    chain : iterable of parts and joints
        From the tip on; begins with a part, and ends with one or with a spindle. Unnamed elements are called `part`,
        `joint`, `spindle`, numbered where there are several.
    attachments : iterable of PointMass, GroundSpring and Resonator, optional
        Point elements, each with its part and position. Unnamed ones are called `mass`, `ground` and `resonator`.
    motion : {"bending", "axial"}, optional
        In axial motion parts are rods, "y", k_y and c_y are along the axis, and what is about theta is not used.

    Raises
    ------
    TypeError, ValueError
        An element that does not belong there, two elements of one name, or a place that no part has.

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

    def __init__(
        self, chain: Iterable[Element], attachments: Iterable[Attachment] = (), *, motion: Motion = "bending"
    ) -> None:
        if motion not in MOTIONS:
            raise ValueError(f"Assembly: motion is {motion!r}, expected one of {', '.join(MOTIONS)}")
        self.motion = motion
        elements = tuple(chain) if not isinstance(chain, Element) else (chain,)
        points = tuple(attachments)
        check_chain(elements, points, motion)
        # An assembly never changes, so it is flattened once for each set of coordinates.
        self._flats: dict[tuple[Coordinate, ...], Flat] = {}
        self._values: dict[str, float] = {}
        self._elements = dict(zip(names_of(elements), elements, strict=True))
        self._attachments = dict(zip(names_of(points), points, strict=True))
        if double := self._elements.keys() & self._attachments.keys():
            raise ValueError(f"Assembly: the name {sorted(double)[0]!r} is given to two elements")
        for name, attachment in self._attachments.items():
            places_of(self._elements, name, attachment)

    @property
    def elements(self) -> dict[str, Element]:
        """Parts and joints by name, from the tip on."""
        return dict(self._elements)

    @property
    def attachments(self) -> dict[str, Attachment]:
        """Point elements by name."""
        return dict(self._attachments)

    @property
    def tabulated(self) -> bool:
        """Whether it ends with a table of receptances, so that it has a value on the table's lines only."""
        return any(isinstance(element, MeasuredPart) for element in self._elements.values())

    @property
    def countable(self) -> bool:
        """Whether its natural frequencies can be counted: not where it ends with a spindle known by its receptances."""
        return not any(isinstance(element, Terminal) for element in self._elements.values())

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Addresses of all parameters of the model.

        `<part>.segment[i].length`, `.outer_diameter`, `.inner_diameter`, `.youngs_modulus`, `.density`,
        `.poisson_ratio`, `.loss_factor` and `.core.youngs_modulus` and so on; `<joint>.k_y` and its six
        companions, a spread joint's `.length`, `.shank.outer_diameter` and so on, a collet's `.inner.k_y` and
        `.mass`, a slipping one's `.slip_y`, `.level` and so on; `<mass>.mass`, `.inertia`; `<ground>.k_y` and so on;
        `<resonator>.mass`, `.k_y`, `.c_y`;
        `<spindle>.residual_y`, `.mode[i].frequency_hz` and so on. `segment[*]` stands for all segments of a part
        together.
        """
        return tuple(self._flatten(()).entries)

    def receptance(
        self,
        frequency_hz: ArrayLike,
        *,
        response: Coordinate | Sequence[Coordinate] | None = None,
        excitation: Coordinate | Sequence[Coordinate] | None = None,
        threads: int | None = None,
        force: ArrayLike | None = None,
    ) -> NDArray[np.complex128]:
        """Receptance between coordinates; by default y over force at the tip.

        Parameters
        ----------
        frequency_hz : array_like
            `(n,)` ascending lines in Hz, real or complex.
        response, excitation : Coordinate or sequence of Coordinate, optional
            Where motion is seen and where the load acts.
        threads : int, optional
            Threads over frequency lines; by default RECEPTANCE_THREADS or all that this process may use.
        force : array_like, optional
            Amplitude in N (N m), one number or `(n,)`, of a stepped sine: joints in micro-slip then have the level that
            it brings about on each line, and not the stated one.

        Returns
        -------
        ndarray
            `(n,)` complex for one response and one excitation, else `(n, n_responses, n_excitations)`; in m/N,
            m/(N m), rad/N or rad/(N m).

        Raises
        ------
        ValueError
            Unusable lines, or a coordinate that the assembly does not have.
        SingularInterfaceError
            A joint that some direction of the interface is not held by.
        ResonanceError
            A line that meets an undamped resonance exactly.
        GrossSlipError
            A line on which a joint slides as a whole under the force.
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
        """Receptance and its derivative with respect to parameters, in one call.

        Parameters
        ----------
        parameters : sequence of str
            Addresses, see `parameters`.
        frequency_hz, response, excitation, threads, force
            As in `receptance`.

        Returns
        -------
        receptance, derivative : ndarray
            As in `receptance`, and with one more axis at the end its derivative per SI unit of each parameter.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, PointJoint, Segment
        >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
        >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
        >>> _, slope = pair.derivatives([500.0, 900.0], ["joint.k_y", "tool.segment[0].outer_diameter"])
        >>> slope.shape
        (2, 2)
        """
        return self._evaluate(frequency_hz, listed(parameters), response, excitation, threads, force)

    def natural_frequencies(self, upper_hz: float) -> NDArray[np.float64]:
        """Undamped natural frequencies up to `upper_hz`, ascending, in Hz; rigid-body modes are left out.

        Loss factors and dashpots are ignored. They are counted (Wittrick and Williams 1971), so none is missed.

        Raises
        ------
        ValueError
            A limit that is not positive.
        SingularInterfaceError
            A joint that only a dashpot holds.
        """
        return self.natural_frequency_derivatives(upper_hz, ())[0]

    def natural_frequency_derivatives(
        self, upper_hz: float, parameters: Sequence[str]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Natural frequencies in Hz, `(n_modes,)`, and derivatives in Hz per SI unit, `(n_modes, n_parameters)`."""
        upper = 2.0 * np.pi * _checks.positive("natural_frequencies", "upper_hz", upper_hz, unit="Hz")
        return self._modes(upper, 2**31, listed(parameters))

    def lowest_natural_frequencies(
        self, count: int, parameters: Sequence[str] = ()
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the `count` lowest natural frequencies in Hz, wherever they are, and derivatives in Hz per SI unit.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> frequency, slope = bar.lowest_natural_frequencies(3, ["bar.segment[0].length"])
        >>> frequency.shape, slope.shape
        ((3,), (3, 1))
        """
        return self._modes(None, count, listed(parameters))

    def get(self, address: str) -> float:
        """Return the value of a parameter; for `segment[*]` the segments must agree."""
        if address not in self._values:
            self._values[address] = self._get(address)
        return self._values[address]

    def _get(self, address: str) -> float:
        owner, rest = self._owner(address)
        if isinstance(owner, Part):
            values = {owner.segments[i].value(field) for i, field in segment_fields(address, owner, rest)}
            if len(values) > 1:
                found = ", ".join(f"{value:g}" for value in sorted(values))
                raise ValueError(f"{address!r} has different values in the segments: {found}")
            return values.pop()
        self._entries(address, self._flatten(()))
        return float(owner.value(rest))

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
                self._entries(address, self._flatten(()))
                changes.setdefault(name, {})[rest] = value
        # All values of an element at once: a bore and its outside may only be right together.
        for (name, i), fields in in_segments.items():
            segments = list(elements[name].segments)
            segments[i] = segments[i].with_values(fields)
            elements[name] = Part(segments, name=elements[name].name)
        for name, fields in changes.items():
            elements[name] = elements[name].with_values(fields)
        for name, attachment in self._attachments.items():
            # What sits on a step between segments stays on it, as its derivative assumes.
            place, along = places_of(self._elements, name, attachment)
            old, new = edges_of(self._elements[place]), edges_of(elements[place])
            if attachment.position == "end" or old == new or not all(x in old for x in along):
                continue
            shifts = [new[old.index(x)] - x for x in along]
            if max(shifts) - min(shifts) <= 1e-9 * old[-1]:
                elements[name] = replace(elements[name], position=along[0] + shifts[0] - attachment.offsets[0])
        full = {name: named(element, name) for name, element in elements.items()}
        points = [full[name] for name in self._attachments]
        return Assembly([full[name] for name in self._elements], points, motion=self.motion)

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
        """Reduce the assembly to one joint: everything else is evaluated once.

        Parameters
        ----------
        joint : str
            Name of a `PointJoint`.
        frequency_hz, response, excitation, threads
            As in `receptance`.
        at : PointJoint, optional
            The joint at which the assembly is evaluated; by default its own.
        planes : bool, default False
            Keep H_0, F_r (2), F_e (2), Y (3) of (T7) on each line, real and imaginary parts, which the method `planes`
            of the result returns `(16, n)`, where power series (T7a) would be shorter.

        Returns
        -------
        JointReduction
            A handle of the core, for fits and sweeps of that joint.
        """
        if not isinstance(self._elements.get(joint), PointJoint) or self._flatten(()).microslips:
            raise ValueError(f"there is no joint {joint!r} in {self!r}, or another one is in micro-slip")
        if self.motion != "bending":
            raise ValueError(f"{self!r} is in {self.motion} motion; only bending is reduced to a joint")
        lines = _checks.frequencies(frequency_hz)
        sides = [as_coordinates(side) for side in (response, excitation)]
        flat = self._flatten((sides[0][0], sides[1][0]))
        row = flat.entries[f"{joint}.k_y"][0][1]
        points = np.vstack([self._points(flat, side) for side in sides])
        count = _checks.thread_count(threads)
        with interfaces_by_name(flat):
            model = flat.model()
            if at is not None:
                joints = flat.tables.joints.copy()
                joints[row, 2:] = at.columns()
                model = flat.tables._replace(joints=joints).model()
            return model.reduced_to_joint(row, _core.Lines(lines, tau), points, count, by_line(flat, lines), planes)

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
        flat = self._flatten(tuple(point for side in sides for point in side))
        points = [self._points(flat, side) for side in sides]
        rows, matrix = self._weights(flat, addresses)
        count = _checks.thread_count(threads)
        h, dh = responses(flat, lines, points, rows, count, force, MOTIONS[self.motion])
        # A matrix product of the size of the derivatives costs as much as they do, so one entry an address is spared.
        if matrix.shape[0] != matrix.shape[1] or not np.array_equal(matrix, np.eye(len(matrix))):
            dh = dh @ matrix
        if all(isinstance(side, Coordinate) or side is None for side in (response, excitation)):
            return h[:, 0, 0], dh[:, 0, 0]
        return h, dh

    def _modes(
        self, upper: float | None, most: int, addresses: tuple[str, ...]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        flat = self._flatten(())
        rows, matrix = self._weights(flat, addresses)
        angular, slope = modes(flat, upper, most, rows, MOTIONS[self.motion])
        return angular / (2.0 * np.pi), slope @ matrix / (2.0 * np.pi)

    def _log_determinant(self, lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Logarithm, up to a constant, of the determinant that is zero at the complex natural frequencies in Hz."""
        return log_determinant(self._flatten(()), lines, MOTIONS[self.motion])

    def _flatten(self, points: tuple[Coordinate, ...]) -> Flat:
        if points not in self._flats:
            self._flats[points] = flattened(self._elements, self._attachments, points)
        return self._flats[points]

    def _points(self, flat: Flat, side: tuple[Coordinate, ...]) -> NDArray[np.float64]:
        if self.motion != "bending" and any(point.direction == "theta" for point in side):
            raise ValueError(f"a coordinate is in the direction 'theta', and nothing turns in {self.motion} motion")
        return rows_of(self._elements, flat, side)

    def _weights(self, flat: Flat, addresses: tuple[str, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the distinct table entries that the addresses move, and the matrix from them to the addresses."""
        return distinct([self._entries(address, flat) for address in addresses])

    def _entries(self, address: str, flat: Flat) -> list[tuple[int, int, int, float]]:
        if address in flat.entries:
            return flat.entries[address]
        owner, rest = self._owner(address)
        if isinstance(owner, Part):
            name, fields = address.split(".", 1)[0], segment_fields(address, owner, rest)
            return [entry for i, field in fields for entry in flat.entries[f"{name}.segment[{i}].{field}"]]
        first = address.split(".", 1)[0] + "."
        names = ", ".join(name.removeprefix(first) for name in flat.entries if name.startswith(first))
        raise ValueError(f"there is no parameter {address!r}; {type(owner).__name__} has {names}")

    def _owner(self, address: str) -> tuple[Any, str]:
        name, dot, rest = str(address).partition(".")
        owner = self._elements.get(name) or self._attachments.get(name)
        if owner is None or not dot:
            known = ", ".join([*self._elements, *self._attachments])
            raise ValueError(f"there is no parameter {address!r}: its first word must be one of {known}")
        return owner, rest

    def __repr__(self) -> str:
        names = ", ".join(f"{name}: {type(element).__name__}" for name, element in self._elements.items())
        more = f"; {', '.join(self._attachments)}" if self._attachments else ""
        return f"Assembly({names}{more}{'' if self.motion == 'bending' else '; ' + self.motion})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Assembly):
            return NotImplemented
        mine, theirs = ((a.motion, a._elements, a._attachments) for a in (self, other))
        return mine == theirs

    __hash__ = None  # type: ignore[assignment]
