"""Priors, laws and profiles in campaign files."""

from __future__ import annotations

import json
import math

import pytest

from campaign_text import TEXT, changed, load
from receptance import campaign

TRUE = {"joint.k_y": 3e8, "joint.k_theta": 1e5}


@pytest.fixture(name="text")
def consistent(tmp_path):
    """The campaign with natural frequencies that a joint can have."""
    loaded = load(tmp_path, TEXT)
    first, second = loaded.measurements["short"].assembly.replace(TRUE).natural_frequencies(2e4)[:2]
    return changed(('"2500 Hz", "10000 Hz"', f'"{float(first)!r} Hz", "{float(second)!r} Hz"'))


def test_the_json_has_errors_and_profiles(tmp_path, text):
    found = load(tmp_path, text).identify().to_dict()
    assert json.loads(json.dumps(found)) == found
    assert set(found["profiles"]) == set(found["parameters"])
    assert not set(found["errors"]) & set(found["parameters"])
    assert all(one["statement"] for one in found["profiles"].values())


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (', power_of = "torque"', "power_of: is given without `reference`"),
        (', reference = "135 N m"', "reference: is given without `power_of`"),
        (', power_of = "torque", reference = "0 N m"', "reference is 0"),
        (', free = true, individual = "5 %"', "one of the two"),
        (", follows = {'joint.k_ytheta' = 0.5}", "is given without `power_of` and `individual`"),
    ],
)
def test_mistakes_in_laws(tmp_path, extra, words):
    text = changed_unknown(extra)
    with pytest.raises(campaign.CampaignError, match=words):
        load(tmp_path, text)


def test_a_law_follows_a_condition(tmp_path):
    text = changed_unknown(', power_of = "tool.segment[0].length", reference = "60 mm", exponent = [-1, 1]')
    loaded = load(tmp_path, text.replace('role = "hold out"', 'role = "identify"'))
    found = loaded.identify()
    assert "joint.k_y ~ tool.segment[0].length" in found.values
    torque = changed_unknown(', power_of = "torque", reference = "135 N m"')
    with pytest.raises(campaign.CampaignError, match="no condition 'torque'"):
        # The long assembly has no torque.
        load(tmp_path, torque.replace('role = "hold out"', 'role = "identify"')).identify()


def test_prior_weight_follows_its_deviation(tmp_path, text):
    line = next(row for row in text.splitlines() if row.startswith('"joint.k_theta"'))
    prior = ', prior = { value = "9e4 N m/rad", spread = "0.01 %" } }'
    known = load(tmp_path, text.replace(line, line.rstrip(" }") + prior)).identify()
    free = load(tmp_path, text).identify()
    assert known.values["joint.k_theta"] == pytest.approx(9e4, rel=1e-3)
    assert free.values["joint.k_theta"] == pytest.approx(1e5, rel=1e-3)
    # Errors of dimensions cannot change a known value: the interval is that of the prior.
    share = known.standard_errors["joint.k_theta"] / known.values["joint.k_theta"]
    assert share == pytest.approx(1e-4, rel=0.1)
    assert free.standard_errors["joint.k_theta"] > 3.0 * known.standard_errors["joint.k_theta"]


@pytest.mark.parametrize(
    ("spread", "expected"),
    [("30 %", 0.3), ("factor 3", math.log(3.0)), ("1e8 N/m", 0.5), ("100 N/um", 0.5)],
)
def test_spreads_of_priors(tmp_path, spread, expected):
    loaded = load(tmp_path, changed_unknown(f', prior = {{ value = "2e8 N/m", spread = "{spread}" }}'))
    prior = next(one.prior for one in loaded.unknowns if one.address == "joint.k_y")
    assert prior.mean == 2e8
    assert prior.standard_deviation == pytest.approx(expected)


def test_prior_of_a_fitted_value(tmp_path):
    extra = ', scale = "linear", prior = { value = "2e8 N/m", spread = "30 %" }'
    prior = next(one.prior for one in load(tmp_path, changed_unknown(extra)).unknowns if one.address == "joint.k_y")
    assert prior.standard_deviation == pytest.approx(6e7)


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        ('{ value = "2e8 N m", spread = "30 %" }', "unknowns.*joint.k_y.*expected a stiffness"),
        ('{ value = "2e8 N/m", spread = "thirty" }', "thirty"),
        ('{ value = "2e8 N/m", spread = "factor 0.5" }', "a number above one"),
        ('{ value = "2e8 N/m", spread = "0 %" }', "standard_deviation is 0"),
        ('{ value = "2e8 N/m" }', "spread"),
        ('{ value = "2e8 N/m", spread = "factor 3" }, scale = "linear"', "a factor needs the scale"),
    ],
)
def test_mistakes_in_priors(tmp_path, prior, words):
    with pytest.raises(campaign.CampaignError, match=words):
        load(tmp_path, changed_unknown(f", prior = {prior}"))


def test_a_prior_needs_standard_deviations(tmp_path):
    text = changed_unknown(', prior = { value = "2e8 N/m", spread = "30 %" }')
    text = text.replace(
        'frequencies = ["2500 Hz", "10000 Hz"]\nstandard_deviation = "2 Hz"', 'frequencies = ["2500 Hz", "10000 Hz"]'
    )
    text = "\n".join(line for line in text.splitlines() if not line.startswith("tolerance"))
    with pytest.raises(campaign.CampaignError, match="standard deviations"):
        load(tmp_path, text).identify()


def changed_unknown(extra: str) -> str:
    line = next(row for row in TEXT.splitlines() if row.startswith('"joint.k_y"'))
    return TEXT.replace(line, line.rstrip(" }") + extra + " }")
