"""Units and physical quantities: the unit registry, units of FRFs and records, quantities written as text.

The program has one unit registry, restricted to the units of mechanical measurements. The angle has a dimension of its
own, so rad/N and m/(N m) differ. The letter g is the acceleration of gravity if that gives a motion or a motion per
load (`g`, `g/N`, `V/(100 mV/g)`), and a gram otherwise (`0.6 g`, `14.5 g/cm^3`). A metre or radian followed by s with a
negative power is a product, as analysers write it: `ms-2` is m/s^2, not one per square millisecond. Names of four
letters or more may end in s. Products and quotients are evaluated from left to right, and a space is a product: `1/N m`
is m/N. The registry is the program's own because a library of all units takes longer to load than a fit; tests compare
it with pint.
"""

from __future__ import annotations

import contextlib
import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from receptance._text import did_you_mean, shown

_DEFINITIONS = """
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
metre = [length] = m = meter
kilogram = [mass] = kg
second = [time] = s = sec = Seconds
radian = [angle] = rad
volt = [voltage] = V
kelvin = [temperature] = K
gram = 0.001 * kilogram = g
tonne = 1000 * kilogram = t
pound = 0.45359237 * kilogram = lb = lbs
ounce = 0.028349523125 * kilogram = oz
minute = 60 * second = min
hour = 3600 * second = h
hertz = 1 / second = Hz = Hertz
degree = 0.017453292519943295 * radian = deg
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
revolution = 6.283185307179586 * radian = rev = revs = turn
revolutions_per_minute = revolution / minute = rpm
inch = 0.0254 * metre = in
foot = 0.3048 * metre = ft = feet
mil = 0.0000254 * metre = thou = mils
litre = 0.001 * metre ** 3 = l = L = liter
standard_gravity = 9.80665 * metre / second ** 2 = gn = g_n = g_0 = G
newton = kilogram * metre / second ** 2 = N
pound_force = 4.4482216152605 * newton = lbf
poundal = 0.138254954376 * newton = pdl
kilogram_force = 9.80665 * newton = kgf = kp
dyne = 1e-5 * newton = dyn
pascal = newton / metre ** 2 = Pa
bar = 1e5 * pascal = bars
psi = pound_force / inch ** 2
ksi = 1000 * psi
joule = newton * metre = J
watt = joule / second = W
ampere = watt / volt = A
percent = 0.01
"""

_SI = {"mass": "kg", "length": "m", "angle": "rad", "voltage": "V", "temperature": "K", "time": "s"}
"""SI unit of each dimension, in the order of a written unit."""

Form = Literal["receptance", "mobility", "accelerance"]
"""Displacement, velocity or acceleration per load."""
FORMS: tuple[Form, ...] = get_args(Form)
"""Forms in the order of time derivatives: the index is the power of i w relative to a receptance."""
FORM_NAMES: dict[str, Form] = {
    "compliance": "receptance",
    "inertance": "accelerance",
    "receptance": "receptance",
    "mobility": "mobility",
    "accelerance": "accelerance",
}
"""Names of the forms in files and options, with the name used here."""

Dimension = tuple[tuple[str, float], ...]
"""Powers of mass, length, time, angle, voltage and temperature other than zero, sorted by name."""


class UnitError(ValueError):
    """A text that is not a known unit; `word` is its unknown part."""

    def __init__(self, message: str, word: str = "") -> None:
        super().__init__(message)
        self.word = word


@dataclass(frozen=True)
class Unit:
    """A unit as written, its factor to SI units and its dimension; units of equal factor and dimension are equal."""

    text: str = field(compare=False)
    factor: float
    dimension: Dimension


# Reading a unit ------------------------------------------------------------------------------------------------------

