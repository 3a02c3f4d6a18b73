"""A shank in the bore of a holder: geometry, addresses and errors of the parts as drawn, and refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_text import TEXT, load
from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Section, Segment, SpreadJoint, insert
from receptance.campaign import Campaign, CampaignError
from receptance.model.addresses import edges_of
from receptance.model.insertion import with_insertion

SEED = 20261129
CASES = range(40)


def segment(length: float, outer: float, end: float | None = None, **others: Any) -> Segment:
    """A segment with lengths in mm, of steel unless stated."""
    values = {"length": length, "outer_diameter": outer, "end_outer_diameter": end}
    values |= {key: others.pop(key) for key in ("inner_diameter", "end_inner_diameter") if key in others}
    metres: dict[str, Any] = {key: None if value is None else 1e-3 * value for key, value in values.items()}
    return Segment(**metres, **{"material": STEEL, **others})


def drawn(rng: np.random.Generator) -> tuple[Part, Part, float]:
    """Return a tool with flutes and a shank, a holder of cones and cylinders with a bore, and an insertion."""
    shank = rng.uniform(8.0, 20.0)
    angle = rng.choice([0.0, 0.02])  # of a conical bore, which is wider at the mouth
    lengths = rng.uniform(8.0, 40.0, size=int(rng.integers(1, 4)))
    free, inside = rng.uniform(5.0, 30.0), rng.uniform(0.5, 1.0) * sum(lengths)
    flutes = segment(rng.uniform(10.0, 40.0), rng.uniform(5.0, 25.0), material=CARBIDE)
    narrow = None if angle == 0.0 else shank - angle * inside
    tool = [flutes, segment(free, shank, material=CARBIDE), segment(inside, shank, narrow, material=CARBIDE)]
    holder, depth = [], 0.0
    for length in lengths:
        bores = [shank - angle * x for x in (depth, depth + length)]
        outer, end = rng.uniform(30.0, 50.0, size=2)
        of_bore = {"inner_diameter": bores[0], "end_inner_diameter": None if angle == 0.0 else bores[1]}
        holder.append(segment(length, outer, None if rng.random() < 0.4 else end, **of_bore))
        depth += length
    holder.append(segment(30.0, 60.0))
    # A cone fits where the insertion is that of its whole length alone.
    length = inside if angle else rng.uniform(2.0, min(depth, free + inside))
    return Part(tool, name="tool"), Part(holder, name="holder"), 1e-3 * length


def section(part: Part, x: float) -> tuple[Segment, float, float]:
    """Return segment, outer and inner diameter at a place of a part."""
    edges = edges_of(part)
    number = next(i for i, edge in enumerate(edges[1:]) if x <= edge)
    place = part.segments[number]
    return place, *place.at((x - edges[number]) / place.length)


@pytest.mark.parametrize("case", CASES)
def test_every_place_has_the_section_of_the_drawing(case: int) -> None:
    rng = np.random.default_rng((SEED, case))
    print(f"seed {SEED}, case {case}")
    tool, holder, length = drawn(rng)
    made = insert(tool, holder, length)
    assert made.tool.length == pytest.approx(tool.length - length, rel=1e-12)
    assert made.holder.length == pytest.approx(holder.length, rel=1e-12)
    assert made.tool.mass + made.holder.mass == pytest.approx(tool.mass + holder.mass, rel=3e-3)
    for x in rng.uniform(0.0, made.tool.length, size=5):
        assert section(made.tool, x)[1:] == pytest.approx(section(tool, x)[1:])
    for x in rng.uniform(0.0, holder.length, size=20):
        _, outer, bore = section(holder, x)
        place, *diameters = section(made.holder, x)
        if x <= length:
            assert diameters == pytest.approx([outer, section(tool, made.tool.length + x)[1]])
            assert place.core == CARBIDE
        else:
            assert diameters == pytest.approx([outer, bore])
            assert place.core is None


@pytest.mark.parametrize("case", CASES)
def test_moves_are_those_of_parts_drawn_with_another_value(case: int) -> None:
    """Parts are drawn again with each value changed, inserted again, and compared with the moves."""
    rng = np.random.default_rng((SEED, case, 1))
    print(f"seed {SEED}, case {case}")
    tool, holder, length = drawn(rng)
    joint = PointJoint(k_y=5e8, k_theta=1e5, name="joint")
    before = Assembly([tool, joint, holder])
    made, insertion = with_insertion(before, length)
    for address in before.parameters:
        field = address.rpartition(".")[2]
        # A bore in the shank is no dimension of the holder.
        if address.startswith("joint") or (address.startswith("tool") and "inner" in field):
            continue
        step = 1e-6 * max(before.get(address), 1e-3)
        again, _ = with_insertion(before.replace({address: before.get(address) + step}), length)
        if again.parameters != made.parameters:  # the shank ended between two segments, and now ends in one
            longer = (again.parts["tool"].length - made.parts["tool"].length) / step
            assert (longer, insertion.moved(address)["tool.segment[1].length"]) == (pytest.approx(1.0, abs=1e-4), 1.0)
            continue
        slopes = {own: (again.get(own) - made.get(own)) / step for own in made.parameters}
        if field == "length":  # the diameters of a cone at a cut remain
            slopes = {own: slope for own, slope in slopes.items() if own.endswith("length")}
        expected = insertion.moved(address)
        for own, slope in slopes.items():
            assert slope == pytest.approx(expected.get(own, 0.0), abs=1e-4), (address, own)


def test_bore_in_the_shank_is_right_in_bending_and_mass() -> None:
    shank = segment(60.0, 20.0, inner_diameter=6.0, material=CARBIDE)
    nose = segment(80.0, 50.0, inner_diameter=20.0)
    made = insert(Part([shank], name="tool"), Part([nose], name="holder"), 0.04)
    whole = shank.mass + nose.mass
    assert made.tool.mass + made.holder.mass == pytest.approx(whole, rel=1e-12)
    core = made.holder.segments[0].core
    assert core is not None
    assert core.youngs_modulus * 0.02**4 == pytest.approx(CARBIDE.youngs_modulus * (0.02**4 - 0.006**4))


TOOL = Part([segment(30.0, 10.0), segment(50.0, 12.0)], name="tool")
HOLDER = Part(
    [segment(45.0, 40.0, inner_diameter=12.0), segment(20.0, 40.0, inner_diameter=16.0), segment(10.0, 40.0)],
    name="holder",
)


@pytest.mark.parametrize(
    ("tool", "holder", "length", "words"),
    [
        (TOOL, HOLDER, 0.046, "46 mm, longer than the bore of holder for the shank of 12 mm, which is 45 mm deep"),
        (TOOL, HOLDER, 0.046, r"behind it holder.segment\[1\] has a bore of 16 mm"),
        (TOOL, HOLDER, 0.051, "51 mm, longer than the shank of tool, which is 50 mm long, .* step from 10 mm to 12 mm"),
        (TOOL, Part(HOLDER.segments[1:]), 0.01, r"shank of tool has 12 mm and holder.segment\[0\] has a bore of 16 mm"),
        (TOOL, Part(HOLDER.segments[2:]), 0.01, r"shank of tool has 12 mm and holder.segment\[0\] has no bore"),
        (TOOL, Part(HOLDER.segments[:1]), 0.05, "50 mm, longer than the bore of holder, which is 45 mm deep"),
        (Part(TOOL.segments[1:]), HOLDER, 0.06, "longer than the shank of tool, .* is the whole tool"),
        (Part(TOOL.segments[1:]), HOLDER, 0.05, "the whole length of tool, expected a part that protrudes"),
        (TOOL, Part([segment(9.0, 11.0)]), 0.005, "has an outer diameter of 11 mm"),
        (TOOL, HOLDER, 0.0, "length is 0"),
    ],
)
def test_misfits_are_refused(tool: Part, holder: Part, length: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        insert(tool, holder, length)


def test_a_core_is_in_the_way() -> None:
    holder = Part([replace(HOLDER.segments[0], core=STEEL)])
    with pytest.raises(ValueError, match=r"holder.segment\[0\] has a core already"):
        insert(TOOL, holder, 0.02)


def test_holders_without_a_bore_can_be_bored() -> None:
    made = insert(TOOL, Part([segment(60.0, 40.0)]), 0.02, bore_solid=True)
    assert [(one.inner_diameter, one.core) for one in made.holder.segments] == [(0.012, STEEL), (0.0, None)]


def test_a_spread_joint_has_the_insertion_itself() -> None:
    joint = SpreadJoint(
        length=0.04,
        shank=Section(outer_diameter=0.012, material=STEEL),
        sleeve=Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL),
        k_y=1e9,
    )
    with pytest.raises(ValueError, match="is a SpreadJoint, which has the shank and the sleeve"):
        with_insertion(Assembly([TOOL, joint, HOLDER]), 0.02)


# Campaigns ------------------------------------------------------------------------------------------------------------

FORTY = 'chain = ["tool", "joint", "holder"]\n'
DRAWN = (
    TEXT.replace('length = "60 mm"', 'length = "100 mm"')
    .replace('core = "carbide"\n', "")
    .replace('length = "40 mm"', 'length = "55 mm"')
    .replace('"tool.segment[0].length" = "90 mm"', '"tool.segment[0].length" = "130 mm"')
    .replace('"tool.segment[0].length" = "120 mm"', '"tool.segment[0].length" = "160 mm"')
    .replace(FORTY, f'{FORTY}insertion = "40 mm"\n')
)
"""The campaign with the tool and the holder as drawn, whose bore is 15 mm deeper than the insertion."""
DIVIDED = TEXT.replace(
    'core = "carbide"\n',
    'core = "carbide"\n\n[[parts.holder.segments]]\nlength = "15 mm"\nouter_diameter = "50 mm"\n'
    'inner_diameter = "12 mm"\nmaterial = "steel"\n',
)
"""The same campaign, divided by hand."""


def read(tmp_path: Path, text: str) -> Campaign:
    tmp_path.mkdir(exist_ok=True)
    return load(tmp_path, text)


def test_campaign_is_that_of_parts_divided_by_hand(tmp_path: Path) -> None:
    inserted, divided = read(tmp_path / "inserted", DRAWN), read(tmp_path / "divided", DIVIDED)
    for name, assembly in divided.assemblies.items():
        made = inserted.assemblies[name]
        assert made.parameters == assembly.parameters
        for address in made.parameters:
            assert made.get(address) == pytest.approx(assembly.get(address), rel=1e-9), address
        own = {one.name: one.moves for one in divided.tolerances[name]}
        for error in inserted.tolerances[name]:
            moves = dict(error.moves)
            # By hand the bore has no tolerance; as drawn the shank in it is that of the tool.
            if error.name.endswith("outer_diameter") and "tool" in error.name:
                assert moves.pop("holder.segment[0].inner_diameter") == pytest.approx(6e-6)
            by_hand = error.name.replace("holder.segments[1]", "holder.segments[2]")
            assert moves == pytest.approx(own.pop(by_hand)), error.name
        assert not own


def test_insertion_of_a_campaign_is_refused_with_its_place(tmp_path: Path) -> None:
    with pytest.raises(
        CampaignError, match=r"assemblies.short.insertion: the insertion is 60 mm, longer than the bore"
    ):
        read(tmp_path, DRAWN.replace('insertion = "40 mm"', 'insertion = "60 mm"', 1))


def without_insertion(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if not line.startswith("insertion = "))


def test_a_shank_that_fits_an_empty_bore_without_insertion_is_noted(tmp_path: Path) -> None:
    def notes(name: str, text: str) -> list[str]:
        return [note for note in read(tmp_path / name, text).notes if "fits the bore" in note]

    assert notes("inserted", DRAWN) == []
    assert notes("divided", DIVIDED) == []
    bare = without_insertion(DRAWN)
    noted = notes("bare", bare)
    assert len(noted) == DRAWN.count("insertion = ")
    for words in ("assemblies.short: the shank of tool, 12 mm", "bore of holder, 12 mm", 'state insertion = "'):
        assert words in noted[0]
    other = bare.replace('inner_diameter = "12 mm"', 'inner_diameter = "14 mm"')
    assert other != bare
    assert notes("wider", other) == []


def test_unknown_behind_the_insertion_is_refused(tmp_path: Path) -> None:
    text = f'{DRAWN}"holder.segment[1].density" = {{ lower = "7000 kg/m^3", upper = "9000 kg/m^3" }}\n'
    with pytest.raises(CampaignError, match=r"makes .holder.segment\[2\].density.: it ends in segment 0 of the holder"):
        read(tmp_path, text)


def test_unknown_of_the_shank_is_noted(tmp_path: Path) -> None:
    bounds = '{ lower = "13000 kg/m^3", upper = "16000 kg/m^3"'
    text = DRAWN.replace('tolerance = { youngs_modulus = "0.5 %", density = "45 kg/m^3" }', "")
    notes = read(tmp_path / "alone", f'{text}"tool.segment[0].density" = {bounds} }}\n').notes
    also = 'also = { "holder.segment[0].core.density" = 1 }'
    assert any(f"unless it has {also}" in note for note in notes)
    with_core = f'{text}"tool.segment[0].density" = {bounds}, {also} }}\n'
    assert not any("also" in note for note in read(tmp_path / "both", with_core).notes)
