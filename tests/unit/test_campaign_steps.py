"""Candidates in campaign files, the joint line by line, and the commands `next` and `invert`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, load, write
from command_line import call
from receptance import campaign, examples
from receptance.campaign import CampaignError

CANDIDATES = """
[candidates.again]
kind = "natural frequencies"
assembly = "short"
modes = [1, 2]
standard_deviation = "2 Hz"

[candidates."tip of longest"]
kind = "frf"
assembly = "longest"
sensor = "accelerometer"
step = "10 Hz"
upper = "6 kHz"
standard_deviation = "1 %"
floor = "0.3 %"
cost = 2.0

[candidates.nose]
kind = "frf"
assembly = "longest"
response = { part = "holder", position = "10 mm" }
lower = "100 Hz"
step = "10 Hz"
upper = "6 kHz"
standard_deviation = "1 %"
"""


@pytest.fixture(scope="module")
def free_free(tmp_path_factory):
    folder = tmp_path_factory.mktemp("free-free")
    examples.write("free-free", folder)
    return folder


@pytest.fixture(scope="module")
def load_campaign(free_free):
    return campaign.load(free_free)


def test_candidates_follow_the_file(tmp_path):
    read = load(tmp_path, TEXT + CANDIDATES)
    candidates = list(read.candidates.values())
    again, tip, nose = (candidate.observation for candidate in candidates)
    assert again.modes == (1, 2)
    assert again.standard_deviation.tolist() == [2.0, 2.0]
    assert again.configuration == "short"
    assert again.conditions == {"torque": 135.0}
    assert tip.frequency_hz[0] == 10.0
    assert tip.frequency_hz[-1] == 6000.0
    assert candidates[1].cost == 2.0
    assert "accelerometer" in tip.assembly.attachments
    assert nose.frequency_hz[0] == 100.0
    assert (nose.response.part, nose.response.position) == ("holder", pytest.approx(0.01))
    # The overhang errs anew in another assembly, the diameter is that of the blank; the sensor brings its own.
    names = [{one.name for one in c.tolerances} for c in candidates]
    assert names[0] & names[1] >= {"parts.tool.segments[0].outer_diameter", "materials.carbide.density"}
    assert any("longest" in name for name in names[1] - names[0])
    assert "sensors.accelerometer.mass" in names[1] - names[2]


def test_targets_are_unknowns_and_assemblies(load_campaign):
    identified = load_campaign.identify()
    found = load_campaign.next_measurement(identified, targets=["not_measured", "joint.k_y"])
    assert found.targets == ("not_measured: mode 1 [Hz]", "not_measured: mode 2 [Hz]", "joint.k_y")
    # The best candidate is the target itself; its overhang error is that of the candidate's clamping.
    assert found.best.label == "another overhang"
    assert found.best.expected["not_measured: mode 1 [Hz]"].shrink < 0.2
    with pytest.raises(CampaignError, match=r'"joint\.k_z" is neither an identified parameter nor an assembly'):
        load_campaign.next_measurement(identified, targets=["joint.k_z"])


def test_a_joint_line_by_line(load_campaign):
    found = load_campaign.invert()
    (one,) = found.values()
    assert one.terms == ("k_y", "k_theta")
    assert one.labels == ("short", "medium")
    for name, true in (("k_y", 4.2e8), ("k_theta", 1.6e5), ("c_y", 400.0), ("c_theta", 0.08)):
        assert one.start()[f"joint.{name}"] == pytest.approx(true, rel=0.03), name
    assert np.any(one.model_deviation[:, 0, 0] > 0.0)
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["joints"]["joint"]["measured"]
    with pytest.raises(CampaignError, match='no joint "taper" with unknown stiffnesses was measured'):
        load_campaign.invert("taper")


def test_a_joint_that_changes_is_solved_for_in_each_assembly(free_free, tmp_path):
    text = (free_free / "campaign.toml").read_text(encoding="utf-8")
    old = '"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }'
    assert text.count(old) == 1
    changed = text.replace(old, old.replace(" }", ", free = true }")).replace('file = "', f'file = "{free_free}/')
    (tmp_path / "campaign.toml").write_text(changed, encoding="utf-8")
    found = campaign.load(tmp_path).invert()
    assert set(found) == {"joint @ short", "joint @ medium"}
    assert all(one.terms == ("k_theta",) for one in found.values())
    assert any("joint.k_y is fixed at its start" in note for note in found.notes)


@pytest.mark.parametrize(
    ("old", "new", "output"),
    [
        (
            'assembly = "short"\nmodes',
            'assembly = "shrt"\nmodes',
            'candidates.again.assembly: is "shrt", which is not an',
        ),
        ("modes = [1, 2]", "modes = [1, 1]", "candidates.again: modes is"),
        ('step = "10 Hz"\nupper = "6 kHz"\nstandard_deviation = "1 %"\nfloor', 'step = "10 Hz"\nfloor', "upper"),
        ('part = "holder", position = "10 mm"', 'part = "holdr"', 'response.part: is "holdr"'),
        ('lower = "100 Hz"', 'lower = "10 kHz"', "has lines from 10000 to 6000 Hz, expected `lower` below `upper`"),
        ('lower = "100 Hz"\nstep = "10 Hz"', 'step = "1 mHz"', "give a larger `step`"),
    ],
)
def test_mistakes_in_candidates(tmp_path, old, new, output):
    assert CANDIDATES.count(old) == 1, old
    with pytest.raises(CampaignError) as caught:
        load(tmp_path, TEXT + CANDIDATES.replace(old, new))
    assert output in str(caught.value)


def test_menu_without_candidates_and_no_frf(tmp_path):
    read = load(tmp_path, TEXT)
    found = read.next_measurement()
    assert "at a longer overhang" in [one.label for one in found.ranking]
    assert any("[candidates.NAME]" in note for note in found.notes)
    with pytest.raises(CampaignError, match="no point joint with unknown stiffnesses was measured with an FRF"):
        read.invert()


def test_next_on_the_command_line(free_free, tmp_path, capsys):
    plot, written = tmp_path / "next.png", tmp_path / "next.json"
    assert call("next", free_free, "--plot", plot, "--json", written) == 0
    output = capsys.readouterr().out
    assert "1   short, at the nose" in output
    assert "with another overhang" in output
    assert max(map(len, output.splitlines())) <= 132
    assert plot.read_bytes().startswith(b"\x89PNG")
    found = json.loads(written.read_text())
    assert found["ranking"][0]["candidate"] == "short, at the nose"
    assert call("next", free_free, "--target", "joint.k_yy") == 2
    assert 'did you mean "joint.k_y"' in capsys.readouterr().err


def test_invert_on_the_command_line(free_free, tmp_path, capsys):
    plot, written = tmp_path / "joint.svg", tmp_path / "joint.json"
    assert call("invert", free_free, "--plot", plot, "--json", written) == 0
    output = capsys.readouterr().out
    assert "joint.k_theta" in output
    assert "of 1451" in output
    assert b"<svg" in plot.read_bytes()
    assert set(json.loads(written.read_text())["joints"]["joint"]["terms"]) == {"k_y", "k_theta"}
    assert call("invert", free_free, "--joint", "taper") == 2
    assert 'no joint "taper"' in capsys.readouterr().err
    assert not Path("joint.png").exists()


def test_threads_of_a_campaign_are_those_of_its_analyses(tmp_path, free_free, given_threads):
    """Three is neither the default nor the number of processors of most machines."""
    read = campaign.load(write(tmp_path), threads=3)
    assert read.threads == 3
    assert read.identify().task.threads == 3
    assert read.diagnose(causes=["tool_density"]).selection.workers == 3
    simulated = campaign.load(free_free, threads=3)
    given_threads.clear()
    simulated.invert()
    assert given_threads == {3}