_LONGEST_UNIT = 80
_SHORTEST_NAME = 4
"""Names of a unit that are longer are not symbols and may end in the s of a plural: `newtons`, but not `Ns`."""
_EXPONENT = r"[+-]?\d(?:\.5)?"
_POWER = re.compile(
    rf"(?:(?<=[A-Za-zµμ)])|(?<=g_0))\s*(?:\^|\*\*)\s*(?:{_EXPONENT}|\(\s*{_EXPONENT}\s*\))(?![\d.]|\s*(?:\^|\*\*))"
)
_SIGN = re.compile(r"(?:(?<=\d[eE])[+-]|(?:^|(?<=[(/*]))\s*-)(?=\s*\d)")
"""A sign of a number, as opposed to a difference or a sum."""
_ALLOWED = re.compile(r"[A-Za-zµμ_0-9.*/() ]+")
_GRAM_OR_GRAVITY = re.compile(r"\b([mµμun]?)g\b")
_LINEAR_POWER = re.compile(r"\b([A-Za-zµμ]+)(-?\d)\b")
_MOTION_PER_TIME = re.compile(r"\b([kcmunpµμ]?m|m?rad)s\s*(?:\^|\*\*)\s*(-\d(?![\d.])|\(\s*-\d\s*\))")
"""Metres or radians times a negative power of seconds, written without a space."""
_RESPELLED = (
    (re.compile(r"['’`´]s\b"), ""),
    (re.compile(r"\blbs?\b|#"), "lbf"),
    (re.compile(r"\bkg\b"), "kgf"),
    (re.compile(r"/\s*\(?(?:N[ *·⋅]*s|s[ *·⋅]*N)\)?$"), "/(N s)"),
    (re.compile(r"/\s*\(?(?:N[ *·⋅]*s(?:\^|\*\*)?[2²]|s(?:\^|\*\*)?[2²][ *·⋅]*N)\)?$"), "/(N s^2)"),
)
"""Spellings that are not units of a motion or load, and what is probably meant."""


_TOKEN = re.compile(
    rf"\s*(?:(?P<number>-?\s*(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-zµμ_][\wµμ]*)"
    rf"|(?:\^|\*\*)\s*(?P<power>{_EXPONENT}|\(\s*{_EXPONENT}\s*\))|(?P<sign>[*/()]))"
)
_Parts = tuple[float, dict[str, float]]
"""Factor and powers of the base dimensions."""


class _Expression:
    """Evaluation of a product of units: numbers, names, powers, quotients and brackets."""

    def __init__(self, text: str, unit: Callable[[str], _Parts]) -> None:
        self._unit = unit
        self._tokens: list[tuple[str, str]] = []
        place = 0
        while place < len(text.rstrip()):
            match = _TOKEN.match(text, place)
            if match is None:
                raise UnitError("no part of a unit")
            kind = str(match.lastgroup)
            self._tokens.append((kind, match[kind]))
            place = match.end()

    def value(self) -> _Parts:
        """Return factor and dimension of the whole expression."""
        parts = self._product()
        if self._tokens:
            raise UnitError("a bracket that was not opened")
        return parts

    def _product(self) -> _Parts:
        factor, powers = self._operand()
        while self._tokens and self._tokens[0][1] != ")":
            over = self._tokens[0] == ("sign", "/")
            if over or self._tokens[0] == ("sign", "*"):
                del self._tokens[0]
            size, dimension = self._operand()
            factor = factor / size if over else factor * size
            for name, power in dimension.items():
                powers[name] = powers.get(name, 0.0) + (-power if over else power)
        return factor, powers

    def _operand(self) -> _Parts:
        kind, text = self._tokens.pop(0) if self._tokens else ("end", "")
        if kind == "number":
            return float(text.replace(" ", "")), {}
        if kind == "name":
            factor, powers = self._unit(text)
        elif text == "(":
            factor, powers = self._product()
            if not self._tokens:
                raise UnitError("a bracket that is not closed")
            del self._tokens[0]
        else:
            raise UnitError(f"{text or 'the end'} in place of a unit")
        if self._tokens and self._tokens[0][0] == "power":
            exponent = float(self._tokens.pop(0)[1].strip("( )"))
            # The root of a negative number is complex, which `_read` refuses.
            return factor**exponent, {name: power * exponent for name, power in powers.items()}
        return factor, dict(powers)


@functools.cache
def _registry() -> tuple[dict[str, _Parts], dict[str, float]]:
    """Return the units and the prefixes by each of their names."""
    units: dict[str, _Parts] = {}
    prefixes: dict[str, float] = {}
    for line in _DEFINITIONS.strip().splitlines():
        name, definition, *others = line.split(" = ")
        if name.endswith("-"):
            prefixes |= {spelling.removesuffix("-"): float(definition) for spelling in (name, *others)}
            continue
        base = re.fullmatch(r"\[(\w+)\]", definition)
        value = (1.0, {base[1]: 1.0}) if base else _Expression(definition, units.__getitem__).value()
        units |= dict.fromkeys((name, *others), value)
    return units, prefixes


