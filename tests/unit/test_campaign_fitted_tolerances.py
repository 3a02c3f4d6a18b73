"""Tolerances as fitted parameters with priors, and laws, in campaign files."""

from __future__ import annotations

import json

import pytest

from campaign_text import TEXT, changed, load
from receptance import campaign

FIT = '\n[settings]\ntolerances = "fit"\nstarts = 3\n'


TRUE = {"joint.k_y": 3e8, "joint.k_theta": 1e5}


@pytest.fixture(name="text")
def consistent(tmp_path):
    """The campaign with natural frequencies that a joint can have."""
    loaded = load(tmp_path, TEXT)
    first, second = loaded.measurements["short"].observation.assembly.replace(TRUE).natural_frequencies(2e4)[:2]
    return changed(('"2500 Hz", "10000 Hz"', f'"{float(first)!r} Hz", "{float(second)!r} Hz"'))


def with_settings(text: str) -> str:
    assert "[settings]" not in text
    return text + FIT


def test_fitted_tolerances_give_the_same_intervals_where_data_say_nothing_of_them(tmp_path, text):
    propagated = load(tmp_path, text).identify()
    fitted = load(tmp_path, with_settings(text)).identify()
    # Two frequencies determine two stiffnesses whatever the errors are, so nothing is learnt of these.
    assert set(fitted.fit.errors) == set(propagated.propagation.errors)
    for name in fitted.fit.errors:
        assert fitted.fit.values[name] == pytest.approx(0.0, abs=0.02)
        assert fitted.fit.standard_errors[name] == pytest.approx(1.0, rel=0.02)
    for name, value in propagated.fit.values.items():
        assert fitted.fit.values[name] == pytest.approx(value, rel=1e-3)
        assert fitted.standard_errors()[name] == pytest.approx(propagated.standard_errors()[name], rel=0.02)
    assert propagated.profiles == {}
    assert set(fitted.profiles) == set(propagated.fit.values)


def test_predictions_are_the_same_too(tmp_path, text):
    propagated = load(tmp_path, text).predict()
    fitted = load(tmp_path, with_settings(text)).predict()
    for one, other in zip(propagated.frequencies, fitted.frequencies, strict=True):
        assert other.predicted_hz == pytest.approx(one.predicted_hz, rel=1e-4)
        assert other.scatter.total == pytest.approx(one.scatter.total, rel=0.03)


def test_the_json_has_errors_and_profiles(tmp_path, text):
    found = load(tmp_path, with_settings(text)).identify().as_dict()
    assert json.loads(json.dumps(found)) == found
    assert set(found["profiles"]) == set(found["parameters"])
    assert not set(found["errors"]) & set(found["parameters"])
    assert all(one["statement"] for one in found["profiles"].values())


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (', power_of = "torque"', "no `reference`"),
        (', reference = "135 N m"', "no `power_of`"),
        (', power_of = "torque", reference = "0 N m"', "reference is 0"),
        (', free = true, individual = "5 %"', "one of the two"),
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
    assert "joint.k_y ~ tool.segment[0].length" in found.fit.values
    torque = changed_unknown(', power_of = "torque", reference = "135 N m"')
    with pytest.raises(campaign.CampaignError, match="no condition 'torque'"):
        # The long assembly has no torque.
        load(tmp_path, torque.replace('role = "hold out"', 'role = "identify"')).identify()


def changed_unknown(extra: str) -> str:
    line = next(row for row in TEXT.splitlines() if row.startswith('"joint.k_y"'))
    return TEXT.replace(line, line.rstrip(" }") + extra + " }")
