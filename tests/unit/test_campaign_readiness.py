"""What `check` says of a command, and what the command does; absurd limits of predictions."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign_text import TEXT, load
from receptance import campaign, examples
from receptance.campaign import CampaignCheck, CampaignError


@pytest.mark.parametrize("example", ["er32", "machine"])
def test_invert_is_ready_where_it_does_not_refuse(example: str, tmp_path: Path) -> None:
    examples.write(example, tmp_path)
    read = campaign.load(tmp_path)
    with pytest.raises(CampaignError) as error:
        read.invert()
    assert CampaignCheck(read).missing["invert"] == error.value.problems[0].text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'outer_diameter = "9.6 mm"',
            'outer_diameter = "1e-6 mm"',
            'segments[0].outer_diameter: is "1e-6 mm", less than',
        ),
        ('density = "7850 kg/m^3"', 'density = "7850 kg/mm^3"', 'density: is "7850 kg/mm^3", more than'),
        ('upper = "5 kHz"', 'upper = "7 GHz"', 'prediction.upper: is "7 GHz", more than 1e+09 Hz'),
        ('outer_diameter = "1 %"', 'outer_diameter = "1e6 %"', 'is "1e6 %", expected at most 1000 %'),
        ("[stability]", "[stability]\ndraws = 40000000", "draws: is 40000000, expected at most 10000"),
    ],
)
def test_an_absurd_magnitude_names_its_key_and_value(old: str, new: str, words: str, tmp_path: Path) -> None:
    examples.write("machine", tmp_path)
    text = (tmp_path / "campaign.toml").read_text()
    assert old in text
    with pytest.raises(CampaignError) as error:
        load(tmp_path, text.replace(old, new, 1))
    assert words in str(error.value)
    assert error.value.problems[0].line is not None


def test_an_absurd_limit_names_its_key(tmp_path: Path) -> None:
    """Without unknowns the prediction needs no fit, so that the check has no complaint about it."""
    text = TEXT.partition("[measurements.short]")[0] + '[prediction]\nupper = "700 MHz"\n'
    read = load(tmp_path, text.replace("[joints.joint]", '[joints.joint]\nk_y = "1e8 N/m"\nk_theta = "1e5 N m/rad"'))
    assert CampaignCheck(read).missing["predict"] == ""
    with pytest.raises(CampaignError, match=r"prediction\.upper: is 7e\+08 Hz for predictions: .*expected one near"):
        read.predict()


@pytest.mark.filterwarnings("ignore:Segment:receptance.ReceptanceWarning")
def test_draws_of_a_tip_that_cannot_be_evaluated_are_left_out(tmp_path: Path) -> None:
    examples.write("machine", tmp_path)
    text = (tmp_path / "campaign.toml").read_text().replace('outer_diameter = "1 %"', 'outer_diameter = "1000 %"', 1)
    read = load(tmp_path, text.replace("[stability]", '[stability]\ndraws = 40\nstep = "4000 rpm"'))
    found = read.stability(cuts=["slot"])
    assert any("of 40 draws cannot be evaluated" in note for note in found.notes)
