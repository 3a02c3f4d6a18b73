"""Declarations of fields: what follows from them agrees with the core's tables, the documentation and campaigns."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from oracle.tables import CONE_COLUMNS, GROUND_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS
from receptance import (
    CARBIDE,
    STEEL,
    ColletJoint,
    GroundSpring,
    MicroslipJoint,
    Mode,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
)
from receptance.campaign.keys import element_keys
from receptance.model.fields import Element, Member, Number

SHANK = Section(outer_diameter=0.012, inner_diameter=0.004, material=CARBIDE, core=STEEL)
SLEEVE = Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL)
POINT = PointJoint(k_y=3e8, k_theta=4e4, c_theta=0.5, loss_factor=0.1)
ELEMENTS: list[Element] = [
    STEEL,
    Segment(length=0.1, outer_diameter=0.02, material=STEEL),
    Segment(length=0.1, outer_diameter=0.02, inner_diameter=0.01, material=STEEL, core=CARBIDE, shear="hutchinson"),
    SHANK,
    POINT,
    SpreadJoint(length=0.03, shank=SHANK, sleeve=SLEEVE, k_y=5e8, k_theta=2e4, points=3),
    ColletJoint(inner=POINT, outer=POINT, mass=0.1, inertia=1e-5),
    MicroslipJoint(k_y=5e8, k_theta=1e5, slip_theta=0.1, level=2.0),
    GroundSpring(k_y=1e7, length=0.02),
    PointMass(mass=0.01),
    Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1),
]
NAMES = [f"{index}-{type(element).__name__}" for index, element in enumerate(ELEMENTS)]


@pytest.mark.parametrize(
    ("element", "names", "nodes"),
    [
        (ELEMENTS[2], CONE_COLUMNS, 2),
        (POINT, JOINT_COLUMNS, 2),
        (PointMass(mass=1.0), MASS_COLUMNS, 1),
        (GroundSpring(k_y=1e7), GROUND_COLUMNS, 1),
    ],
)
def test_columns_are_those_of_the_core(element: Element, names: tuple[str, ...], nodes: int) -> None:
    """The oracle of 50 digits names the columns of its tables itself."""
    own = [name.replace("core_", "core.").removesuffix("_model") for name in names[nodes:]]
    addresses = [column.address or column.path[-1] for column in element.layout]
    assert addresses == own


# A mode's frequency goes to the core in rad/s.
@pytest.mark.parametrize("element", ELEMENTS[:-1], ids=NAMES[:-1])
def test_an_address_leads_to_its_column(element: Element) -> None:
    columns = element.columns
    assert len(columns) == len(element.layout)
    for address, index in element.places.items():
        changed = element.with_values({address: 1.01 * columns[index]}).columns
        assert [i for i, (new, old) in enumerate(zip(changed, columns, strict=True)) if new != old] in ([index], [])


@pytest.mark.parametrize("element", ELEMENTS, ids=NAMES)
def test_numbers_are_refused_out_of_their_bounds(element: Element) -> None:
    for name, field in element.declared.items():
        if not isinstance(field, Number):
            continue
        quantity = field.quantity
        wrong = [quantity.above, quantity.least - 1e-3, quantity.most + 1e-3, math.nan]
        for value in (one for one in wrong if not math.isinf(one)):
            change: dict[str, Any] = {name: value}
            with pytest.raises(ValueError, match=f"{name} is .*, expected"):
                replace(element, **change)  # type: ignore[type-var]
        text: dict[str, Any] = {name: "3 mm"}
        with pytest.raises(TypeError, match=f"{name} is '3 mm', expected a finite number"):
            replace(element, **text)  # type: ignore[type-var]


@pytest.mark.parametrize("element", ELEMENTS, ids=NAMES)
def test_every_field_is_documented_where_the_class_is(element: Element) -> None:
    document = type(element).__doc__ or ""
    assert "{fields}" not in document
    for name, field in element.declared.items():
        assert f"    {name} : " in document
        assert field.doc.split(";")[0][1:30] in " ".join(document.split())


@pytest.mark.parametrize("element", ELEMENTS, ids=NAMES)
def test_a_campaign_has_the_same_keys(element: Element) -> None:
    table = element_keys(type(element))
    expected = [name for name in element.declared if name != "name"] + ["tolerance"] * element.toleranced
    assert list(table.declared) == expected
    for name, field in element.declared.items():
        if isinstance(field, Member) or name == "name":
            continue
        assert table.declared[name].doc == field.doc
        assert (name in table.defaults) == hasattr(type(element), name)
