"""The packaged ER32 campaign has the values of the printed tables and the results of the study."""

from __future__ import annotations

import tomllib

import pytest

from er32_bias import ChanceModel
from er32_joints import Resolution
from er32_tables import assembly, load
from receptance import campaign, examples

TORQUE = 135.0


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> campaign.Campaign:
    folder = tmp_path_factory.mktemp("er32")
    examples.write("er32", folder)
    return campaign.load(folder)


def test_values_equal_the_published_values(read: campaign.Campaign) -> None:
    published, resolution = load(), Resolution()
    expected = {}
    for mount in published.mounts:
        reading = published.reading(mount.diameter_mm, TORQUE).frequency_hz
        rows = [("medium", mount.overhang_mm, reading)]
        rows += [
            ("short" if t.overhang_mm < mount.overhang_mm else "long", t.overhang_mm, t.measured_hz)
            for t in published.transfers
            if t.diameter_mm == mount.diameter_mm
        ]
        for name, overhang_mm, frequency_hz in rows:
            expected[f"d{int(mount.diameter_mm)}_{name}"] = (mount, overhang_mm, frequency_hz)
    assert read.assemblies.keys() == read.measurements.keys() == expected.keys()
    for name, (mount, overhang_mm, frequency_hz) in expected.items():
        measured = read.measurements[name]
        assert (name in read.held_out) == (not name.endswith("medium"))
        assert measured.frequency_hz == pytest.approx(frequency_hz)
        spread = measured.standard_deviation
        assert spread == pytest.approx(resolution.standard_deviation(frequency_hz), rel=0.01)
        conditions = read.site(name).conditions
        assert conditions["overhang"] == pytest.approx(1e-3 * overhang_mm)
        assert conditions["insertion"] == pytest.approx(1e-3 * mount.insertion_mm)
        assert conditions["torque"] == TORQUE
        own = read.assemblies[name]
        blank, joint, holder = own.elements
        stiffness = own.get(f"{joint}.k_y"), own.get(f"{joint}.k_theta")
        # The study takes blank and holder's length from the tables.
        theirs = assembly(mount.diameter_mm, overhang_mm, *stiffness)
        lengths = [own.get(f"{holder}.segment[{i}].length") for i in range(4)]
        assert own.get(f"{blank}.segment[0].length") == pytest.approx(1e-3 * overhang_mm)
        assert sum(lengths) == pytest.approx(1e-3 * mount.holder_length_mm)
        assert own.natural_frequencies(13e3) == pytest.approx(theirs.natural_frequencies(13e3), rel=1e-9)


def test_the_tolerances_are_those_of_the_study(read: campaign.Campaign) -> None:
    chance = ChanceModel()
    materials = read.table.materials
    for name in ("carbide", "steel"):
        spread = materials[name].tolerance
        assert spread["youngs_modulus"].amount == pytest.approx(chance.deviation(f"{name} modulus"))
        assert spread["density"].amount == pytest.approx(chance.deviation(f"{name} density"))
    assert materials["nose"].tolerance["youngs_modulus"].amount == pytest.approx(
        chance.deviation("nose modulus factor")
    )
    for segment in read.table.parts["holder"].segments:
        assert segment.tolerance["outer_diameter"].amount == pytest.approx(chance.deviation("body diameter"))
    for name, described in read.assemblies.items():
        blank = next(iter(described.elements))
        own = [one.moves for one in read.tolerances[name] if f"{blank}.segment[0].length" in one.moves]
        assert [list(moved.values()) for moved in own] == [[pytest.approx(1e-3 * chance.overhang_mm)]]


def test_file_marks_published_and_assumed_values() -> None:
    text = examples.EXAMPLES["er32"].campaign
    assert "The holder's shape is NOT published" in text
    assert "inferred, not published" in tomllib.loads(text)["description"]
