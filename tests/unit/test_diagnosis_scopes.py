"""Scopes of errors of the measuring chain, records that contradict each other, and their notes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    campaign,
    examples,
)
from receptance.diagnosis import CATALOGUE, Model, diagnose
from receptance.diagnosis.causes import transfer
from receptance.diagnosis.changes import Scope, scopes_of
from receptance.diagnosis.measured_data import contradictions
from receptance.diagnosis.model import UndecidableError
from receptance.errors import ReceptanceWarning
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.io import read_frf, write
from variant_of_cause import variant_of

LINES = np.linspace(200.0, 6000.0, 400)
TIP, INSIDE, NOSE = Coordinate("tool", 0.0), Coordinate("tool", 0.003), Coordinate("holder", 0.02)
JOINT = [
    Unknown(address=f"joint.{field}", lower=low, upper=high)
    for field, (low, high) in {
        "k_y": (1e6, 1e11),
        "k_theta": (1e2, 1e8),
        "c_y": (1e-1, 1e6),
        "c_theta": (1e-4, 1e3),
    }.items()
]
TOLERANCES = [
    Tolerance(name="E", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True),
    Tolerance(name="rho", moves={"tool.segment[*].density": 0.003}, relative=True),
]
CHAIN = (
    "sensor_mass",
    "hammer_offset",
    "time_delay",
    "calibration_gain",
    "frequency_scale",
    "exponential_window",
    "wrong_quantity",
    "reversed_polarity",
)


def assembly(overhang: float, *points: GroundSpring) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    joint = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    return Assembly([tool, joint, holder], points)


def record(
    label: str, overhang: float, response: Coordinate, excitation: Coordinate, *points: GroundSpring, seed: int = 0
) -> Observation:
    """A record with 1 % of noise."""
    rng = np.random.default_rng([seed, *label.encode()])
    noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    values = assembly(overhang, *points).receptance(LINES, response=response, excitation=excitation)
    return Observation(
        assembly=assembly(overhang),
        frequency_hz=LINES,
        receptance=values * np.exp(noise),
        response=response,
        excitation=excitation,
        standard_deviation=0.01,
        label=label,
        configuration=f"{1e3 * overhang:.0f} mm",
    )


RECORDS = (
    record("a", 0.06, TIP, TIP),
    record("b", 0.06, INSIDE, TIP),
    record("c", 0.09, TIP, TIP),
    record("d", 0.09, TIP, NOSE),
)
MODEL = Model(RECORDS, tuple(JOINT), tuple(TOLERANCES), threads=1).with_shared_assemblies().with_witnesses()


def test_scopes_of_the_same_records_appear_once() -> None:
    names = [scope.name for scope in scopes_of(MODEL)]
    # Record b is the only one of its channel, and no scope has all but one.
    assert names == [
        "all",
        "configuration 60 mm",
        "configuration 90 mm",
        "response channel tool 0 mm",
        "response channel tool 3 mm",
        "record a",
        "record c",
        "record d",
    ]
    assert [scope.name for scope in scopes_of(replace(MODEL, observations=RECORDS[:1]))] == ["all"]
    at_nose = scopes_of(MODEL, lambda one: one.excitation == NOSE)
    assert [scope.name for scope in at_nose] == ["all"]


@pytest.mark.parametrize("id", CHAIN)
def test_every_cause_of_the_chain_acts_in_one_record(id: str) -> None:
    """And in no other: with a size, the residuals of the others stay as they are."""
    variants = [pair for pair in CATALOGUE[id].extensions(MODEL) if pair[0].name.endswith("record a")]
    assert variants
    for variant, extended in variants:
        # Hits at the very end of a part are moved into it first, by a few micrometres.
        null = MODEL if not variant.cause.parameters else extended
        base = null.problem.residual(null.task.variables.start)
        values = {
            one.name: one.lower + 0.6 * (one.upper - one.lower) for one in extended.unknowns[len(MODEL.unknowns) :]
        }
        residual = extended.problem.residual(extended.task.variables.vector_of(values))
        for label, before, after in zip(
            "abcd", null.problem.parts(base), extended.problem.parts(residual), strict=True
        ):
            change = np.max(np.abs(after - before))
            assert change > 1.0 if label == "a" else change == 0.0, (variant.name, label)


def test_a_record_with_the_name_of_a_configuration_is_one_record() -> None:
    """As in a campaign, where the first measurement of an assembly often has its name."""
    records = tuple(altered(one, label=one.configuration) if one.label in "ac" else one for one in RECORDS)
    model = Model(records, tuple(JOINT), threads=1).with_witnesses()
    extended = variant_of(model, "calibration_gain", "record 60 mm").apply(model)
    gained = [bool(mapping.addresses.count("observation.log_gain")) for mapping in extended.task.mappings]
    assert gained == [True, False, False, False]


def test_records_that_share_a_label_are_no_scope_of_their_own() -> None:
    records = tuple(altered(one, label="same") for one in RECORDS)
    model = Model(records, tuple(JOINT), threads=1).with_witnesses()
    assert [scope.kind for scope in scopes_of(model)].count("record") == 0
    with pytest.raises(UndecidableError, match="label each record differently"):
        Scope("response channel", ("tool", 0.003, "y")).limits(model)


def test_other_records_are_changed_as_far_as_they_are_in_the_scope() -> None:
    held_out = replace(MODEL, observations=(record("e", 0.06, INSIDE, TIP),))
    for name, sign in (
        ("all", -1.0),
        ("configuration 60 mm", -1.0),
        ("response channel tool 3 mm", -1.0),
        ("configuration 90 mm", 1.0),
        ("record a", 1.0),
    ):
        (changed,) = transfer(held_out, [variant_of(MODEL, "reversed_polarity", name)]).observations
        np.testing.assert_array_equal(changed.receptance, sign * held_out.observations[0].receptance, err_msg=name)


def test_a_change_of_the_data_is_tried_only_where_it_brings_its_records_closer() -> None:
    """Two reversed records of one channel are turned together; a model that is right has nothing to turn."""
    data = [altered(one, receptance=-one.receptance) if one.label in "cd" else one for one in RECORDS]
    causes = ["reversed_polarity", "wrong_quantity", "time_delay"]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=causes, threads=1)
    assert (verdict.verdict, [(one.id, one.variant) for one in verdict.causes]) == (
        "named",
        [("reversed_polarity", "configuration 90 mm")],
    )
    tried = [one.variant.name for one in verdict.selection.directions if one.cause.id == "reversed_polarity"]
    # Those of all records as well, because the misfit is far above 20, and neither of the two records alone.
    assert tried == ["configuration 90 mm", "all"]
    right = diagnose(RECORDS, JOINT, tolerances=TOLERANCES, causes=causes, threads=1)
    assert right.verdict == "adequate"
    assert not [one for one in right.selection.directions if one.cause.changes_data]


@pytest.mark.parametrize(
    ("factor", "ratio", "words"),
    [
        (1.25, 1.25, "second is 1.25 times first"),
        (-1.0, -1.0, "180° in the median"),
    ],
)
def test_records_that_contradict_each_other_are_said_first(factor: float, ratio: float, words: str) -> None:
    first = record("first", 0.06, TIP, INSIDE)
    # Hit and response are exchanged, which changes nothing.
    again = record("second", 0.06, INSIDE, TIP, seed=1)
    assert not list(contradictions([first, again]))
    wrong = altered(again, receptance=factor * again.receptance)
    (contradiction,) = contradictions([first, wrong, *RECORDS[2:]])
    values = contradiction.values
    assert (values["first"], values["second"]) == ("first", "second")
    assert values["ratio"] == pytest.approx(abs(ratio), abs=0.01)
    assert abs(values["phase_deg"]) == pytest.approx(180.0 if ratio < 0.0 else 0.0, abs=1.0)
    assert values["percent"] > 99.0
    assert (values["low_hz"], values["high_hz"]) == pytest.approx((200.0, 6000.0), abs=30.0)
    data = [first, wrong, *RECORDS[2:]]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["tool_density"], threads=1)
    assert words in verdict.warnings()[0]
    assert verdict.summary().index("contradict each other") < verdict.summary().index("Verdict")
    assert words not in " ".join(verdict.notes)


def test_a_file_that_was_copied_over_another_one_is_said_first() -> None:
    copied = altered(RECORDS[-1], receptance=RECORDS[0].receptance)
    assert copied.configuration != RECORDS[0].configuration
    data, causes = [*RECORDS[:-1], copied], ["tool_density", "exchanged_files"]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=causes, threads=1)
    assert "the same values" in verdict.undecidable["exchanged_files"]
    assert "same_values" in {reason.code for reason in verdict.reasons}
    assert f"{RECORDS[0].label} and {copied.label} have the same values" in verdict.warnings()[0]
    assert not verdict.causes


def test_a_held_out_file_that_is_a_copy_is_said_first() -> None:
    copied = altered(RECORDS[-1], receptance=RECORDS[0].receptance)
    held_out = Model((copied,), tuple(JOINT), tuple(TOLERANCES))
    verdict = diagnose(
        RECORDS[:-1], JOINT, tolerances=TOLERANCES, causes=["tool_density"], threads=1, held_out=held_out
    )
    assert f"{RECORDS[0].label} and {copied.label} have the same values" in verdict.warnings()[0]


def test_records_of_other_places_or_conditions_do_not_contradict_each_other() -> None:
    first = RECORDS[0]
    for other in (
        altered(first, label="other", configuration="elsewhere"),
        altered(first, label="other", conditions={"force": 20.0}),
        altered(first, label="other", response=INSIDE),
    ):
        assert not list(contradictions([first, altered(other, receptance=-other.receptance)]))


@pytest.mark.parametrize("label", ["long", "long2"])
def test_one_bad_record_of_two_of_a_campaign_is_named_and_written(tmp_path: Path, label: str) -> None:
    """The first one has the name of its assembly."""
    folder = tmp_path / "free"
    examples.write("free-free", folder)
    text = (folder / "campaign.toml").read_text(encoding="utf-8")
    table = re.search(r"\[measurements\.long\].*?(?=\n\[)", text, re.S)
    assert table is not None
    first = table[0].replace('role = "hold out"\n', "")
    second = first.replace("[measurements.long]", "[measurements.long2]").replace('"long.csv"', '"long2.csv"')
    frf = read_frf(folder / "long.csv")
    for name in ("long", "long2"):
        write(folder / f"{name}.csv", frf.with_(values=(1.25 if name == label else 1.0) * frf.values))
    (folder / "campaign.toml").write_text(text.replace(table[0], f"{first}\n{second}"), encoding="utf-8")
    read = campaign.load(folder / "campaign.toml")
    verdict = read.diagnose(causes=["calibration_gain", "time_delay", "sensor_mass"])
    assert (verdict.verdict, [(one.id, one.variant) for one in verdict.causes]) == (
        "named",
        [("calibration_gain", f"record {label}")],
    )
    assert "contradict each other" in verdict.warnings()[0]
    found = campaign.load(campaign.write_extended(read, verdict, folder / "extended.toml")).identify()
    assert found.values[f"calibration_gain.log_gain record {label}"] == pytest.approx(np.log(1.25), abs=0.01)


def test_a_suspension_at_two_places_is_found_with_its_places() -> None:
    ropes = [
        GroundSpring(part="holder", position=share * 0.13, k_y=8e5, c_y=20.0, name=name)
        for share, name in ((0.25, "left"), (0.75, "right"))
    ]
    data = [
        record(f"{1e3 * overhang:.0f} {where.part}", overhang, TIP, where, *ropes)
        for overhang in (0.06, 0.075, 0.09)
        for where in (TIP, NOSE)
    ]
    causes = ["suspension", "missing_mode", "calibration_gain", "contact_distribution"]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=causes, threads=1)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["suspension"])
    # On a holder that hardly bends other pairs of places are nearly as good, but their sum is not.
    stiffness = [verdict.causes[0].parameters[f"suspension.stiffness of rope {number}"][0] for number in (1, 2)]
    assert sum(stiffness) == pytest.approx(1.6e6, rel=0.1)


def strip(*diameters: float) -> Assembly:
    return Assembly(
        [Part([Segment(length=0.1, outer_diameter=d, material=STEEL) for d in diameters], name="strip")], []
    )


def test_flutes_are_only_thinner_and_only_on_a_tool() -> None:
    flutes, *_ = CATALOGUE["fluted_part"].extensions(MODEL)
    (diameter,) = [one for one in flutes[1].unknowns if one.name == "fluted_part.log_diameter"]
    assert diameter.upper == 0.0
    thicker, *_ = CATALOGUE["tip_diameter"].extensions(MODEL)
    (diameter,) = [one for one in thicker[1].unknowns if one.name == "tip_diameter.log_diameter"]
    assert diameter.lower == 0.0
    plain = strip(0.012)
    one = Observation(
        assembly=plain, frequency_hz=LINES, receptance=plain.receptance(LINES), standard_deviation=0.01, label="strip"
    )
    free = Model((one,), (Unknown(address="strip.segment[*].loss_factor", lower=1e-4, upper=0.1),), threads=1)
    with pytest.raises(UndecidableError):
        CATALOGUE["fluted_part"].extensions(free)
    ((variant, extended),) = CATALOGUE["tip_diameter"].extensions(free)
    (diameter,) = [one for one in extended.unknowns if one.name == "tip_diameter.log_diameter"]
    assert diameter.lower < 0.0 < diameter.upper
    assert "flute" not in f"{variant.meaning} {variant.remedy} {variant.cause.title}"


def test_causes_that_cannot_be_tried_are_in_the_text_by_reason() -> None:
    verdict = diagnose(
        RECORDS, JOINT, tolerances=TOLERANCES, causes=["flexible_body", "joint_amplitude", "tool_density"], threads=1
    )
    shown = verdict.tables()[-1]
    assert shown.title == "Causes that these data cannot show"
    assert {row[0] for row in shown.rows} == {"elastic body", "joint that depends on the amplitude"}
    text = verdict.summary(80)
    assert "no part is described as rigid" in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 80


def test_conjugate_files_of_a_campaign_are_named_and_read_as_such(tmp_path: Path) -> None:
    """The other sign of the exponent in time; the extended campaign has the line that the user would write."""
    folder = tmp_path / "free"
    examples.write("free-free", folder)
    for path in folder.glob("*.csv"):
        frf = read_frf(path)
        write(path, frf.with_(values=frf.values.conj()))
    with pytest.warns(ReceptanceWarning):
        read = campaign.load(folder / "campaign.toml")
    verdict = read.diagnose(causes=["wrong_quantity", "reversed_polarity", "frequency_scale"])
    extended = campaign.write_extended(read, verdict, folder / "extended.toml")
    assert (verdict.verdict, [(one.id, one.variant) for one in verdict.causes]) == (
        "named",
        [("wrong_quantity", "complex conjugate")],
    )
    assert "conjugate = true" in Path(extended).read_text(encoding="utf-8")
    assert campaign.load(extended).identify().adequacy.passed


def test_a_record_with_a_tool_that_slipped_has_no_wrong_name() -> None:
    """A clock that is off in that record alone would have nearly the same effect."""
    slipped = record("c", 0.0902, TIP, TIP, seed=3)
    stated = next(one for one in RECORDS if one.label == "c")
    data = [altered(one, receptance=slipped.receptance) if one is stated else one for one in RECORDS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, threads=1)
    assert verdict.verdict in ("unexplained", "suspected", "ambiguous")
    places = [alternative.explanation.place for alternative in verdict.alternatives[:3]]
    assert any("another overhang in the record c" in place for place in places), places


def test_a_record_in_other_units_is_a_gain_of_unusual_size() -> None:
    """A factor of 1000 between millimetres and metres."""
    data = [altered(one, receptance=1e3 * one.receptance) if one.label == "c" else one for one in RECORDS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, threads=1)
    assert (verdict.verdict, [(one.id, one.variant) for one in verdict.causes]) == (
        "suspected",
        [("calibration_gain", "record c")],
    )
    assert verdict.causes[0].parameters["calibration_gain.log_gain record c"][0] == pytest.approx(np.log(1e3), abs=0.01)
