"""Options of `read`, and the FRFs, units and sample rates that follow from them and the contents of a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._reading import ReadingOptions
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.frf.fields import CoherenceError, LineError
from receptance.io.errors import FileFormatError
from receptance.io.measurements import Measurement
from receptance.model.coordinates import Coordinate, as_coordinates
from receptance.units import Form, FRFKind, Unit, form_name, frf_kind, frf_unit, parse_unit, suggested_unit

SI = "SI"
_GIVE_UNIT = (
    "give it, for example unit='m/s^2/N' (on the command line --unit m/s^2/N), or unit='SI' and quantity='accelerance'"
)


class ReadKeywords(ReadingOptions, total=False):
    """Keyword arguments of `read`: the options of reading, and coordinates."""

    responses: Coordinate | Sequence[Coordinate] | None
    excitations: Coordinate | Sequence[Coordinate] | None


def _unit(name: str, value: Any) -> str | Mapping[str, str]:
    if not isinstance(value, str):
        _pairs(name, value, "a text, or a mapping from channel to text")
    for text in value.values() if isinstance(value, Mapping) else [value]:
        if text != SI:
            parse_unit(text)
    return value  # type: ignore[no-any-return]


def _pairs(name: str, value: Any, expected: str = "a mapping such as {'values': 'H'}") -> Mapping[str, str]:
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} is {value!r}, expected {expected}")
    if not all(isinstance(text, str) for pair in value.items() for text in pair):
        raise TypeError(f"{name} is {value!r}, expected texts for texts")
    return value


def _columns(name: str, value: Any) -> tuple[str, ...]:
    if isinstance(value, str) or not all(isinstance(text, str) for text in value):
        raise TypeError(f"{name} is {value!r}, expected a list of texts such as 'frequency [Hz]'")
    return tuple(value)


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "quantity": lambda _, value: form_name(value),
    "unit": _unit,
    "variables": _pairs,
    "columns": _columns,
    "sample_rate_hz": lambda name, value: _checks.positive("read", name, value, unit="Hz"),
    **dict.fromkeys(("responses", "excitations"), lambda _, value: as_coordinates(value)),
    **dict.fromkeys(("ignore_coherence", "conjugate", "reverse"), lambda _, value: bool(value)),
}


@dataclass(frozen=True)
class ReadOptions:
    """Validated options of `read` that readers need; None for those not given."""

    quantity: Form | None = None
    unit: str | Mapping[str, str] | None = None
    responses: tuple[Coordinate, ...] | None = None
    excitations: tuple[Coordinate, ...] | None = None
    ignore_coherence: bool = False
    conjugate: bool = False
    reverse: bool = False
    variables: Mapping[str, str] | None = None
    columns: Sequence[str] | None = None
    sample_rate_hz: float | None = None

    @staticmethod
    def checked(given: Mapping[str, Any]) -> ReadOptions:
        """Return the options, or raise a TypeError or ValueError that names the invalid one."""
        names = {field.name for field in fields(ReadOptions)}
        if unknown := sorted(set(given) - names):
            raise TypeError(f"read has no option {unknown[0]!r}; the options are {', '.join(sorted(names))}")
        return ReadOptions(**{name: _CHECKS[name](name, value) for name, value in given.items() if value is not None})

    def turned(self, values: NDArray[Any]) -> tuple[NDArray[Any], list[str]]:
        """Return the values of an FRF, conjugated and reversed if that was asked for, with the notes."""
        notes = []
        if self.conjugate:
            values, notes = values.conj(), ["conjugated on request"]
        if self.reverse:
            values, notes = -values, [*notes, "sign changed on request"]
        return values, notes

    def channel_units(self, names: Sequence[str]) -> list[str | None]:
        """Return the given unit of each channel of a time series, or None; one unit for several channels raises."""
        if isinstance(self.unit, str) and self.unit != SI and len(names) > 1:
            example = ", ".join(f"{name!r}: {self.unit!r}" for name in names[:2])
            raise FileFormatError(
                f"a single unit, {self.unit!r}, was given for {len(names)} channels; give a unit for each: "
                f"unit={{{example}}}"
            )
        units = [self.unit.get(name) if isinstance(self.unit, Mapping) else self.unit for name in names]
        for name, unit in zip(names, units, strict=True):
            if unit is not None and unit != SI and frf_kind(parse_unit(unit)) is not None:
                raise FileFormatError(f"{unit!r} is the unit of an FRF, but channel {name!r} is a time record")
        return units


@dataclass(frozen=True)
class Resolved:
    """Kind of an FRF, factor to SI, and notes."""

    kind: FRFKind
    factor: float
    notes: tuple[str, ...] = ()


def resolve_frf(
    options: ReadOptions,
    *,
    declared: Unit | None,
    form: Form | None,
    directions: tuple[str, str] | None,
    undeclared: str = "the file does not state the unit of its FRF",
) -> Resolved:
    """Return kind and unit of an FRF from the file and the options.

    The file states `declared`, a unit, `form` otherwise than by the unit, and the `directions` ("y" or "theta") of
    response and excitation, or None. A missing unit, with the message `undeclared`, and a contradiction between file,
    unit and quantity raise a FileFormatError.
    """
    given = _unit_of_options(options, form, directions, declared)
    unit = given or declared
    if unit is None:
        raise FileFormatError(f"{undeclared}; {_GIVE_UNIT}", option="unit")
    kind = frf_kind(unit)
    if kind is None:
        raise FileFormatError(
            f"{unit.text!r} is not the unit of a receptance, mobility or accelerance, such as 'm/N' or 'm/s^2/N'"
            + suggested_unit(unit.text)
            + ("" if given else "; if it is wrong, give the right one with unit= and quantity=")
        )
    if options.quantity is not None and kind.form != options.quantity:
        raise FileFormatError(
            f"quantity is {options.quantity!r}, but {unit.text!r}{'' if given else ', stated in the file,'} is the "
            f"unit of {_with_article(kind.form)}; give a matching quantity= and unit="
        )
    contradiction = _contradiction(kind, form, directions, declared if given else None)
    directed = options.responses is not None and options.excitations is not None
    if given and directions not in (None, (kind.response, kind.excitation)) and not directed:
        raise FileFormatError(
            f"{unit.text!r} is the unit of {_with_article(kind.form)} in {frf_unit(kind)}, but in the file "
            f"{_describe_directions(directions)}; give unit='SI' if all of the file is in SI, or responses= and "
            "excitations= as well to override the directions"
        )
    if contradiction and given is None:
        raise FileFormatError(
            f"the file contradicts itself: {contradiction}, but its unit {unit.text!r} is that of "
            f"{_with_article(kind.form)} in {frf_unit(kind)}; find out which is correct and give quantity= and unit="
        )
    if contradiction and options.quantity is None:
        raise FileFormatError(
            f"{unit.text!r} is the unit of {_with_article(kind.form)} in {frf_unit(kind)}, but in the file "
            f"{contradiction}; to override the file give quantity= as well"
        )
    notes = [f"overridden by the options: {contradiction}"] if contradiction else []
    if given and declared and declared != unit:
        notes.append(f"the unit in the file, {declared.text!r}, was overridden by {unit.text!r}")
    return Resolved(kind, unit.factor, tuple(notes))


def _unit_of_options(
    options: ReadOptions, form: Form | None, directions: tuple[str, str] | None, declared: Unit | None
) -> Unit | None:
    """Return the unit of the options; for "SI" that of the form."""
    if options.unit is None:
        return None
    if not isinstance(options.unit, str):
        raise FileFormatError("unit is a mapping, expected one text for an FRF, such as 'm/s^2/N'")
    if options.unit != SI:
        return parse_unit(options.unit)
    declared_kind = frf_kind(declared) if declared is not None else None
    form = options.quantity or form or (declared_kind.form if declared_kind is not None else None)
    if directions is None and declared_kind is not None:
        directions = (declared_kind.response, declared_kind.excitation)
    if form is None:
        raise FileFormatError(
            "unit is 'SI', but neither the file nor quantity= states the form, receptance, mobility or accelerance"
        )
    if directions is None:
        sides = (options.responses or (Coordinate(),), options.excitations or (Coordinate(),))
        directions = (sides[0][0].direction, sides[1][0].direction)
    return parse_unit(frf_unit(FRFKind(form, *directions)))


def _contradiction(kind: FRFKind, form: Form | None, directions: tuple[str, str] | None, declared: Unit | None) -> str:
    """Return the statement of the file that contradicts this kind of FRF, or an empty text."""
    if form is not None and form != kind.form:
        return f"it is declared as {_with_article(form)}"
    if directions not in (None, (kind.response, kind.excitation)):
        return _describe_directions(directions)
    if declared is not None and (declared_kind := frf_kind(declared)) is not None and declared_kind != kind:
        return f"the unit is {declared.text!r}, that of {_with_article(declared_kind.form)}"
    return ""


def _describe_directions(directions: tuple[str, str] | None) -> str:
    motion, load = directions or ("y", "y")
    return (
        f"the directions are those of {'a translation' if motion == 'y' else 'a rotation'} per "
        f"{'force' if load == 'y' else 'moment'}"
    )


def _with_article(form: Form) -> str:
    return f"an {form}" if form.startswith("a") else f"a {form}"


_Measurement = TypeVar("_Measurement", bound=Measurement)

_RATE_TOLERANCE = 1e-4
"""Largest relative difference of a given sample rate and that of a file, whose time step has six digits."""
_LEAST_TURN = 1.5
"""Least largest phase that is taken for one in radians: a resonance turns by pi."""
_ROUNDING = 1.001
"""Rounding of the largest phase of a turn."""
_MAX_JITTER = 0.05
"""Largest deviation of a time from an even spacing, in time steps."""
_MAX_STEP_VARIATION = 1e-3
"""Largest deviation of a time step from the mean step, relative."""
_MOST_DECIMALS = 12
"""Decimals of written times."""
_WHOLE = 1e-9
"""Largest deviation of a time in units of its last decimal from a whole number."""
_LEAST_UNITS = 10
"""Least duration of a record in units of the last decimal, whose times confirm a sample rate."""


def make_frf(
    *,
    frequency_hz: NDArray[np.float64],
    values: NDArray[Any],
    form: Form,
    directions: tuple[Sequence[str], Sequence[str]],
    options: ReadOptions,
    coherence: NDArray[np.float64] | None = None,
    notes: Sequence[str] = (),
    **fields: Any,
) -> FRF:
    """Return an FRF of SI values with the coordinates of the options and further fields."""
    notes = list(notes)
    if coherence is not None and options.ignore_coherence:
        coherence = None
        notes.append("the coherence in the file was ignored on request")
    for name, given, side in (
        ("responses", options.responses, directions[0]),
        ("excitations", options.excitations, directions[1]),
    ):
        if given is not None:
            _check_directions(name, given, side)
            fields[name] = given
        elif name not in fields:
            fields[name] = tuple(side)
    values, turned = options.turned(values)
    return make(
        FRF,
        frequency_hz=frequency_hz,
        values=values,
        form=form,
        coherence=coherence,
        notes=(*notes, *turned),
        **fields,
    )


def make(kind: type[_Measurement], *, rows: Sequence[int] = (), **fields: Any) -> _Measurement:
    """Return a measurement of a class; invalid fields raise a FileFormatError, with the line of a row in the file."""
    try:
        return kind(**fields)
    except (TypeError, ValueError) as error:
        line = rows[error.index] if rows and isinstance(error, LineError) else None
        ignore = kind is FRF and isinstance(error, CoherenceError)
        option = ": ignore_coherence=True (on the command line --ignore-coherence)" if ignore else ""
        raise FileFormatError(f"{error}{option}", line=line) from None


def complex_values(real_part: NDArray[Any], imaginary: NDArray[Any]) -> NDArray[np.complex128]:
    """Return complex numbers with exactly these parts; real + 1j * imaginary would lose the sign of zeros."""
    values = np.empty(real_part.shape, dtype=np.complex128)
    values.real, values.imag = real_part, imaginary
    return values


def missing_phase_notes(values: NDArray[Any]) -> list[str]:
    """Warn of an FRF with real values, and return the note; an empty list for complex values."""
    if np.iscomplexobj(values):
        return []
    note = "the values are real: without a phase this is a magnitude, or one part of the FRF"
    warn_user(note)
    return [note]


def phase_notes(phase_rad: NDArray[Any], *, degrees: bool) -> list[str]:
    """Warn of a phase whose numbers are those of the other unit, and return the note."""
    largest = float(np.max(np.abs(phase_rad), initial=0.0))
    if degrees and _LEAST_TURN < np.rad2deg(largest) <= np.pi * _ROUNDING:
        note = f"the phase is within {np.rad2deg(largest):.4g} degrees: if it is in radians, declare it as such"
    elif not degrees and largest > 2.0 * np.pi * _ROUNDING:
        note = (
            f"the phase reaches {largest:.4g} radians, more than a turn: if it is in degrees, declare it as such; "
            "an unwrapped phase is right"
        )
    else:
        return []
    note += ' ("phase [deg]" or "phase [rad]" in a header, phase_deg or phase_rad for arrays)'
    warn_user(note)
    return [note]


def to_si(values: NDArray[Any], factor: float) -> NDArray[Any]:
    """Return values in SI; unchanged for a factor of 1, because a product loses the sign of complex zeros."""
    return values if factor == 1.0 else values * factor


def _check_directions(name: str, given: tuple[Coordinate, ...], side: Sequence[str]) -> None:
    if len(given) != len(side):
        raise FileFormatError(f"{len(given)} {name} were given, the file has {len(side)}")
    for coordinate, direction in zip(given, side, strict=True):
        if coordinate.direction != direction:
            motion = "rotation" if direction == "theta" else "translation"
            raise FileFormatError(f"{name} holds {coordinate}, but the file has a {motion} there")


def sampling(
    seconds: NDArray[np.float64], options: ReadOptions, *, step: float | None = None, step_error: float = 0.0
) -> tuple[float, float]:
    """Return sample rate and start of evenly spaced sample times `(n,)` in s.

    A sample rate in the options is used if it agrees with the file within the digits of its times, else it raises a
    FileFormatError, as do uneven times. `step`, stated in the file with an error of at most `step_error`, is more exact
    than that of the times.
    """
    start, count = float(seconds[0]), seconds.size
    given = options.sample_rate_hz
    if step is None:
        if count < 2:
            if given is None:
                raise FileFormatError("there is a single sample and no sample rate; give it: sample_rate_hz=51200")
            return given, start
        if given is not None and _agree_as_rounded(seconds, given):
            return given, start
        step = float(seconds[-1] - seconds[0]) / (count - 1)
        rounding = 1e-6 * float(np.max(np.abs(seconds)))
        deviation = np.abs(seconds - (start + step * np.arange(count)))
        worst = int(np.argmax(deviation))
        # Rounded times deviate little from even ones; accumulated times drift, but their steps are equal.
        equal_steps = float(np.max(np.abs(np.diff(seconds) - step))) <= _MAX_STEP_VARIATION * step
        if step > 0.0 and not (equal_steps or deviation[worst] <= _MAX_JITTER * step + rounding):
            remedy = (
                "give the sample rate if the times are rounded (sample_rate_hz=51200, on the command line "
                "--sample-rate 51200), else resample the record"
                if given is None
                else f"and they are not those of {given:g} samples per second, rounded"
            )
            raise FileFormatError(
                f"the samples are not evenly spaced in time: sample {worst + 1} is at {seconds[worst]:.9g} s, "
                f"expected {start + step * worst:.9g} s; {remedy}"
            )
    if not (step > 0.0 and np.isfinite(1.0 / step) and np.isfinite(start)):
        raise FileFormatError(f"the time step is {step:g} s, expected more than zero")
    rate = 1.0 / step
    if given is None:
        return rate, start
    if abs(given / rate - 1.0) > max(_RATE_TOLERANCE, step_error / step):
        raise FileFormatError(f"sample_rate_hz is {given:g}, but the file has {rate:.7g} samples per second")
    return given, start


def _agree_as_rounded(seconds: NDArray[np.float64], rate: float) -> bool:
    """Return whether these are the times of a sample rate, rounded to the decimals that they have."""
    duration = (seconds.size - 1) / rate
    # Numbers far from those of times overflow, and do not agree.
    with np.errstate(all="ignore"):
        deviation = float(np.ptp(seconds - np.arange(seconds.size) / rate))
        for decimals in range(_MOST_DECIMALS):
            scaled = seconds * 10.0**decimals
            if np.all(np.abs(scaled - np.rint(scaled)) <= _WHOLE + 1e-15 * np.abs(scaled)):
                unit = 10.0**-decimals
                # The record is long enough for the times to confirm the rate.
                return deviation <= unit * 1.001 and duration >= _LEAST_UNITS * unit
    return False
