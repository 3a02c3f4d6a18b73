"""The registry of units against pint, a program of its own, on random expressions."""

from __future__ import annotations

import functools
import math
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from receptance import units
from receptance.units import Unit, UnitError

pint = pytest.importorskip("pint", reason="the reference of the units is pint: pip install '.[test]'")

_LINES = [line.split(" = ") for line in units._DEFINITIONS.strip().splitlines()]
NAMES = [name for first, _, *others in _LINES for name in (first, *others) if not name.endswith("-")]
PREFIXES = ["", *(name.removesuffix("-") for first, _, *others in _LINES for name in (first, *others) if "-" in name)]


@functools.cache
def _reference() -> Any:
    registry = pint.UnitRegistry(None)
    registry.load_definitions(units._DEFINITIONS.strip().splitlines())
    return registry


def _by_pint(text: str) -> Unit:
    base = (_reference().Quantity(1.0, "") * _reference().parse_expression(units._plain(text))).to_base_units()
    powers = {name.strip("[]"): float(power) for name, power in dict(base.dimensionality).items()}
    dimension = tuple(sorted((name, power) for name, power in powers.items() if power))
    return Unit(text, float(base.magnitude), dimension)


def _agree(text: str) -> None:
    found, expected = units._read(text), _by_pint(text)
    assert found.factor == pytest.approx(expected.factor, rel=1e-13), text
    assert dict(found.dimension) == pytest.approx(dict(expected.dimension)), text


_NUMBER = st.sampled_from(["2", "10", "2.25", "1e-3", ".5", "-2", "-0.5"])
# As a prefix and gram, kilogram is its own definition for pint, whose registry then recurses without end.
_CIRCULAR = {("kilo", "gram"), ("kilo", "g"), ("k", "gram")}
_UNIT = (
    st.tuples(st.sampled_from(PREFIXES), st.sampled_from(NAMES)).filter(lambda pair: pair not in _CIRCULAR).map("".join)
)
_POWERED = st.builds(
    str.__add__, _UNIT, st.sampled_from(["", "", "^2", "**3", "^-1", "**(-2)", "^0.5".replace("0.5", "(1.5)")])
)


def _joined(parts: list[str], signs: list[str]) -> str:
    text = parts[0]
    for sign, part in zip(signs, parts[1:], strict=False):
        text += (" " if part.startswith("-") and sign in (" ", "*") else sign) + part.lstrip("-" if sign == " " else "")
    return text


_OPERAND = st.recursive(
    _POWERED,
    lambda inner: st.builds(
        lambda number, parts, signs, power: f"({number} {_joined(parts, signs)}){power}",
        st.one_of(st.just("1"), _NUMBER),
        st.lists(inner, min_size=1, max_size=3),
        st.lists(st.sampled_from([" ", "*", "/", " / ", " * "]), min_size=3, max_size=3),
        st.sampled_from(["", "", "^2", "^-1"]),
    ),
    max_leaves=5,
)


@given(st.lists(_OPERAND, min_size=1, max_size=4), st.lists(st.sampled_from([" ", "*", "/"]), min_size=4, max_size=4))
@example(["1", "N", "m"], ["/", " ", " ", " "])
@example(["V", "(-2.25 mV/N)"], ["/"] * 4)
def test_expressions(parts: list[str], signs: list[str]) -> None:
    text = _joined(parts, signs)
    assume(len(units._plain(text)) <= units._LONGEST_UNIT)
    try:
        expected = _by_pint(text).factor
    except (OverflowError, ZeroDivisionError):
        expected = math.inf
    assume(1e-250 < abs(expected) < 1e250)
    _agree(text)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_with_every_prefix(name: str) -> None:
    for prefix in PREFIXES:
        if (prefix, name) not in _CIRCULAR:
            _agree(prefix + name)


@pytest.mark.parametrize("name", ["newtons", "kilometres", "inches".replace("es", "s"), "millinewtons", "seconds"])
def test_plurals(name: str) -> None:
    _agree(name)


@pytest.mark.parametrize("name", ["Ns", "Pas", "ms^", "kNs/m", "rads", "apples", "kk", "kkm", "mmm", "s_", "e"])
def test_symbols_have_no_plural_and_units_one_prefix(name: str) -> None:
    """pint takes Ns for newtons, where a newton second is meant."""
    with pytest.raises(UnitError, match="not understood"):
        units.parse_unit(name)
