"""What was measured: receptances and natural frequencies, each of one assembly."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.frf.validation import check_form, per_line
from receptance.identification import _checked
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf import FRF
    from receptance.identification.from_frf import Floor
    from receptance.model.assembly import Assembly
    from receptance.units import Form

__all__ = ["MeasuredFRF", "MeasuredFrequencies"]

_PER_LINE = ("frequency_hz", "receptance", "standard_deviation", "correlated_lines", "force")
_Kind = TypeVar("_Kind", "MeasuredFRF", "MeasuredFrequencies")
_Any = TypeVar("_Any", bound="MeasuredFRF | MeasuredFrequencies")


@dataclass(frozen=True, init=False, eq=False, repr=False)
class MeasuredFRF:
    """One measured receptance of one assembly.

    Parameters
    ----------
    assembly : Assembly
        Measured assembly. The values of the parameters that are identified do not matter here.
    frequency_hz : array_like
        `(n,)` ascending lines in Hz. A first line at 0 Hz is dropped, with a `ReceptanceWarning` and a note:
        a free structure has no receptance there. Complex, f - i sigma / (2 pi), where force and response were
        multiplied with the window exp(-sigma t): the model is then evaluated on these lines.
    receptance : array_like
        `(n,)` complex, in m/N, m/(N m), rad/N or rad/(N m).
    response, excitation : Coordinate, optional
        Where motion was seen and where the load acted; by default y at the tip.
    standard_deviation : array_like, optional
        Standard deviation of the real and of the imaginary part of the logarithm of the receptance, one number
        or `(n,)`; 0.01 is 1 % of the magnitude and 0.01 rad of the phase.
    correlated_lines : array_like, optional
        How many neighbouring lines share one independent value, at least 1, one number or `(n,)`. The standard
        deviations must contain it, as those of `from_frf` do: sqrt(correlated_lines) times those of the line alone. It
        is used to count the independent lines.
    label : str, optional
        Label in messages, tables and figures.
    notes : sequence of str, optional
        Changes of the data and suspicious properties; the result of a fit repeats them.
    configuration : str, optional
        Name of the configuration that was measured, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws: {"torque": 40.0}.
    force : array_like, optional
        Amplitude of a stepped sine in N, one number or `(n,)`: joints in micro-slip are at the level it brings about.
    ends : float, optional
        Time in s after the hit at which the record ended, where the structure still rang.
    form : {"receptance", "mobility", "accelerance"}, optional
        Stated form of the data before their conversion to `receptance`. It does not affect the fit; a diagnosis
        that finds another quantity names both.

    Attributes
    ----------
    notes : tuple of str
        The given notes, and those on changes made here.

    Raises
    ------
    TypeError, ValueError
        Lines that are empty, unsorted, negative or not finite, arrays of different lengths, a receptance that is
        zero or not finite (the message gives the position), or a coordinate that the assembly does not have.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import MeasuredFRF
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> lines = np.linspace(100.0, 4000.0, 40)
    >>> MeasuredFRF(assembly=bar, frequency_hz=lines, receptance=bar.receptance(lines), label="blank")
    MeasuredFRF('blank', 40 lines from 100 to 4000 Hz)
    """

    assembly: Assembly
    frequency_hz: NDArray[Any]
    receptance: NDArray[np.complex128]
    response: Coordinate
    excitation: Coordinate
    standard_deviation: NDArray[np.float64] | None
    correlated_lines: NDArray[np.float64]
    label: str
    notes: tuple[str, ...]
    configuration: str
    conditions: Mapping[str, float]
    force: NDArray[np.float64] | None
    ends: float | None
    form: Form

    def __init__(
        self,
        *,
        assembly: Assembly,
        frequency_hz: ArrayLike,
        receptance: ArrayLike,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        standard_deviation: ArrayLike | None = None,
        correlated_lines: ArrayLike = 1.0,
        label: str = "",
        notes: Sequence[str] = (),
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        force: ArrayLike | None = None,
        ends: float | None = None,
        form: Form = "receptance",
    ) -> None:
        owner = _checked.owner_of("MeasuredFRF", label, assembly)
        lines = _checks.numbers(owner, "frequency_hz", frequency_hz, "iufc", "real or complex numbers in Hz")
        values = _checks.numbers(owner, "receptance", receptance, "iufc", "complex numbers")
        if lines.ndim != 1:
            raise ValueError(f"{owner}: frequency_hz has shape {lines.shape}, expected one dimension")
        if values.shape != lines.shape:
            raise ValueError(
                f"{owner}: receptance has shape {values.shape} but frequency_hz {lines.shape}, expected the same"
            )
        sd = standard_deviation
        spread = None if sd is None else _checked.spread(owner, "standard_deviation", sd, lines.shape)
        forces = None if force is None else _checked.spread(owner, "force", force, lines.shape)
        alike = per_line(owner, "correlated_lines", correlated_lines, lines.size, at_least=1.0)
        if isinstance(notes, str):
            raise TypeError(f"{owner}: notes is {notes!r}, expected a sequence of texts")
        notes = tuple(map(str, notes))
        if lines.size and lines[0].real == 0.0:
            notes = (*notes, f"{owner}: the line at 0 Hz is dropped")
            warnings.warn(
                f"{owner}: the line at 0 Hz is dropped, a free structure has no receptance there",
                ReceptanceWarning,
                stacklevel=2,
            )
            lines, values, alike = lines[1:], values[1:], alike[1:]
            spread, forces = (given if given is None else given[1:] for given in (spread, forces))
        lines = _checked.decaying(owner, _checked.ascending(owner, lines))
        if forces is not None and lines.dtype.kind == "c":
            raise ValueError(f"{owner}: a force belongs to a stepped sine, and complex lines to a decaying window")
        if forces is not None and ends is not None:
            raise ValueError(f"{owner}: a force belongs to a stepped sine, and an end to the record of a hit")
        values = values.astype(np.complex128)
        for wrong, what in ((~np.isfinite(values), "a finite number"), (values == 0.0, "something else than zero")):
            bad = np.flatnonzero(wrong)
            if bad.size:
                raise ValueError(
                    f"{owner}: the receptance at {lines[bad[0]].real:g} Hz is {values[bad[0]]}, expected {what}; "
                    "leave the line out"
                )
        places = []
        for name, place in (("response", response), ("excitation", excitation)):
            if place is not None and not isinstance(place, Coordinate):
                raise TypeError(f"{owner}: {name} is {place!r}, expected one Coordinate")
            places.append(place or Coordinate())
        # A line off the real axis: no resonance can be in the way of asking whether the coordinates exist. A spindle's
        # table has no such line, and is to have all of the observation's.
        asked = lines if assembly.tabulated else [lines[0].real * (1.0 - 0.1j)]
        assembly.receptance(asked, response=places[0], excitation=places[1], threads=1)
        _checked.fill(
            self,
            assembly=assembly,
            frequency_hz=lines,
            receptance=values,
            response=places[0],
            excitation=places[1],
            standard_deviation=spread,
            correlated_lines=alike,
            label=str(label),
            notes=notes,
            configuration=str(configuration or label),
            conditions=_checked.conditions_of(owner, conditions),
            force=forces,
            ends=None if ends is None else _checks.positive(owner, "ends", ends),
            form=check_form(owner, form),
        )

    def configured(self, configuration: str, conditions: Mapping[str, float]) -> MeasuredFRF:
        """Return the measurement with another configuration and conditions."""
        return _configured(self, configuration, conditions)

    @property
    def weighted(self) -> bool:
        """Whether standard deviations were given."""
        return self.standard_deviation is not None

    def noisier(self, factor: float) -> MeasuredFRF:
        """Return it with standard deviations that are so many times as large."""
        return altered(self, standard_deviation=factor * np.asarray(self.standard_deviation))

    @property
    def independent_lines(self) -> float:
        """Effective number of independent lines: each one counts as 1 / correlated_lines."""
        return float(np.sum(1.0 / self.correlated_lines))

    @property
    def independent_values(self) -> float:
        """Effective number of independent real values: two for each independent line."""
        return 2.0 * self.independent_lines

    @classmethod
    def from_frf(
        cls,
        assembly: Assembly,
        frf: FRF,
        *,
        response: Coordinate | str | int | None = None,
        excitation: Coordinate | str | int | None = None,
        low_hz: float | None = None,
        high_hz: float | None = None,
        floor: float | Floor = 0.0,
        label: str | None = None,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        force: float | None = None,
    ) -> MeasuredFRF:
        """Return one entry of an FRF as an observation of an assembly.

        Converted to receptance, on the usable lines, complex ones where an exponential window was used. Standard
        deviations are those of the FRF's `log_variance`, or of coherence and averages where it has none, pooled over
        neighbouring lines, times the square root of its `correlated_lines`, because a fit takes lines as independent.
        Where the variance follows the magnitude, that magnitude is taken from neighbouring lines, so that weights do
        not follow the noise of their own line; variances with few degrees of freedom nu are enlarged by nu / (nu - 4).
        Lines at 0 Hz and lines of infinite variance are left out.

        Parameters
        ----------
        assembly : Assembly
            What was measured.
        frf : FRF
            The measurement.
        response, excitation : Coordinate, str or int, optional
            Which entry, by coordinate, label or number, where there are several. A Coordinate for a side with one
            entry overrides the coordinate of the FRF. If neither gives a position, it is the tip.
        low_hz, high_hz : float, optional
            Only lines from `low_hz` to `high_hz`, both included.
        floor : float or Floor, optional
            Model error that the noise does not cover, as standard deviation of the logarithm, for example 0.003. Its
            square is added to the variance. A `Floor` has a part that grows with the slope as well.
        label : str, optional
            Label in messages, tables and figures; by default that of the FRF.
        configuration, conditions, force : optional
            As on creation.

        Raises
        ------
        TypeError, ValueError
            No such entry, no usable line in the band, or a variance of zero without a floor.

        Warns
        -----
        ReceptanceWarning
            A coherence that gives no standard deviations, because `averages` is missing.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance import FRF, STEEL, Assembly, MeasuredFRF, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> lines = np.linspace(100.0, 4000.0, 40)
        >>> frf = FRF(frequency_hz=lines, values=bar.receptance(lines), log_variance=1e-4).to("accelerance")
        >>> MeasuredFRF.from_frf(bar, frf, high_hz=2000.0, label="blank")
        MeasuredFRF('blank', 20 lines from 100 to 2000 Hz)
        """
        from receptance.identification.from_frf import observe

        fields = observe(frf, response, excitation, low_hz, high_hz, floor, label)
        return cls(assembly=assembly, **fields, configuration=configuration, conditions=conditions, force=force)

    def describe(self) -> str:
        """Return a text on kind and number of the data."""
        low, high = self.frequency_hz[[0, -1]].real
        return f"FRF, {self.frequency_hz.size} lines from {low:g} to {high:g} Hz"

    def __repr__(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"MeasuredFRF({self.label!r}, {self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


@dataclass(frozen=True, init=False, eq=False, repr=False)
class MeasuredFrequencies:
    """Measured natural frequencies of one assembly.

    Parameters
    ----------
    assembly : Assembly
        Measured assembly. The values of the parameters that are identified do not matter here.
    frequency_hz : array_like
        `(m,)` natural frequencies in Hz, ascending. They are compared with undamped ones, or, where damping ratios are
        given, with the magnitude of the complex eigenfrequencies.
    modes : sequence of int, optional
        Which elastic modes these are, the lowest is 1; by default 1 to m. Rigid-body modes do not count.
    standard_deviation_hz : array_like, optional
        Standard deviation in Hz, one number or `(m,)`.
    damping_ratio : array_like, optional
        `(m,)` damping ratios, 0.01 for 1 %; not a number where a mode's is not known.
    standard_deviation_damping : array_like, optional
        Their standard deviation, one number or `(m,)`; needed with them where frequencies have one.
    label : str, optional
        Label in messages, tables and figures.
    configuration : str, optional
        Name of the configuration that was measured, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws: {"torque": 40.0}.

    Raises
    ------
    TypeError, ValueError
        Frequencies that are empty, unsorted, not positive or not finite, or modes that do not fit them.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import MeasuredFrequencies
    >>> bar = Assembly([Part([Segment(length=0.125, outer_diameter=0.01, material=STEEL)], name="bar")])
    >>> MeasuredFrequencies(assembly=bar, frequency_hz=[2890.0, 14600.0], modes=[1, 3], label="bar")
    MeasuredFrequencies('bar', mode 1: 2890 Hz, mode 3: 14600 Hz)
    """

    assembly: Assembly
    frequency_hz: NDArray[np.float64]
    modes: tuple[int, ...]
    standard_deviation_hz: NDArray[np.float64] | None
    damping_ratio: NDArray[np.float64] | None
    standard_deviation_damping: NDArray[np.float64] | None
    label: str
    configuration: str
    conditions: Mapping[str, float]

    def __init__(
        self,
        *,
        assembly: Assembly,
        frequency_hz: ArrayLike,
        modes: Sequence[int] | None = None,
        standard_deviation_hz: ArrayLike | None = None,
        damping_ratio: ArrayLike | None = None,
        standard_deviation_damping: ArrayLike | None = None,
        label: str = "",
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
    ) -> None:
        owner = _checked.owner_of("MeasuredFrequencies", label, assembly)
        values = np.atleast_1d(_checks.numbers(owner, "frequency_hz", frequency_hz, "iuf", "real numbers in Hz"))
        values = _checked.ascending(owner, values)
        numbers = tuple(range(1, values.size + 1)) if modes is None else _checked.mode_numbers(owner, modes)
        if len(numbers) != values.size:
            raise ValueError(f"{owner}: there are {len(numbers)} modes for {values.size} frequencies")
        spread = None
        if standard_deviation_hz is not None:
            spread = _checked.spread(owner, "standard_deviation_hz", standard_deviation_hz, values.shape)
        damping = _checked.damping(owner, damping_ratio, standard_deviation_damping, spread is not None, values.shape)
        _checked.fill(
            self,
            assembly=assembly,
            frequency_hz=values,
            modes=numbers,
            standard_deviation_hz=spread,
            damping_ratio=damping[0],
            standard_deviation_damping=damping[1],
            label=str(label),
            configuration=str(configuration or label),
            conditions=_checked.conditions_of(owner, conditions),
        )

    def configured(self, configuration: str, conditions: Mapping[str, float]) -> MeasuredFrequencies:
        """Return the measurement with another configuration and conditions."""
        return _configured(self, configuration, conditions)

    @property
    def weighted(self) -> bool:
        """Whether standard deviations were given."""
        return self.standard_deviation_hz is not None

    def noisier(self, factor: float) -> MeasuredFrequencies:
        """Return it with standard deviations that are so many times as large."""
        damping = self.standard_deviation_damping
        return altered(
            self,
            standard_deviation_hz=factor * np.asarray(self.standard_deviation_hz),
            standard_deviation_damping=None if damping is None else factor * np.asarray(damping),
        )

    @property
    def independent_values(self) -> float:
        """Number of independent real values: frequencies and known damping ratios."""
        return float(self.frequency_hz.size + self.damped.size)

    @property
    def damped(self) -> NDArray[np.intp]:
        """Which of the modes have a damping ratio, by their place in the list."""
        none = self.damping_ratio is None
        return np.empty(0, dtype=np.intp) if none else np.flatnonzero(~np.isnan(np.asarray(self.damping_ratio)))

    def describe(self) -> str:
        """Return a text on kind and number of the data."""
        one = len(self.modes) == 1
        modes = ", ".join(map(str, self.modes))
        return f"natural frequenc{'y' if one else 'ies'} of mode{'' if one else 's'} {modes}"

    def __repr__(self) -> str:
        found = ", ".join(f"mode {n}: {f:g} Hz" for n, f in zip(self.modes, self.frequency_hz, strict=True))
        return f"MeasuredFrequencies({self.label!r}, {found})"


def _configured(target: _Kind, configuration: str, conditions: Mapping[str, float]) -> _Kind:
    changed = copy.copy(target)
    _checked.fill(changed, configuration=configuration, conditions=_checked.conditions_of(repr(target), conditions))
    return changed


def altered(target: _Any, **fields: Any) -> _Any:
    """Return an observation with other fields, which are taken as they are."""
    changed = copy.copy(target)
    _checked.fill(changed, **fields)
    return changed


def on_lines(one: MeasuredFRF, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> MeasuredFRF:
    """Return a measured FRF on some of its lines."""
    arrays_of = {name: getattr(one, name) for name in _PER_LINE}
    return altered(one, **{name: array[chosen] for name, array in arrays_of.items() if array is not None})
