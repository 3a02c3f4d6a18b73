"""Measured or hypothetical receptances and natural frequencies, each of one assembly."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import warn_user
from receptance.fit.parameters import FACTORS, Site
from receptance.fit.weights import Floor, Noise, as_floor
from receptance.frf import FRF
from receptance.frf.frf import with_variance
from receptance.frf.variance import unused_coherence
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate, UnknownPosition
from receptance.units import FORMS, Form

Unit = Literal["standard deviations", "percent", "logarithm", "relative"]
"""Meaning of a residual of 1: one logarithm is a factor of e, one relative is twice a natural frequency."""

_TIP = Coordinate()
_PER_LINE = ("frequency_hz", "receptance", "correlated_lines", "force")


def altered(target: Observation, **fields: Any) -> Observation:
    """Return an observation with other fields, whose values are not checked.

    Weights are those of the values as they were measured, unless `standard_deviation` is among the fields.
    """
    if unknown := fields.keys() - target.__dataclass_fields__ - {"standard_deviation", "notes"}:
        raise TypeError(f"an observation has no field {', '.join(sorted(unknown))}")
    if fields.keys() & {"standard_deviation", "notes"} or (target.is_receptance and "receptance" in fields):
        deviation = fields.pop("standard_deviation", target.standard_deviation)
        return _weighed(target, deviation, notes=fields.pop("notes", target.notes), **fields)
    return _replaced(target, **fields)


def _weighed(
    target: Observation, deviation: NDArray[np.float64] | None, *, notes: Sequence[str], **fields: Any
) -> Observation:
    """Return an observation with other fields, whose weights are decided."""
    if deviation is not None:
        deviation = deviation.copy()
        deviation.setflags(write=False)
    noise = Noise(deviation, unused_coherence=target.noise.unused_coherence)
    return _replaced(target, noise=noise, _weights=(deviation, ()), stated_notes=tuple(notes), **fields)


def _replaced(target: Observation, **fields: Any) -> Observation:
    changed = copy.copy(target)
    _checks.set_fields(changed, fields)
    return changed


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Observation:
    """One receptance of one assembly on lines, or some of its natural frequencies.

    The constructor takes a receptance as arrays and `from_frf` an entry of an FRF, `from_modes` natural frequencies.
    An observation without values is a hypothetical measurement, such as a candidate for the next one; its values are
    NaN.

    Parameters
    ----------
    assembly : Assembly
        Measured assembly. The values of the parameters that are identified do not matter here.
    frequency_hz : array_like
        `(n,)` ascending lines in Hz. A first line at 0 Hz is dropped, with a `ReceptanceWarning` and a note:
        a free structure has no receptance there. Complex, f - i sigma / (2 pi), where force and response were
        multiplied with the window exp(-sigma t): the model is then evaluated on these lines.
    receptance : array_like, optional
        `(n,)` complex, in m/N, m/(N m), rad/N or rad/(N m).
    response, excitation : Coordinate, optional
        Coordinates of the motion and of the load; by default y at the tip.
    standard_deviation : array_like, optional
        Standard deviation of the real and of the imaginary part of the logarithm of the receptance, one number
        or `(n,)`; 0.01 is 1 % of the magnitude and 0.01 rad of the phase.
    floor : float or Floor, optional
        Standard deviation of errors that no noise model covers. Its square is added to the variance.
    correlated_lines : array_like, optional
        Number of neighbouring lines per independent value, at least 1, one number or `(n,)`. It is used to count the
        independent lines. The standard deviations must include it, as those of `from_frf` do: they are
        sqrt(correlated_lines) times those of the line alone.
    label : str, optional
        Label in messages, tables and figures.
    notes : sequence of str, optional
        Changes of the data and suspicious properties; the result of a fit repeats them.
    configuration : str, optional
        Name of the configuration that was measured, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws: {"torque": 40.0}.
    force : array_like, optional
        Amplitude of a stepped sine in N, one number or `(n,)`: it determines the level of joints in micro-slip.
    ends : float, optional
        Time in s after the hit at which the record ended before the response had decayed.
    form : {"receptance", "mobility", "accelerance"}, optional
        Stated form of the data before their conversion to `receptance`. It does not affect the fit; a diagnosis
        that finds another quantity names both.

    Raises
    ------
    TypeError, ValueError
        Lines that are empty, unsorted, negative or not finite, arrays of different lengths, a receptance that is
        zero or not finite (the message gives the position), or a coordinate that the assembly does not have.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.fit import Observation
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> lines = np.linspace(100.0, 4000.0, 40)
    >>> Observation(assembly=bar, frequency_hz=lines, receptance=bar.receptance(lines), label="blank")
    Observation('blank', 40 lines from 100 to 4000 Hz)
    """

    assembly: Assembly
    frequency_hz: NDArray[np.inexact]
    receptance: NDArray[np.complex128]
    correlated_lines: NDArray[np.float64]
    label: str
    configuration: str
    conditions: Mapping[str, float]
    noise: Noise
    """The errors as stated or measured, from which `standard_deviation` follows where it is first needed."""
    response: Coordinate = _TIP
    excitation: Coordinate = _TIP
    modes: tuple[int, ...] = ()
    damping_ratio: NDArray[np.float64] | None = None
    standard_deviation_damping: NDArray[np.float64] | None = None
    force: NDArray[np.float64] | None = None
    ends: float | None = None
    form: Form = "receptance"
    stated_notes: tuple[str, ...] = ()

    def __init__(
        self,
        *,
        assembly: Assembly,
        frequency_hz: ArrayLike,
        receptance: ArrayLike | None = None,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        standard_deviation: ArrayLike | None = None,
        floor: float | Floor = 0.0,
        correlated_lines: ArrayLike = 1.0,
        label: str = "",
        notes: Sequence[str] = (),
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        force: ArrayLike | None = None,
        ends: float | None = None,
        form: Form = "receptance",
    ) -> None:
        owner = _owner(label)
        _checks.one_of(owner, "form", form, FORMS)
        lines = _checks.numbers(owner, "frequency_hz", frequency_hz, "iufc", "real or complex numbers in Hz")
        if lines.ndim != 1:
            raise ValueError(f"{owner}: frequency_hz has shape {lines.shape}, expected one dimension")
        per_line: dict[str, NDArray[Any]] = {
            "frequency_hz": lines,
            "receptance": np.full(lines.shape, np.nan, dtype=np.complex128),
            "correlated_lines": _checks.by_line(owner, "correlated_lines", correlated_lines, lines.shape, least=1.0),
        }
        if receptance is not None:
            values = _checks.numbers(owner, "receptance", receptance, "iufc", "complex numbers")
            if values.shape != lines.shape:
                raise ValueError(
                    f"{owner}: receptance has shape {values.shape} but frequency_hz {lines.shape}, expected the same"
                )
            per_line["receptance"] = values.astype(np.complex128)
        for name, numbers in (("standard_deviation", standard_deviation), ("force", force)):
            if numbers is not None:
                per_line[name] = _checks.by_line(owner, name, numbers, lines.shape)
        if isinstance(notes, str):
            raise TypeError(f"{owner}: notes is {notes!r}, expected a sequence of texts")
        notes = tuple(map(str, notes))
        if lines.size and lines[0].real == 0.0:
            notes = (*notes, f"{owner}: the line at 0 Hz is dropped")
            warn_user(f"{notes[-1]}, a free structure has no receptance there")
            per_line = {name: array[1:] for name, array in per_line.items()}
        stated = per_line.pop("standard_deviation", None)
        lines = _decaying(owner, _checks.frequencies(per_line["frequency_hz"], owner))
        if receptance is not None:
            bad = np.flatnonzero(~np.isfinite(per_line["receptance"]))
            if bad.size:
                raise _bad_line(owner, lines, per_line["receptance"], bad[0], "a finite number")
        self._set(
            owner,
            assembly,
            (response, excitation),
            conditions,
            {
                **per_line,
                "frequency_hz": lines,
                "noise": Noise(stated, floor=as_floor(owner, floor)),
                "label": str(label),
                "stated_notes": notes,
                "configuration": str(configuration or label),
                "ends": None if ends is None else _checks.positive(owner, "ends", ends),
                "form": form,
            },
        )

    def _set(
        self,
        owner: str,
        assembly: Assembly,
        places: tuple[Coordinate | None, Coordinate | None],
        conditions: Mapping[str, float] | None,
        fields: dict[str, Any],
    ) -> None:
        """Set the fields of a receptance; what it has beside a valid FRF is checked here."""
        lines, values = fields["frequency_hz"], fields["receptance"]
        if fields.get("force") is not None and lines.dtype.kind == "c":
            raise ValueError(f"{owner}: a force belongs to a stepped sine, and complex lines to a decaying window")
        if fields.get("force") is not None and fields.get("ends") is not None:
            raise ValueError(f"{owner}: a force belongs to a stepped sine, and an end to the record of a hit")
        zero = np.flatnonzero(values == 0.0)
        if zero.size:
            raise _bad_line(owner, lines, values, zero[0], "something else than zero")
        for name, place in zip(("response", "excitation"), places, strict=True):
            if place is not None and not isinstance(place, Coordinate):
                raise TypeError(f"{owner}: {name} is {place!r}, expected one Coordinate")
        response, excitation = (place or _TIP for place in places)
        # This checks the coordinates. A complex line avoids resonances; a table must have all real lines.
        checked = lines if _checked(owner, assembly).tabulated else [lines[0].real * (1.0 - 0.1j)]
        assembly.receptance(checked, response=response, excitation=excitation, threads=1)
        _checks.set_fields(
            self,
            {
                **fields,
                "assembly": assembly,
                "response": response,
                "excitation": excitation,
                "conditions": _conditions(owner, conditions),
            },
        )

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
        ends: float | None = None,
    ) -> Observation:
        """Return one entry of an FRF as an observation of an assembly.

        The observation is the receptance on the usable lines, complex ones if an exponential window was used. Standard
        deviations follow from `log_variance`, or without it from coherence and averages, pooled over neighbouring
        lines; they are computed where they are first needed. They are multiplied by the square root of
        `correlated_lines`, because a fit takes lines as independent. The part of the variance that depends on the
        magnitude is computed with the magnitude of neighbouring lines, so that the noise of a line does not affect its
        own weight. Variances with few degrees of freedom nu are multiplied by nu / (nu - 4). Lines at 0 Hz and lines of
        infinite variance are left out.

        Parameters
        ----------
        response, excitation : Coordinate, str or int, optional
            The entry, by coordinate, label or number, if there are several. A Coordinate for a side with one entry
            overrides the coordinate of the FRF. If neither gives a position, it is the tip.
        low_hz, high_hz : float, optional
            Only lines from `low_hz` to `high_hz`, both included.
        floor : float or Floor, optional
            As in `Observation`, for example 0.003; a `Floor` has a part that depends on the slope as well.
        label : str, optional
            By default that of the FRF.
        configuration, conditions, force, ends : optional
            As in `Observation`.

        Raises
        ------
        TypeError, ValueError
            No such entry, or no usable line in the band. At the first use of the standard deviations: a variance of
            zero without a floor.

        Warns
        -----
        ReceptanceWarning
            A coherence that gives no standard deviations, because `averages` is missing.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance import FRF, STEEL, Assembly, Observation, Part, Segment
        >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
        >>> lines = np.linspace(100.0, 4000.0, 40)
        >>> frf = FRF(frequency_hz=lines, values=bar.receptance(lines), log_variance=1e-4).to("accelerance")
        >>> Observation.from_frf(bar, frf, high_hz=2000.0, label="blank")
        Observation('blank', 20 lines from 100 to 2000 Hz)
        """
        least = as_floor("Observation.from_frf", floor)
        name = frf.label if label is None and isinstance(frf, FRF) else str(label)
        entry, places, notes = _entry(frf, response, excitation)
        entry = with_variance(entry)
        if unused := unused_coherence(entry):
            notes.append(unused)
            warn_user(f"{entry!r}: {unused}")
        entry, line_notes = _usable(entry, name, low_hz, high_hz)
        owner, lines = _owner(name), entry.complex_frequency_hz
        variance, freedom = (
            None if array is None else array[:, 0, 0] for array in (entry.log_variance, entry.degrees_of_freedom)
        )
        observation = object.__new__(cls)
        observation._set(
            owner,
            assembly,
            places,
            conditions,
            {
                "frequency_hz": lines,
                "receptance": entry.values[:, 0, 0],
                "correlated_lines": entry.correlated_lines,
                "noise": Noise(variance=variance, degrees_of_freedom=freedom, floor=least, unused_coherence=unused),
                "label": name,
                "stated_notes": (*entry.notes, *frf.contradictions, *notes, *line_notes),
                "configuration": str(configuration or name),
                "force": None if force is None else _checks.by_line(owner, "force", force, lines.shape),
                "ends": None if ends is None else _checks.positive(owner, "ends", ends),
                "form": frf.form,
            },
        )
        return observation

    @classmethod
    def from_modes(
        cls,
        *,
        assembly: Assembly,
        frequency_hz: ArrayLike | None = None,
        modes: Sequence[int] | None = None,
        standard_deviation_hz: ArrayLike | None = None,
        damping_ratio: ArrayLike | None = None,
        standard_deviation_damping: ArrayLike | None = None,
        label: str = "",
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
    ) -> Observation:
        """Return natural frequencies as an observation of an assembly.

        Parameters
        ----------
        frequency_hz : array_like, optional
            `(m,)` natural frequencies in Hz, ascending. They are compared with undamped ones, or, where damping ratios
            are given, with the magnitude of the complex eigenfrequencies. A hypothetical measurement has none.
        modes : sequence of int, optional
            Numbers of the elastic modes, the lowest is 1; by default 1 to m.
        standard_deviation_hz : array_like, optional
            Standard deviation in Hz, one number or `(m,)`.
        damping_ratio : array_like, optional
            `(m,)` damping ratios, 0.01 for 1 %; NaN if unknown.
        standard_deviation_damping : array_like, optional
            Standard deviation of the damping ratios, one number or `(m,)`; required if frequencies have one.
        assembly, label, configuration, conditions : optional
            As in `Observation`.

        Raises
        ------
        TypeError, ValueError
            Frequencies that are empty, unsorted, not positive or not finite, or modes that do not fit them.

        Examples
        --------
        >>> from receptance import STEEL, Assembly, Part, Segment
        >>> from receptance.fit import Observation
        >>> bar = Assembly([Part([Segment(length=0.125, outer_diameter=0.01, material=STEEL)], name="bar")])
        >>> Observation.from_modes(assembly=bar, frequency_hz=[2890.0, 14600.0], modes=[1, 3], label="bar")
        Observation('bar', mode 1: 2890 Hz, mode 3: 14600 Hz)
        """
        owner = _owner(label)
        _checked(owner, assembly)
        if frequency_hz is None:
            if modes is None or not len(modes):
                raise ValueError(f"{owner}: neither frequency_hz nor modes is given, expected at least one number")
            values = np.full(len(modes), np.nan)
        else:
            values = np.atleast_1d(_checks.numbers(owner, "frequency_hz", frequency_hz, "iuf", "real numbers in Hz"))
            values = _checks.frequencies(values, owner).real
        numbers = tuple(range(1, values.size + 1)) if modes is None else _mode_numbers(owner, modes)
        if len(numbers) != values.size:
            raise ValueError(f"{owner}: there are {len(numbers)} modes for {values.size} frequencies")
        deviation = None
        if standard_deviation_hz is not None:
            deviation = _checks.by_line(owner, "standard_deviation_hz", standard_deviation_hz, values.shape)
        damping = _damping(owner, damping_ratio, standard_deviation_damping, deviation is not None, values.shape)
        observation = object.__new__(cls)
        _checks.set_fields(
            observation,
            {
                "assembly": assembly,
                "frequency_hz": values,
                "modes": numbers,
                "noise": Noise(deviation),
                "damping_ratio": damping[0],
                "standard_deviation_damping": damping[1],
                "label": str(label),
                "configuration": str(configuration or label),
                "conditions": _conditions(owner, conditions),
                "receptance": np.empty(0, dtype=np.complex128),
                "correlated_lines": np.ones(values.size),
            },
        )
        return observation

    @property
    def is_receptance(self) -> bool:
        """Whether it is a receptance on lines; else it is natural frequencies."""
        return not self.modes

    @property
    def factors(self) -> tuple[str, ...]:
        """Addresses of its measuring chain."""
        return FACTORS if self.is_receptance else ()

    @property
    def unit(self) -> Unit:
        """Unit of its residuals if no observation has standard deviations."""
        return "logarithm" if self.is_receptance else "relative"

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Response and excitation of a receptance."""
        return (self.response, self.excitation) if self.is_receptance else ()

    def site(self, index: int) -> Site:
        """Return assembly, configuration and conditions; an unnamed observation is a configuration by its number."""
        name = self.configuration or f"observation {index}"
        return Site(self.assembly, name, self.label, self.conditions, self.factors)

    def title(self, index: int) -> str:
        """Return the label, or the number in the list of observations."""
        return self.label or f"observation {index}"

    @property
    def data(self) -> NDArray[np.inexact]:
        """The receptances, or the natural frequencies in Hz; NaN without values."""
        return self.receptance if self.is_receptance else self.frequency_hz

    @property
    def has_values(self) -> bool:
        """Whether it was measured; False for a hypothetical observation."""
        return not np.isnan(self.data).any()

    def with_values(self, values: ArrayLike) -> Observation:
        """Return the observation with values `(n,)` in SI units or Hz, and with the floor that these have."""
        if not self.is_receptance:
            return _replaced(self, frequency_hz=np.asarray(values, dtype=np.float64))
        changed = _replaced(self, receptance=np.asarray(values, dtype=np.complex128))
        if self.noise.floor:
            changed.__dict__.pop("_weights", None)
        return changed

    @cached_property
    def _weights(self) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        """Standard deviations, and notes on them and on the lines."""
        lines, values = self.frequency_hz.real, self.receptance
        if not self.is_receptance:
            return self.noise.deviation, ()
        deviation, notes = self.noise.weigh(
            repr(self), lines, values, self.correlated_lines, drive_point=self.response == self.excitation
        )
        if deviation is not None:
            deviation.setflags(write=False)
        return deviation, notes

    @property
    def standard_deviation(self) -> NDArray[np.float64] | None:
        """`(n,)`, of the logarithm of a receptance, or of natural frequencies in Hz; None if unknown."""
        return self._weights[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """The stated notes, and those on the standard deviations."""
        return (*self.stated_notes, *self._weights[1])

    @property
    def weighted(self) -> bool:
        """Whether there are standard deviations."""
        return self.standard_deviation is not None

    @property
    def standard_deviations(self) -> NDArray[np.float64]:
        """Standard deviation of each residual; ones if there are none.

        Those of a receptance are `(2 n,)`, of its real and imaginary parts; those of natural frequencies are in Hz and
        followed by those of known damping ratios.
        """
        deviation, damping = self.standard_deviation, self.standard_deviation_damping
        if self.is_receptance:
            return np.tile(np.ones(self.frequency_hz.size) if deviation is None else deviation, 2)
        if deviation is None:
            return np.ones(self.frequency_hz.size + self.damped.size)
        return np.append(deviation, [] if damping is None else damping[self.damped])

    @property
    def independent_values(self) -> float:
        """Effective number of independent real numbers: two for each line, which counts as 1 / correlated_lines.

        One for each natural frequency and for each known damping ratio.
        """
        if self.is_receptance:
            return 2.0 * float(np.sum(1.0 / self.correlated_lines))
        return float(self.frequency_hz.size + self.damped.size)

    @property
    def damped(self) -> NDArray[np.intp]:
        """Indices of the modes with a known damping ratio."""
        ratio = self.damping_ratio
        return np.empty(0, dtype=np.intp) if ratio is None else np.flatnonzero(~np.isnan(ratio))

    def noisier(self, factor: float) -> Observation:
        """Return the measurement with standard deviations multiplied by a factor."""
        damping = self.standard_deviation_damping
        return altered(
            self,
            standard_deviation=factor * np.asarray(self.standard_deviation),
            standard_deviation_damping=None if damping is None else factor * damping,
        )

    def select(self, lines: NDArray[np.bool_] | NDArray[np.intp] | None) -> Observation:
        """Return the receptance on some of its lines, a mask or indices; all with None, and all natural frequencies."""
        if lines is None or not self.is_receptance:
            return self
        arrays = {name: getattr(self, name) for name in _PER_LINE}
        selected = {name: array[lines] for name, array in arrays.items() if array is not None}
        deviation = None if self.standard_deviation is None else self.standard_deviation[lines]
        return _weighed(self, deviation, notes=self.notes, **selected)

    def describe(self) -> str:
        """Return a text on kind and number of the data."""
        if self.is_receptance:
            return f"FRF, {self._lines()}"
        words = "natural frequency of mode" if len(self.modes) == 1 else "natural frequencies of modes"
        return f"{words} {', '.join(map(str, self.modes))}"

    def __repr__(self) -> str:
        if self.is_receptance:
            return f"Observation({self.label!r}, {self._lines()})"
        if not self.has_values:
            return f"Observation({self.label!r}, {self.describe()})"
        frequencies = ", ".join(f"mode {n}: {f:g} Hz" for n, f in zip(self.modes, self.frequency_hz, strict=True))
        return f"Observation({self.label!r}, {frequencies})"

    def _lines(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"{self.frequency_hz.size} lines from {low:g} to {high:g} Hz"


def as_observations(observed: Observation | Sequence[Observation]) -> tuple[Observation, ...]:
    """Return one observation or several with values as a tuple, or raise."""
    observations = _checks.items("observations", observed, Observation)
    for observation in observations:
        if not observation.has_values:
            raise ValueError(f"{observation!r} has no values, expected a measurement")
    return observations


def _entry(
    frf: FRF, response: Coordinate | str | int | None, excitation: Coordinate | str | int | None
) -> tuple[FRF, tuple[Coordinate, Coordinate], list[str]]:
    """Return the selected entry, the coordinates of its response and excitation, and notes on them."""
    if not isinstance(frf, FRF):
        raise TypeError(f"Observation.from_frf: frf is {frf!r}, expected an FRF")
    requested = {"responses": response, "excitations": excitation}
    selection: dict[str, Any] = {}
    for name, place in requested.items():
        count = len(getattr(frf, name))
        if count > 1 and place is None:
            raise ValueError(f"{frf!r} has {count} {name}: select one with {name[:-1]}=, a coordinate or a number")
        selection[name] = 0 if count == 1 and (place is None or isinstance(place, Coordinate)) else place
    entry = frf.select(**selection)
    coordinates, notes = [], []
    for name, place in requested.items():
        (stated,) = getattr(entry, name)
        coordinate = place if isinstance(place, Coordinate) else stated
        if coordinate.direction != stated.direction:
            raise ValueError(
                f"{frf!r}: its {name[:-1]} is in direction {stated.direction!r}, and {coordinate!r} is not"
            )
        if isinstance(coordinate, UnknownPosition):
            notes.append(f"the coordinate of the {name[:-1]} is unknown: taken at the tip")
            coordinate = Coordinate(direction=coordinate.direction)
        elif coordinate != stated and not isinstance(stated, UnknownPosition):
            notes.append(f"the {name[:-1]} is taken at {coordinate!r}; the FRF has {stated!r}")
        coordinates.append(coordinate)
    return entry, (coordinates[0], coordinates[1]), notes


def _usable(frf: FRF, label: str, low_hz: float | None, high_hz: float | None) -> tuple[FRF, list[str]]:
    """Return an entry as receptance on the lines that an observation has, and notes."""
    notes = []
    # The band is selected first, so that a line at 0 Hz outside of it causes no note.
    entry = frf.select(low_hz=low_hz, high_hz=high_hz).masked().to("receptance")
    usable = entry.frequency_hz > 0.0
    if entry.log_variance is not None:
        infinite = np.isinf(entry.log_variance[:, 0, 0]) & usable
        if infinite.any():
            notes.append(f"{np.count_nonzero(infinite)} lines of infinite variance are left out")
            usable &= ~infinite
    if not usable.any():
        raise ValueError(f"{frf!r}: no line is left for {label or 'an observation'}: at 0 Hz, or of infinite variance")
    return entry.on_lines(usable), notes


def _bad_line(
    owner: str, lines: NDArray[np.inexact], values: NDArray[np.complex128], index: np.intp, expected: str
) -> ValueError:
    return ValueError(
        f"{owner}: the receptance at {lines[index].real:g} Hz is {values[index]}, expected {expected}; "
        "leave the line out"
    )


def _owner(label: str) -> str:
    """Return the name of an observation in messages."""
    return f"Observation {label!r}" if label else "Observation"


def _checked(owner: str, assembly: object) -> Assembly:
    if not isinstance(assembly, Assembly):
        raise TypeError(f"{owner}: assembly is {assembly!r}, expected an Assembly")
    return assembly


def _conditions(owner: str, conditions: Mapping[str, float] | None) -> dict[str, float]:
    """Return conditions as numbers by name."""
    return {str(name): _checks.number(owner, f"conditions[{name!r}]", v) for name, v in dict(conditions or {}).items()}


def _decaying(owner: str, lines: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """Return the lines of an exponential window: imaginary parts of zero or less; real without a window."""
    bad = np.flatnonzero(lines.imag > 0.0)
    if bad.size:
        raise ValueError(
            f"{owner}: frequency_hz[{bad[0]}] is {lines[bad[0]]:g} Hz, expected an imaginary part of zero or less: "
            "f - i sigma / (2 pi) for the window exp(-sigma t)"
        )
    return lines if lines.imag.any() else lines.real.astype(np.float64)


def _mode_numbers(owner: str, modes: Sequence[int]) -> tuple[int, ...]:
    """Return ascending mode numbers from 1 on."""
    array = _checks.unmasked(owner, "modes", modes)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise TypeError(f"{owner}: modes is {modes!r}, expected a list of whole numbers")
    if array.size and (array[0] < 1 or np.any(np.diff(array) <= 0)):
        raise ValueError(f"{owner}: modes is {modes!r}, expected ascending numbers from 1 on")
    return tuple(int(number) for number in array)


def _damping(
    owner: str, ratio: ArrayLike | None, deviation: ArrayLike | None, weighed: bool, shape: tuple[int, ...]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return damping ratios, of which some may be NaN, and their standard deviations."""
    if ratio is None:
        if deviation is not None:
            raise ValueError(f"{owner}: standard_deviation_damping is given without damping_ratio")
        return None, None
    values = np.atleast_1d(_checks.numbers(owner, "damping_ratio", ratio, "iuf", "real numbers")).astype(np.float64)
    if values.shape != shape:
        raise ValueError(f"{owner}: damping_ratio has shape {values.shape}, expected {shape}, one for each frequency")
    stated = ~np.isnan(values)
    bad = np.flatnonzero(stated & ~((values >= 0.0) & (values < 1.0)))
    if bad.size:
        raise ValueError(f"{owner}: damping_ratio[{bad[0]}] is {values[bad[0]]:g}, expected 0 or more and less than 1")
    if not stated.any():
        raise ValueError(f"{owner}: damping_ratio has no number, expected at least one, or None")
    if (deviation is not None) != weighed:
        weighted, missing = "frequencies", "damping_ratio"
        if not weighed:
            weighted, missing = missing, weighted
        raise ValueError(
            f"{owner}: {weighted} has standard deviations and {missing} has none, so their weights are unknown; give "
            "both, or neither"
        )
    return values, None if deviation is None else _checks.by_line(owner, "standard_deviation_damping", deviation, shape)