def _named(name: str) -> _Parts:
    """Return the unit of a name, which may have a prefix and end in the s of a plural."""
    units, prefixes = _registry()
    for singular in (name, name.removesuffix("s") if len(name) > _SHORTEST_NAME else name):
        if singular in units:
            return units[singular]
        for prefix, factor in prefixes.items():
            if singular.startswith(prefix) and (unit := units.get(singular.removeprefix(prefix))):
                return factor * unit[0], unit[1]
    raise UnitError(f"(unknown: {name!r})", name)


def _plain(text: str) -> str:
    """Return a unit in the spelling of the registry."""
    plain = text.strip()
    for sign, power in (("⁻", "-"), ("¹", "1"), ("²", "2"), ("³", "3"), ("⁴", "4")):
        plain = plain.replace(sign, power)
    plain = plain.replace("·", "*").replace("×", "*").replace("⋅", "*").replace("°", "deg").replace("%", "percent")
    plain = re.sub(r"\b([kmMµμu]?N)([mc]?m)\b", r"\1 \2", plain)
    plain = re.sub(r"\bsec\b", "s", plain, flags=re.IGNORECASE)
    plain = re.sub(r"\bg0\b", "gn", plain)
    # s2 and s-2 are s^2 and s^-2.
    return _MOTION_PER_TIME.sub(r"(\1 s^\2)", _LINEAR_POWER.sub(r"\1^\2", plain))


@functools.lru_cache(maxsize=1024)
def _read(text: str, gravity: bool = False) -> Unit:
    """Return the unit of a text; g is the acceleration of gravity or a gram."""
    plain = _plain(text)
    wrong = f"{text!r} is not understood as a unit, expected one such as 'm/s^2/N' or 'g'"
    bare = _SIGN.sub("", _POWER.sub("", plain))
    if len(plain) > _LONGEST_UNIT or "//" in bare or "**" in bare or not _ALLOWED.fullmatch(bare):
        raise UnitError(wrong, text)
    if plain != "1" and not re.search(r"[A-Za-zµμ]", plain):
        raise UnitError(wrong, text)
    if gravity:
        plain = _GRAM_OR_GRAVITY.sub(r"\1gn", plain)
    try:
        factor, powers = _Expression(plain, _named).value()
    except UnitError as error:
        hint = f" {error}" if error.word else ""
        raise UnitError(wrong + hint, error.word or text) from None
    except (ZeroDivisionError, OverflowError):
        raise UnitError(wrong, text) from None
    if isinstance(factor, complex):
        raise UnitError(f"{wrong}: it is the root of a negative number", text)
    if not 0.0 < abs(factor) < math.inf:
        raise UnitError(f"{wrong}: it is a factor of {factor:g}", text)
    return Unit(text, factor, tuple(sorted((name, power) for name, power in powers.items() if power)))


def parse_unit(text: str) -> Unit:
    """Return the unit of a text in the notation of analysers: `m/s^2/N`, `(m/s²)/N`, `g/lbf`, `um/N`, `rad/(N m)`.

    It may have numbers such as the sensitivity of a sensor, `V/(2.25 mV/N)`. g is the acceleration of gravity if the
    result is a motion or a motion per load, otherwise a gram. A level in dB is refused.

    Examples
    --------
    >>> from receptance.units import parse_unit
    >>> parse_unit("g/N").factor, parse_unit("g").factor, parse_unit("g/m^3").factor
    (9.80665, 9.80665, 0.001)
    """
    if not isinstance(text, str):
        raise TypeError(f"the unit is {text!r}, expected a text such as 'm/s^2/N'")
    if "db" in text.lower():
        raise UnitError(f"the unit {text!r} is a level in dB, whose reference is unknown; export linear values")
    try:
        unit = _read(text)
    except UnitError as error:
        raise UnitError(f"{error}{suggested_unit(text)}", error.word) from None
    if _GRAM_OR_GRAVITY.search(text):
        gravity = _read(text, gravity=True)
        if frf_kind(gravity) is not None or channel_kind(gravity) is not None:
            unit = gravity
    if any(power != round(power) for _, power in unit.dimension):
        raise UnitError(f"{text!r} is not understood as a unit, expected whole powers as in 'm/s^2/N'", text)
    return unit


