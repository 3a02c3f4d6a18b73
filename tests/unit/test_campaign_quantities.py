"""Quantities, tolerances and conditions in campaign files."""

from __future__ import annotations

import math

import pytest

from receptance import units
from receptance._text import did_you_mean, one_of
from receptance.campaign.values import Deviation, kind_of, parse_condition, parse_deviation
from receptance.model.fields import Position
from receptance.units import QUANTITIES, Quantity, parse


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("62.3 mm", units.LENGTH, 0.0623),
        ("  6.23e1   mm ", units.LENGTH, 0.0623),
        (".5 inch", units.LENGTH, 0.0127),
        ("0.25 1/kg**0.5", units.MODE_SHAPE, 0.25),
        ("1.1 rad/(m kg^0.5)", units.MODE_SLOPE, 1.1),
        ("85 N/µm", units.STIFFNESS, 85e6),
        ("14.5 g/cm^3", units.DENSITY, 14500.0),
        ("14500 kg/m³", units.DENSITY, 14500.0),
        ("0.6 g", units.MASS, 0.6e-3),
        ("4e4 N m/rad", units.ROTATIONAL_STIFFNESS, 4e4),
        ("4e7 Nmm/rad", units.ROTATIONAL_STIFFNESS, 4e4),
        ("1 N m/deg", units.ROTATIONAL_STIFFNESS, 180.0 / math.pi),
        ("0.03 N·m·s/rad", units.ROTATIONAL_DAMPING, 0.03),
        ("-3e5 N/rad", units.COUPLING_STIFFNESS, -3e5),
        ("20 1/s", units.DECAY_RATE, 20.0),
        ("0 mm", units.LENGTH_OR_ZERO, 0.0),
        (0.22, units.POISSON_RATIO, 0.22),
        (0, units.LOSS_FACTOR, 0.0),
    ],
)
def test_quantities(text: object, kind: Quantity, value: float) -> None:
    assert parse(text, kind) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (62.3, units.LENGTH, 'is 62.3, expected a length as text with a unit, such as "62.3 mm"'),
        ("62.3", units.LENGTH, 'is "62.3", without a unit, expected a length'),
        ("62,3 mm", units.LENGTH, "decimals are written with a point"),
        ("mm", units.LENGTH, 'is "mm", expected a length'),
        ("", units.LENGTH, 'is "", expected a length'),
        ("62.3 mn", units.LENGTH, 'with the unknown unit "mn" (did you mean "mm"?)'),
        ("62.3 N", units.LENGTH, 'is "62.3 N", a force, expected a length'),
        ("1e3 m^9^9^9", units.LENGTH, 'with the unknown unit "m^9^9^9"'),
        ("4e4 N m/dB", units.ROTATIONAL_STIFFNESS, 'with the unknown unit "dB"'),
        pytest.param("1 m" + " " * 100_000 + "m", units.LENGTH, "a text of 100004 characters, expected", id="blanks"),
        pytest.param(10**400, units.LOSS_FACTOR, "is a number of more than 300 digits, expected a number", id="1e400"),
        ("-60 mm", units.LENGTH, "expected more than zero"),
        ("-1 mm", units.LENGTH_OR_ZERO, "expected zero or more"),
        ("1e400 mm", units.LENGTH, "too large a number"),
        ("nan mm", units.LENGTH, 'is "nan mm", expected a length'),
        ("9**9**9 mm", units.LENGTH, "expected a length"),
        ("100 rad/s", units.FREQUENCY, "write it in Hz or kHz"),
        ("6000 rpm", units.FREQUENCY, "write it in Hz or kHz"),
        ("20 Hz", units.DECAY_RATE, "a rate of decay is in 1/s, not in Hz"),
        (True, units.POISSON_RATIO, "is true, expected a number such as 0.22"),
        ("0.22", units.POISSON_RATIO, 'is "0.22", expected a number such as 0.22'),
        (0.7, units.POISSON_RATIO, "is 0.7, expected more than -1 and at most 0.5"),
        (float("nan"), units.LOSS_FACTOR, "expected a finite value"),
        ({"value": 3}, units.LENGTH, "is a table, expected a length"),
    ],
)
def test_invalid_quantity_errors(text: object, kind: Quantity, words: str) -> None:
    with pytest.raises(ValueError, match="expected") as error:
        parse(text, kind)
    assert words in str(error.value)


def test_examples_of_each_kind_are_valid() -> None:
    for kind in QUANTITIES:
        assert parse(kind.example if kind.unit else float(kind.example), kind) >= 0.0


@pytest.mark.parametrize(
    ("written", "deviation"),
    [
        ("0.1 mm", Deviation(1e-4, False)),
        ("2 %", Deviation(0.02, True)),
        ("0.5percent", Deviation(0.005, True)),
        ("0 mm", Deviation(0.0, False)),
        ({"value": "0.05 %", "name": "the blank"}, Deviation(0.0005, True, "the blank")),
    ],
)
def test_deviations(written: object, deviation: Deviation) -> None:
    found = parse_deviation(written, units.LENGTH)
    assert (found.relative, found.name) == (deviation.relative, deviation.name)
    assert found.amount == pytest.approx(deviation.amount, rel=1e-12)


@pytest.mark.parametrize(
    "written",
    [
        "-1 %",
        "-1 mm",
        "3 N",
        "2",
        2,
        "% 2",
        {"value": "2 %"},
        {"value": "2 %", "name": ""},
        {"value": "2 %", "nam": "x"},
    ],
)
def test_invalid_deviation_errors(written: object) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse_deviation(written, units.LENGTH)


def test_a_relative_deviation_is_of_the_size() -> None:
    assert Deviation(0.02, True).of(-3.0) == pytest.approx(0.06)
    assert Deviation(0.02, False).of(-3.0) == 0.02


@pytest.mark.parametrize(
    ("written", "value"), [("135 N m", 135.0), ("20 kN", 2e4), (3, 3.0), ("3", 3.0), ("40 mm", 0.04)]
)
def test_conditions(written: str | float, value: float) -> None:
    assert parse_condition(written) == pytest.approx(value)


@pytest.mark.parametrize("written", ["135 Xm", "torque", "100 rpm", "20 degC", "1,5 mm"])
def test_invalid_condition_errors(written: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse_condition(written)


def test_addresses_and_places() -> None:
    assert kind_of("tool.segment[*].core.density") is units.DENSITY
    assert kind_of("accelerometer.mass") is units.MASS
    with pytest.raises(ValueError, match=r'names an unknown quantity "lenght" \(did you mean "length"\?\)'):
        kind_of("tool.segment[0].lenght")
    with pytest.raises(ValueError, match="is not an address"):
        kind_of("tool length")
    position = Position("a position")
    assert position.read("end", None) == "end"
    assert position.read("0 mm", None) == 0.0
    with pytest.raises(ValueError, match='"-1 mm", expected a distance from the tip-side end'):
        position.read("-1 mm", None)


def test_suggestions() -> None:
    assert did_you_mean("Lenght", ["length", "density"]) == ' (did you mean "length"?)'
    assert did_you_mean("xyz", ["length", "density"]) == ""
    assert one_of([]) == "nothing: there is none"
    assert one_of(map(str, range(20))).endswith("and 8 more")
