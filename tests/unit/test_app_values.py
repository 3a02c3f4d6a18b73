"""The values of a part, joint or point in the campaign file, as a page shows and changes them."""

from __future__ import annotations

import pytest

from receptance import examples
from receptance.session.document import Document
from receptance.session.values import values_of


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensor")
    examples.write("forgotten-sensor", folder)
    return Document.open(folder, threads=1)


def value_at(document, assembly, element, *path):
    (value,) = [value for value in values_of(document, assembly, element) if value.path == path]
    return value


def test_a_part_has_its_numbers_those_of_its_assembly_and_its_materials(document):
    owners = dict.fromkeys(value.owner for value in values_of(document, "55 mm", "holder"))
    assert list(owners) == ["parts.holder", "materials.steel", "materials.carbide"]
    assert (
        value_at(document, "55 mm", "holder", "parts", "holder", "segments", 1, "tolerance", "length").text == "0.1 mm"
    )
    length = "tool.segment[0].length"
    assert value_at(document, "55 mm", "tool", "assemblies", "55 mm", "set", length).text == "55 mm"
    assert value_at(document, "55 mm", "tool", "materials", "carbide", "poisson_ratio").text == "0.22"


def test_a_joint_without_numbers_has_the_bounds_of_its_unknowns(document):
    keys = [(value.owner, value.key) for value in values_of(document, "40 mm", "joint")]
    assert keys[:2] == [('unknowns."joint.k_y"', "lower"), ('unknowns."joint.k_y"', "upper")]
    assert len(keys) == 2 * len(document.campaign.unknowns)


def test_every_value_is_at_its_path(document):
    for element in ("tool", "joint", "holder"):
        for value in values_of(document, "70 mm", element):
            assert document.with_value(value.path, value.parsed(value.text)).campaign is not None


@pytest.mark.parametrize(("typed", "parsed"), [("0.3", 0.3), ("[1, 2]", [1, 2]), ("0.3 of it", "0.3 of it")])
def test_numbers_stay_numbers_and_what_is_none_is_left_to_the_check(document, typed, parsed):
    ratio = value_at(document, "40 mm", "tool", "materials", "carbide", "poisson_ratio")
    assert ratio.parsed(typed) == parsed


def test_texts_stay_texts(document):
    material = value_at(document, "40 mm", "tool", "parts", "tool", "segments", 0, "material")
    assert material.parsed("7") == "7"


def test_a_mistake_is_found_at_its_key_alone(document):
    length = value_at(document, "40 mm", "tool", "parts", "tool", "segments", 0, "length")
    wrong = document.with_value(length.path, "long")
    (mistake,) = length.mistakes(wrong)
    assert '"long"' in mistake.text
    others = [value for value in values_of(wrong, "40 mm", "tool") if value.path != length.path]
    assert not any(value.mistakes(wrong) for value in others)
    assert length.mistakes(document) == []


def test_a_text_that_is_no_toml_has_no_values(document):
    assert values_of(document.with_text("[parts"), "40 mm", "tool") == []
