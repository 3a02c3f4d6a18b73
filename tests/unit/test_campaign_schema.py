"""The JSON Schema: validity, agreement with the reader, and the tables of the documentation."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from campaign_text import TEXT, changed
from receptance import examples
from receptance.campaign import field_tables, json_schema
from receptance.fit.parameters import FACTORS
from receptance.fit.unknowns import PARAMETERS
from receptance.units import QUANTITIES

jsonschema = pytest.importorskip("jsonschema")
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "campaign_keys.md"


def mistakes(data: Any) -> list[str]:
    validator = jsonschema.Draft202012Validator(json_schema())
    return [error.json_path for error in validator.iter_errors(data)]


def test_schema_is_valid() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())
    assert json.loads(json.dumps(json_schema())) == json_schema()
    assert "null" not in json.dumps(json_schema())
    references = {part.split('"')[0] for part in json.dumps(json_schema()).split('"$ref": "#/$defs/')[1:]}
    assert references == json_schema()["$defs"].keys()


@pytest.mark.parametrize("name", examples.EXAMPLES)
def test_the_examples_are_valid(name: str) -> None:
    data = tomllib.loads(examples.EXAMPLES[name].campaign)
    assert mistakes(data) == []


def test_schema_accepts_readable_files_and_rejects_others() -> None:
    assert mistakes(tomllib.loads(TEXT)) == []
    for old, new in (
        ('length = "60 mm"', 'lenght = "60 mm"'),
        ('length = "60 mm"', "length = 60"),
        ('length = "60 mm"', 'length = "60"'),
        ('length = "60 mm"', 'length = "mm"'),
        ('role = "hold out"', 'role = "holdout"'),
        ('{ mass = "0.02 g" }', '{ mass = "much" }'),
        ('kind = "natural frequencies"\nassembly = "short"', 'kind = "frq"\nassembly = "short"'),
        ("[joints.joint]", '[joints."a b"]'),
        ('standard_deviation = "2 Hz"', "modes = [0, 1]"),
        ('"1e10 N/m" }', '"1e10 N/m", scale = "cubic" }'),
    ):
        assert mistakes(tomllib.loads(changed((old, new)))), new


def test_every_quantity_shows_an_example() -> None:
    """The schema has an example of each quantity, except those that only unknowns of the measuring chain have."""
    found = json.dumps(json_schema())
    chain = {PARAMETERS[address.rpartition(".")[2]].name for address in FACTORS}
    for kind in QUANTITIES:
        if kind.unit and kind.name not in chain and not kind.name.startswith("a time"):
            assert json.dumps(kind.example)[1:-1] in found, kind.name


def test_every_field_is_explained() -> None:
    schema = json_schema()
    for name, table in schema["$defs"].items():
        assert table["description"], name
        for key, field in table["properties"].items():
            assert field.get("description"), f"{name}.{key}"


def test_the_documentation_shows_these_tables() -> None:
    """`receptance schema --markdown` makes them; what stands between the marks is its output."""
    text = DOCUMENT.read_text(encoding="utf-8")
    begin, end = "<!-- fields, begin: receptance schema --markdown -->\n", "<!-- fields, end -->"
    assert text.count(begin) == text.count(end) == 1
    shown = text.partition(begin)[2].partition(end)[0]
    assert shown.strip() == field_tables().strip()
    assert all(row.endswith("|") for row in shown.splitlines() if row.startswith("|"))