def suggested_unit(text: str) -> str:
    """Return a question with the probable spelling of a unit that is not one of a motion, a load or an FRF, or "".

    Examples
    --------
    >>> from receptance.units import suggested_unit
    >>> suggested_unit("in/lb"), suggested_unit("m/Ns2"), suggested_unit("bananas")
    ("; did you mean 'in/lbf'?", "; did you mean 'm/(N s^2)'?", '')
    """
    candidate = text
    for pattern, spelling in _RESPELLED:
        candidate = pattern.sub(spelling, candidate.strip())
    with contextlib.suppress(UnitError):
        unit = parse_unit(candidate) if candidate != text.strip() and len(text) <= _LONGEST_UNIT else None
        if unit is not None and (frf_kind(unit) is not None or channel_kind(unit) is not None):
            return f"; did you mean {candidate!r}?"
    return ""


# Units of FRFs and of time records -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class FRFKind:
    """Form and direction of an FRF, from the dimension of its unit."""

    form: Form
    response: str
    """`"y"` or `"theta"`: translation or rotation per load."""
    excitation: str
    """`"y"` or `"theta"`: per force or per moment."""


def form_name(quantity: str) -> Form:
    """Return receptance, mobility or accelerance for one of their names, or raise a ValueError.

    Examples
    --------
    >>> from receptance.units import form_name
    >>> form_name("Inertance")
    'accelerance'
    """
    if not isinstance(quantity, str):
        raise TypeError(f"quantity is {quantity!r}, expected one of {', '.join(FORMS)}")
    form = FORM_NAMES.get(quantity.strip().lower())
    if form is None:
        raise ValueError(f"quantity is {quantity!r}, expected one of {', '.join(FORMS)}")
    return form


def frf_unit(kind: FRFKind) -> str:
    """Return the SI unit of an FRF.

    Examples
    --------
    >>> from receptance.units import FRFKind, frf_unit
    >>> frf_unit(FRFKind("mobility", "theta", "theta"))
    'rad/s/(N m)'
    """
    motion = "m" if kind.response == "y" else "rad"
    rate = ("", "/s", "/s^2")[FORMS.index(kind.form)]
    return f"{motion}{rate}/{'N' if kind.excitation == 'y' else '(N m)'}"


def frf_kind(unit: Unit) -> FRFKind | None:
    """Return the kind of FRF that has this unit, or None.

    Examples
    --------
    >>> from receptance.units import frf_kind, parse_unit
    >>> frf_kind(parse_unit("(m/s²)/N"))
    FRFKind(form='accelerance', response='y', excitation='y')
    """
    return _frf_kinds().get(unit.dimension)


@functools.cache
def _frf_kinds() -> dict[Dimension, FRFKind]:
    kinds = [FRFKind(form, row, column) for form in FORMS for row in ("y", "theta") for column in ("y", "theta")]
    return {_read(frf_unit(kind)).dimension: kind for kind in kinds}


CHANNEL_UNITS = {
    "force": "N",
    "moment": "N m",
    "displacement": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "rotation": "rad",
    "angular velocity": "rad/s",
    "angular acceleration": "rad/s^2",
}
"""Quantities of time records and their SI units."""
ROTATIONS = {
    "force": "moment",
    "displacement": "rotation",
    "velocity": "angular velocity",
    "acceleration": "angular acceleration",
}
"""Quantity at a rotational coordinate by that at a translational one."""


def channel_kind(unit: Unit) -> tuple[str, str] | None:
    """Return the quantity and the SI unit of a time record with this unit, or None.

    Examples
    --------
    >>> from receptance.units import channel_kind, parse_unit
    >>> channel_kind(parse_unit("g"))
    ('acceleration', 'm/s^2')
    """
    return _channel_kinds().get(unit.dimension)


@functools.cache
def _channel_kinds() -> dict[Dimension, tuple[str, str]]:
    return {_read(unit).dimension: (name, unit) for name, unit in CHANNEL_UNITS.items()}


