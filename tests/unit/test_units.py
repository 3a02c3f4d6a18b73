"""Units as analysers spell them."""

from __future__ import annotations

from pathlib import Path

import pytest

from receptance.io import FileFormatError, read
from receptance.units import (
    FORMS,
    FRFKind,
    UnitError,
    channel_kind,
    form_name,
    frf_kind,
    frf_unit,
    parse_unit,
    suggested_unit,
)

G = 9.80665
LBF = 4.4482216152605


@pytest.mark.parametrize(
    ("text", "factor", "unit"),
    [
        ("m/N", 1.0, "m/N"),
        ("µm/N", 1e-6, "m/N"),
        ("μm / N", 1e-6, "m/N"),
        ("mm/kN", 1e-6, "m/N"),
        ("in/lbf", 0.0254 / LBF, "m/N"),
        ("m/s/N", 1.0, "m/s/N"),
        ("m/s^2/N", 1.0, "m/s^2/N"),
        ("(1/N)*(m/s²)", 1.0, "m/s^2/N"),
        ("m s^-2 N^-1", 1.0, "m/s^2/N"),
        ("m·s⁻²·N⁻¹", 1.0, "m/s^2/N"),
        ("1/kg", 1.0, "m/s^2/N"),
        ("g/N", G, "m/s^2/N"),
        ("G/lbf", G / LBF, "m/s^2/N"),
        ("mm/sec**2/N", 1e-3, "m/s^2/N"),
        ("rad/N", 1.0, "rad/N"),
        ("m/(N m)", 1.0, "m/(N m)"),
        ("rad/(Nm)", 1.0, "rad/(N m)"),
        ("deg/s/(N·mm)", 17.453292519943295, "rad/s/(N m)"),
        ("ms-2/N", 1.0, "m/s^2/N"),
        ("mms-2/N", 1e-3, "m/s^2/N"),
        ("ms-2/lbf", 1.0 / LBF, "m/s^2/N"),
    ],
)
def test_units_of_frfs(text: str, factor: float, unit: str) -> None:
    parsed = parse_unit(text)
    assert parsed.factor == pytest.approx(factor, rel=1e-12)
    kind = frf_kind(parsed)
    assert kind is not None
    assert frf_unit(kind) == unit


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("N", ("force", "N")),
        ("N·m", ("moment", "N m")),
        ("mils".removesuffix("s"), ("displacement", "m")),
        ("ft", ("displacement", "m")),
        ("in/s", ("velocity", "m/s")),
        ("mg", ("acceleration", "m/s^2")),
        ("mrad", ("rotation", "rad")),
        ("deg/sec", ("angular velocity", "rad/s")),
        ("rad/s^2", ("angular acceleration", "rad/s^2")),
        ("ms-2", ("acceleration", "m/s^2")),
        ("V/(10 mV/ms-2)", ("acceleration", "m/s^2")),
        ("ms", None),
        ("V", None),
        ("Pa", None),
        ("V^2", None),
        ("1", None),
        ("m/N", None),
    ],
)
def test_units_of_time_records(text: str, kind: tuple[str, str] | None) -> None:
    assert channel_kind(parse_unit(text)) == kind


def test_every_form_and_direction_has_a_unit() -> None:
    """Rad and m/(N m) over N included, which differ by the angle alone."""
    kinds = [FRFKind(form, row, column) for form in FORMS for row in ("y", "theta") for column in ("y", "theta")]
    units = [parse_unit(frf_unit(kind)) for kind in kinds]
    assert [frf_kind(unit) for unit in units] == kinds
    assert len({unit.dimension for unit in units}) == 12


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            " ",
            "bananas",
            "m//N",
            "(m",
            "m)",
            "m/",
            "/N",
            "m+N",
            "m - s",
            "m^2.5",
            "m^x",
            "m^",
            "s^99",
            "9**9**9",
            "()",
        ),
        *(
            "m^9^9^9",
            "m**2**9",
            "(" * 79,
            "m" * 81,
            "__import__('os')",
            "m;N",
            "1e999 m",
            "0 m",
            "m/0",
            "\x00",
            "m\n/N",
        ),
        *("m(s≤)", "²", "1_0", "7", "m@N"),
    ],
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(UnitError, match="not understood as a unit"):
        parse_unit(text)


@pytest.mark.parametrize(
    ("text", "factor"),
    [("g", G), ("mg", 1e-3 * G), ("V/(100 mV/g)", 10.0 * G), ("g/N", G), ("g/cm^3", 1e3), ("g m^2", 1e-3), ("kg", 1.0)],
)
def test_g_is_gravity_in_motions_and_a_gram_elsewhere(text: str, factor: float) -> None:
    assert parse_unit(text).factor == pytest.approx(factor, rel=1e-12)


def test_messages_for_mistakes() -> None:
    with pytest.raises(UnitError, match="a level in dB"):
        parse_unit("dB")
    with pytest.raises(UnitError, match=r"unknown: 'apples'"):
        parse_unit("m/apples")
    with pytest.raises(TypeError, match="expected a text"):
        parse_unit(3.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("g/lb", "g/lbf"),
        ("in/lb", "in/lbf"),
        ("G's", "G"),
        ("m/Ns2", "m/(N s^2)"),
        ("m/N s^2", "m/(N s^2)"),
        ("bananas", None),
        ("m/s^2/N", None),
        ("V", None),
        ("'" * 4000 + "s" * 4000, None),
    ],
)
def test_a_spelling_that_is_not_a_unit_of_the_field_names_the_right_one(text: str, meant: str | None) -> None:
    assert suggested_unit(text) == (f"; did you mean {meant!r}?" if meant else "")


@pytest.mark.parametrize("text", ["G's", "m/Ns2"])
def test_the_error_of_an_unknown_unit_names_the_right_spelling(text: str) -> None:
    with pytest.raises(UnitError, match=r"not understood as a unit.*did you mean"):
        parse_unit(text)


def test_the_error_of_a_unit_that_is_not_that_of_an_frf_names_the_right_spelling(tmp_path: Path) -> None:
    path = tmp_path / "tip.csv"
    path.write_text("frequency [Hz],real [g/lb],imag [g/lb]\n100,1,2\n200,2,3\n")
    with pytest.raises(FileFormatError, match=r"'g/lb' is not the unit of a receptance.*did you mean 'g/lbf'\?"):
        read(path)


def test_names_of_forms() -> None:
    assert [form_name(name) for name in ("Compliance", "mobility ", "INERTANCE")] == list(FORMS)
    with pytest.raises(ValueError, match="quantity is 'admittance', expected one of receptance, mobility, accelerance"):
        form_name("admittance")
    with pytest.raises(TypeError):
        form_name(None)  # type: ignore[arg-type]
