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


def test_an_absurd_limit_names_its_key(tmp_path: Path) -> None:
    """Without unknowns the prediction needs no fit, so that the check has no complaint about it."""
    text = TEXT.partition("[measurements.short]")[0] + '[prediction]\nupper = "7 GHz"\n'
    read = load(tmp_path, text.replace("[joints.joint]", '[joints.joint]\nk_y = "1e8 N/m"\nk_theta = "1e5 N m/rad"'))
    assert CampaignCheck(read).missing["predict"] == ""
    with pytest.raises(CampaignError, match=r"prediction\.upper: is 7e\+09 Hz for predictions: .*expected one near"):
        read.predict()