def channel_factor(owner: str, what: str, quantity: str, unit: str) -> float:
    """Return the factor from a recorded number to SI.

    `quantity` is a key of `CHANNEL_UNITS`. The unit may be an expression with the sensitivity of a sensor, such as
    "V/(2.25 mV/N)", negative for a sensor of opposite sign. `owner` and `what`, such as "HammerRecords 'hammer'" and
    "force_unit", are named in errors.

    Examples
    --------
    >>> from receptance.units import channel_factor
    >>> channel_factor("here", "response_unit", "acceleration", "g")
    9.80665
    >>> round(channel_factor("here", "force_unit", "force", "V/(2.25 mV/N)"), 3)
    444.444
    """
    si = CHANNEL_UNITS[quantity]
    expected = f'a unit of {quantity} such as "{si}", or "V/(10 mV/({si}))"'
    if not isinstance(unit, str):
        raise TypeError(f"{owner}: {what} is {unit!r}, expected {expected}")
    if unit.strip() == si:
        return 1.0
    if not unit.strip():
        raise ValueError(f"{owner}: {what} is {unit!r}, expected {expected}")
    try:
        parsed = parse_unit(unit)
    except UnitError as error:
        raise ValueError(f"{owner}: {what} is no unit: {error}; expected {expected}") from None
    if (kind := channel_kind(parsed)) is None or kind[0] != quantity:
        raise ValueError(
            f"{owner}: {what} is {unit!r}, which is {_name_of(parsed.dimension)}, "
            f"expected {expected}{suggested_unit(unit)}"
        )
    return parsed.factor


# Quantities written as a number with a unit --------------------------------------------------------------------------

NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"
"""Pattern of a number in a quantity."""
_TEXT = re.compile(rf"\s*(?P<number>{NUMBER})\s*(?P<unit>.*?)\s*", re.DOTALL)
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+")
_LONGEST_QUANTITY = 200
_COMMON = ("mm", "cm", "m", "µm", "um", "GPa", "MPa", "Pa", "kg", "g", "N", "kN", "Hz", "kHz", "rad", "deg", "s", "ms")


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: name, SI unit, an example and bounds."""

    name: str
    """Name with article, such as "a length"."""
    unit: str
    """Unit of its values; empty for a plain number."""
    example: str
    """Example of a value as text."""
    above: float = -math.inf
    """Bound: values are more than this."""
    least: float = -math.inf
    most: float = math.inf
    written: tuple[float, float] = (0.0, math.inf)
    """Smallest and largest magnitude other than zero in a text; beyond them number and unit do not belong together."""
    remedy: str = "check the number and its unit"
    """What to do about a text beyond `written`."""

    @property
    def expected(self) -> str:
        """Description of a valid text, for messages."""
        if not self.unit:
            return f"a number such as {self.example}"
        return f'{self.name} as text with a unit, such as "{self.example}"'

    @property
    def bounds(self) -> str:
        """The allowed values, as in "more than -1 and at most 0.5"; empty without bounds."""
        texts = []
        if math.isfinite(self.above):
            texts.append(f"more than {self.above:g}" if self.above else "more than zero")
        if math.isfinite(self.least):
            texts.append(f"at least {self.least:g}" if self.least else "zero or more")
        if math.isfinite(self.most):
            texts.append(f"at most {self.most:g}")
        return " and ".join(texts)

    def holds(self, value: float) -> bool:
        """Return whether a value is within the bounds."""
        return value > self.above and self.least <= value <= self.most

    def text(self, value: float) -> str | float:
        """Return a value in SI units as a file states it, with all digits; a plain number without a unit."""
        return f"{float(value)!r} {self.unit}" if self.unit else float(value)

    def readable(self, value: float) -> str | float:
        """Return a value in SI units as text in the unit of its example, with up to 10 digits, or a plain number.

        Examples
        --------
        >>> from receptance import units
        >>> units.LENGTH.readable(0.0127), units.MODULUS.readable(580e9), units.POISSON_RATIO.readable(0.22)
        ('12.7 mm', '580 GPa', 0.22)
        """
        if not self.unit:
            return float(f"{value:.10g}")
        _, unit = split(self.example, "")
        return f"{value / parse(f'1 {unit}', Quantity(self.name, self.unit, self.example)):.10g} {unit}"


LENGTH = Quantity("a length", "m", "62.3 mm", above=0.0, written=(1e-6, 1e3))
LENGTH_OR_ZERO = Quantity("a length or zero", "m", "20 mm", least=0.0)
COORDINATE = Quantity("a length of either sign", "m", "20 mm")
MODULUS = Quantity("a modulus", "Pa", "580 GPa", above=0.0, written=(1e6, 1e20))
DENSITY = Quantity("a density", "kg/m^3", "14500 kg/m^3", above=0.0, written=(1e-6, 1e6))
POISSON_RATIO = Quantity("a Poisson's ratio", "", "0.22", above=-1.0, most=0.5)
LOSS_FACTOR = Quantity("a loss factor", "", "0.002", least=0.0)
MASS = Quantity("a mass", "kg", "0.6 g", least=0.0)
INERTIA = Quantity("a moment of inertia", "kg m^2", "2e-7 kg m^2", least=0.0)
STIFFNESS = Quantity("a stiffness", "N/m", "3.5e8 N/m", least=0.0)
SPRING_STIFFNESS = Quantity("a stiffness above zero", "N/m", "3.5e8 N/m", above=0.0)
ROTATIONAL_STIFFNESS = Quantity("a rotational stiffness", "N m/rad", "4e4 N m/rad", least=0.0)
COUPLING_STIFFNESS = Quantity("a coupling stiffness", "N/rad", "1e5 N/rad")
DAMPING = Quantity("a damping", "N s/m", "120 N s/m", least=0.0)
ROTATIONAL_DAMPING = Quantity("a rotational damping", "N m s/rad", "0.03 N m s/rad", least=0.0)
COUPLING_DAMPING = Quantity("a coupling damping", "N s/rad", "0.5 N s/rad")
SHARE = Quantity("a share", "", "0.1", least=0.0)
SLOPE = Quantity("a slope", "", "0.5", least=-1.0, most=1.0)
EXPONENT = Quantity("an exponent", "", "1.0", above=0.0, most=4.0)
LEVEL = Quantity("a level", "", "2.0", least=0.0)
AMPLITUDE = Quantity("an amplitude", "m", "1 um", least=0.0)
ANGLE = Quantity("an angle", "rad", "1e-5 rad", least=0.0)
DAMPING_RATIO = Quantity("a damping ratio", "", "0.03", least=0.0)
MODE_SHAPE = Quantity("a mode shape", "1/kg**0.5", "0.25 1/kg**0.5")
MODE_SLOPE = Quantity("a slope of a mode shape", "rad/(m*kg**0.5)", "1.1 rad/(m*kg**0.5)")
RECEPTANCE = Quantity("a receptance", "m/N", "2e-9 m/N")
ROTATIONAL_RECEPTANCE = Quantity("a rotational receptance", "rad/(N m)", "2e-7 rad/(N m)")
COUPLING_RECEPTANCE = Quantity("a coupling receptance", "m/(N m)", "1e-8 m/(N m)")
FREQUENCY = Quantity("a frequency", "Hz", "2.5 kHz", above=0.0, written=(1e-6, 1e9))
FREQUENCY_SHIFT = Quantity("a frequency of either sign", "Hz", "2 Hz")
FREQUENCY_OR_ZERO = Quantity("a frequency or zero", "Hz", "500 Hz", least=0.0)
DECAY_RATE = Quantity("a rate of decay", "1/s", "20 1/s", least=0.0, written=(0.0, 1e4))
CORNER = Quantity("a corner frequency of either sign", "rad/s", "60 rad/s")
TIME = Quantity("a time", "s", "2 ms", above=0.0)
TIME_OR_ZERO = Quantity("a time or zero", "s", "2 ms", least=0.0)
DELAY = Quantity("a time of either sign", "s", "5e-6 s")
LOGARITHM = Quantity("a logarithm", "", "0.03")
LEVEL_EXPONENT = Quantity("an exponent of either sign", "", "0.02")
PHASE = Quantity("an angle of either sign", "rad", "0.02 rad")
FORCE = Quantity("a force", "N", "20 N", above=0.0)
SHARE_ABOVE_ZERO = Quantity("a share above zero", "", "0.05", above=0.0, most=1.0)
# An error of the unit is a factor of 1000. The texts of a file are specific forces of wood to hardened steel with thin
# chips; a normal force is a part of the tangential one. Values within wider bounds are random draws.
_SPECIFIC_FORCES = "check the unit: metals have 200 MPa to 5 GPa, and 600 MPa = 600 N/mm^2 = 6e8 N/m^2"
CUTTING_COEFFICIENT = Quantity(
    "a cutting coefficient", "N/m^2", "800 MPa", least=1e6, most=1e11, written=(5e7, 1e10), remedy=_SPECIFIC_FORCES
)
CUTTING_COEFFICIENT_OR_ZERO = Quantity(
    "a cutting coefficient or zero",
    "N/m^2",
    "300 MPa",
    least=0.0,
    most=1e11,
    written=(5e6, 1e10),
    remedy=_SPECIFIC_FORCES,
)
IMMERSION = Quantity("an immersion", "", "0.5", above=0.0, most=1.0)
SPINDLE_SPEED = Quantity("a spindle speed", "rpm", "12000 rpm", above=0.0, written=(0.1, 1e7))
DIRECTION = Quantity("a direction", "deg", "30 deg")
PITCH = Quantity("a pitch angle", "deg", "90 deg", least=5.0, most=360.0)
HELIX = Quantity("a helix angle", "deg", "30 deg", least=-75.0, most=75.0)

QUANTITIES = tuple(one for one in tuple(globals().values()) if isinstance(one, Quantity))
"""All quantities."""

_RATES = {
    "Hz": ("Hz or kHz", re.compile(r"[A-Za-zµμ]*(Hz|hertz|Hertz)")),
    "rpm": ("rpm", re.compile(r"rpm|revolutions_per_minute")),
    "1/s": ("1/s; a rate of decay is in 1/s, not in Hz", re.compile(r"(?!.*(Hz|hertz)).*", re.IGNORECASE)),
}
"""Required units of rates: Hz and 1/s have the same dimension, and confusing them is an error of 2 pi."""


def parse(text: Any, quantity: Quantity, expected: str = "") -> float:
    """Return the value of a quantity, a number and a unit as text, in its unit; a plain number without a unit.

    The messages of errors begin with "is", so the caller can put the name of the value before them. `expected` is what
    they state as expected, by default the quantity with an example.

    Examples
    --------
    >>> from receptance.units import LENGTH, MODULUS, parse
    >>> parse("580 GPa", MODULUS)
    580000000000.0
    >>> parse("62.3 N", LENGTH)
    Traceback (most recent call last):
    ValueError: is "62.3 N", a force, expected a length as text with a unit, such as "62.3 mm"
    """
    expected = expected or quantity.expected
    if quantity.unit:
        number, unit = split(text, expected)
        if not unit:
            raise ValueError(f"is {shown(text)}, without a unit, expected {expected}")
        value = number * _factor(text, unit, quantity, expected)
    elif isinstance(text, bool) or not isinstance(text, (int, float)):
        raise ValueError(f"is {shown(text)}, expected {expected}")
    else:
        try:
            value = float(text)
        except OverflowError:
            raise ValueError(f"is a number of more than 300 digits, expected {expected}") from None
    if not math.isfinite(value):
        raise ValueError(f"is {shown(text)}, expected a finite value: {expected}")
    low, high = quantity.written
    mistaken = value and not low <= abs(value) <= high
    if not quantity.holds(value) and not (mistaken and value > 0.0):
        raise ValueError(f"is {shown(text)}, expected {quantity.bounds}: {expected}")
    if mistaken:
        side = f"more than {high:g}" if abs(value) > high else f"less than {low:g}"
        raise ValueError(f"is {shown(text)}, {side} {quantity.unit}, expected {expected}; {quantity.remedy}")
    return value


def parse_any(text: str) -> tuple[float, str]:
    """Return the SI value and the SI unit of a quantity of any kind; no unit means a plain number.

    Examples
    --------
    >>> from receptance.units import parse_any
    >>> parse_any("5 kN")
    (5000.0, 'kg m/s^2')
    """
    number, unit = split(text, 'a number, or text with a number and a unit such as "135 N m"')
    if not unit:
        return number, ""
    expected = 'a unit without angle over time or offset, such as "Hz" or "K"'
    parsed = _bare_unit(text, unit, expected)
    powers = dict(parsed.dimension)
    if "angle" in powers and "time" in powers and not powers.keys() & {"mass", "length"}:
        raise ValueError(f"is {shown(text)}, expected {expected}")
    return number * parsed.factor, _si_unit(parsed.dimension)


def split(text: Any, expected: str) -> tuple[float, str]:
    """Return the number and the unit of a text."""
    if not isinstance(text, str):
        raise ValueError(f"is {shown(text)}, expected {expected}")
    if len(text) > _LONGEST_QUANTITY:
        raise ValueError(f"is {shown(text)}, a text of {len(text)} characters, expected {expected}")
    match = _TEXT.fullmatch(text)
    if _DECIMAL_COMMA.match(text):
        raise ValueError(f"is {shown(text)}, expected {expected}; decimals are written with a point")
    if match is None:
        raise ValueError(f"is {shown(text)}, expected {expected}")
    number = float(match["number"])
    if not math.isfinite(number):
        raise ValueError(f"is {shown(text)}, too large a number, expected {expected}")
    return number, match["unit"]


def _factor(text: str, unit: str, quantity: Quantity, expected: str) -> float:
    parsed, wanted = _bare_unit(text, unit, expected), _read(quantity.unit)
    powers = dict(parsed.dimension)
    rate = _RATES.get(quantity.unit)
    hint = (
        f"; write it in {rate[0]}" if rate and powers.get("time") == -1 and powers.keys() <= {"angle", "time"} else ""
    )
    # An angle may be left out, as in "4e4 N m" for "4e4 N m/rad".
    without = tuple(power for power in wanted.dimension if power[0] != "angle")
    if parsed.dimension not in (wanted.dimension, wanted.dimension if rate else without):
        raise ValueError(f"is {shown(text)}, {_name_of(parsed.dimension)}, expected {expected}{hint}")
    if rate and not rate[1].fullmatch(unit):
        raise ValueError(f"is {shown(text)}, expected {expected}{hint}")
    return parsed.factor / wanted.factor


def _bare_unit(text: str, unit: str, expected: str) -> Unit:
    """Return a unit without numbers, in which g is a gram."""
    try:
        if re.search(r"\d", _POWER.sub("", _plain(unit)).replace("1/", "/")):
            raise UnitError("a number", unit)
        return _read(unit)
    except UnitError as error:
        raise ValueError(
            f"is {shown(text)}, with the unknown unit {shown(error.word)}{did_you_mean(error.word, _COMMON)}, "
            f"expected {expected}"
        ) from None


@functools.lru_cache(maxsize=256)
def powers_of(unit: str) -> dict[str, float]:
    """Return the powers of the base dimensions in a unit, such as mass and time; none of those in a plain number.

    Examples
    --------
    >>> from receptance.units import powers_of
    >>> powers_of("N/m")
    {'mass': 1.0, 'time': -2.0}
    """
    return dict(_read(unit).dimension) if unit else {}


def _name_of(dimension: Dimension) -> str:
    """Return the name of a quantity of some dimension, for messages."""
    plain = {"a force": "N", "a moment": "N m", "an area": "m^2", "an acceleration": "m/s^2", "a velocity": "m/s"}
    named = ((quantity.name.removesuffix(" or zero"), quantity.unit) for quantity in QUANTITIES if quantity.unit)
    for name, unit in (*plain.items(), *named):
        if _read(unit).dimension == dimension:
            return name
    return f"a quantity in {_si_unit(dimension)}" if dimension else "without a dimension"


def _si_unit(dimension: Dimension) -> str:
    powers = dict(dimension)
    above = [_power(unit, powers[name]) for name, unit in _SI.items() if powers.get(name, 0.0) > 0.0]
    below = ["/" + _power(unit, -powers[name]) for name, unit in _SI.items() if powers.get(name, 0.0) < 0.0]
    return (" ".join(above) or ("1" if below else "")) + "".join(below)


def _power(unit: str, power: float) -> str:
    return unit if power == 1.0 else f"{unit}^{power:g}"
