"""A spindle in a campaign: from records of a blank and a tool to the joint and the lobes, and mistakes on the way."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import call, left
from machine_spindle import make_spindle, with_spindle
from receptance import Assembly, Coordinate, MeasuredPart, ModalPart, Mode, PointMass, campaign, io
from receptance.campaign import CampaignError
from receptance.coupling import SpindleModes, read_spindle, write_spindle
from receptance.report import Rejection
from spindle_campaign import (
    CAMPAIGN,
    GAUGE,
    LINES,
    TOOL_RECORDS,
    TRUE,
    campaign_text,
    measured,
    tool_on_machine,
    write_campaign,
)

SEED = 4
COARSE = LINES[::2]
HELD_OUT = """
[measurements.gauge_middle]
kind = "frf"
assembly = "gauge"
role = "hold out"
file = "gauge_middle.csv"
response = { part = "gauge", position = "40 mm" }
excitation = { part = "gauge", position = "40 mm" }
"""


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the campaign after `receptance spindle`."""
    folder = tmp_path_factory.mktemp("machine")
    write_campaign(folder, sd=0.002, seed=SEED, lines=COARSE)
    write_spindle(folder / "spindle.npz", campaign.load(folder, unidentified=True).spindle().identified)
    return folder


def copied(ready: Path, folder: Path, text: str = CAMPAIGN) -> Path:
    """Return a copy of the campaign with another text."""
    for file in ready.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "campaign.toml").write_text(campaign_text(text), encoding="utf-8")
    return folder


def test_from_records_to_lobes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    print(f"seed {SEED}")
    write_campaign(tmp_path, sd=0.001, seed=SEED, lines=COARSE)
    monkeypatch.chdir(tmp_path)
    assert call("check", ".", "--no-window", "--json", "check.json") == 0
    missing = json.loads(Path("check.json").read_text())["missing"]
    assert "spindle" not in missing
    assert missing["identify"] == "waits for `receptance spindle`: spindle"
    assert call("identify", ".") == 2
    assert "spindles.spindle: spindle.npz does not exist yet: `receptance spindle`" in capsys.readouterr().err
    before = left()
    assert call("spindle", ".", "--json", "s.json", "--plot", "s.png", "--report", "s.html") == 0
    assert left() - before == {"spindle.npz", "s.json", "s.png", "s.html"}
    output = capsys.readouterr().out
    assert "Spindle: spindle.npz" in output
    found = json.loads(Path("s.json").read_text())
    assert found["spindle"] == "spindle"
    assert sum(band["lines"] for band in found["bands"]) == COARSE.size
    assert call("identify", ".", "--json", "i.json") == 0
    identified = json.loads(Path("i.json").read_text())
    loaded = campaign.load(tmp_path)
    fit = loaded.identify()
    assert any("includes the errors of spindle" in note for note in identified["notes"])
    for address, true in TRUE.items():
        low, high = fit.interval(address, 0.999)
        assert low < true < high, address
    assert fit.standard_errors["joint.k_theta"] < 0.002 * TRUE["joint.k_theta"]
    assert call("stability", ".", "--json", "st.json", "--plot", "st.png") == 0
    assert "rejected" not in json.loads(Path("st.json").read_text())
    # The blank is no tip to predict; the longer tool is.
    assert [frf.name for frf in loaded.predict(fit).frfs] == ["longer"]


def test_the_advised_hits_make_lines_usable(tmp_path: Path) -> None:
    print(f"seed {SEED}")
    few, more = tmp_path / "few", tmp_path / "more"
    few.mkdir()
    more.mkdir()
    write_campaign(few, sd=0.05, seed=SEED, lines=COARSE)
    spindle = campaign.load(few, unidentified=True).spindle()
    others = ~spindle.table.usable
    assert others.mean() > 0.2
    assert spindle.hits_for_half is not None
    assert spindle.hits_for_half > 1
    assert f"With {spindle.hits_for_half} times the hits half" in " ".join(spindle.warnings())
    write_campaign(more, sd=0.05 / np.sqrt(spindle.hits_for_half), seed=SEED + 1, lines=COARSE)
    usable = campaign.load(more, unidentified=True).spindle().table.usable
    assert 0.35 < usable[others].mean() < 0.9


@pytest.mark.slow
def test_modes_go_into_a_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    print(f"seed {SEED}")
    write_campaign(tmp_path, CAMPAIGN.replace("spindle.npz", "spindle.toml"), sd=0.005, seed=SEED, lines=COARSE)
    monkeypatch.chdir(tmp_path)
    assert call("spindle", ".") == 2
    assert call("spindle", ".", "--modes", "auto", "--plot", "s.png") == 0
    modes = read_spindle("spindle.toml")
    assert isinstance(modes, SpindleModes)
    loaded = campaign.load(tmp_path)
    end = loaded.assemblies["tool"].elements["spindle"]
    assert isinstance(end, ModalPart)
    assert end == modes.part
    # The covariance is errors of every assembly with the spindle, the same in all of them.
    for name in ("tool", "longer"):
        assert {one.name: one.moves for one in loaded.tolerances[name]} == {
            one.name: one.moves for one in modes.tolerances
        }
    fit = loaded.identify()
    for address, true in TRUE.items():
        low, high = fit.interval(address, 0.999)
        assert low < true < high, address
    assert call("stability", ".", "--json", "st.json") == 0
    assert "rejected" not in json.loads(Path("st.json").read_text())


def test_errors_of_the_table_widen_the_joint(ready: Path, tmp_path: Path) -> None:
    """Without its covariance the table counts as exact: the standard errors are those of the records alone."""
    folder = copied(ready, tmp_path)
    stated = campaign.load(folder).identify()
    table = read_spindle(folder / "spindle.npz")
    assert isinstance(table, MeasuredPart)
    write_spindle(folder / "spindle.npz", replace(table, covariance=None))
    exact = campaign.load(folder).identify()
    # Without it the noise of the table is an error of the model.
    assert exact.rejection.widened
    assert not stated.rejection
    assert exact.rms > 1.1 > stated.rms
    assert not any("includes the errors" in note for note in exact.notes)


def test_the_lines_of_the_table_are_used(ready: Path) -> None:
    loaded, table = campaign.load(ready), read_spindle(ready / "spindle.npz")
    assert isinstance(table, MeasuredPart)
    for record in loaded.measurements.values():
        assert np.isin(record.frequency_hz, table.frequency_hz).all()
    np.testing.assert_array_equal(loaded.predict().frfs[0].frequency_hz, table.frequency_hz)
    assert loaded.on_blanks.keys() == {"gauge_tip", "gauge_between", "gauge_near"}
    assert list(loaded.assemblies["gauge"].elements) == ["gauge"]


def test_the_band_of_predictions_is_that_of_the_spindle(ready: Path, tmp_path: Path) -> None:
    wider = CAMPAIGN + '\n[prediction]\nlower = "50 Hz"\nupper = "8 kHz"\n'
    found = campaign.load(copied(ready, tmp_path, wider)).predict()
    assert found.frfs[0].frequency_hz[-1] < 3500.0
    assert any("from 200 to 34" in note and "wider limits" in note for note in found.notes)
    other = CAMPAIGN + '\n[prediction]\nlower = "5 kHz"\nupper = "8 kHz"\n'
    with pytest.raises(
        CampaignError, match=r"predictions are from 5000 to 8000 Hz, and the spindle spindle.npz is known"
    ):
        campaign.load(copied(ready, tmp_path, other)).predict()


@pytest.mark.parametrize(("front", "agrees"), [(3e8, True), (2.4e8, False)])
def test_a_held_out_record_tests_the_spindle(tmp_path: Path, front: float, agrees: bool) -> None:
    """A fourth record, of the same machine or of one with a softer bearing."""
    write_campaign(tmp_path, CAMPAIGN, sd=0.005, seed=SEED, lines=COARSE)
    middle = Coordinate("gauge", 0.04)
    machine = with_spindle(GAUGE, make_spindle(front))
    io.write(tmp_path / "gauge_middle.csv", measured(machine, middle, middle, 0.005, np.random.default_rng(9), COARSE))
    (tmp_path / "campaign.toml").write_text(campaign_text(CAMPAIGN) + HELD_OUT, encoding="utf-8")
    found = campaign.load(tmp_path, unidentified=True).spindle()
    (checked,) = found.checked
    assert (checked.deviations < 1.3) == agrees
    advice = [text for text in found.warnings() if "held-out records are off" in text]
    assert bool(advice) != agrees
    # As a fourth record of the fit it contradicts the others.
    text = campaign_text(CAMPAIGN) + HELD_OUT.replace('role = "hold out"\n', "")
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    loaded = campaign.load(tmp_path, unidentified=True)
    if agrees:
        assert loaded.spindle().table.rms == pytest.approx(1.0, abs=0.15)
    else:
        with pytest.raises(CampaignError, match=r"spindles.spindle: no spindle explains the responses"):
            loaded.spindle()


def test_tolerances_of_the_blank_are_errors_of_the_table(tmp_path: Path) -> None:
    write_campaign(tmp_path, sd=0.002, seed=SEED, lines=COARSE)
    exact = campaign.load(tmp_path, unidentified=True).spindle().table
    loose = 'outer_diameter = "50 mm"\ntolerance = { outer_diameter = "0.2 mm" }'
    text = campaign_text(CAMPAIGN).replace('outer_diameter = "50 mm"', loose)
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    found = campaign.load(tmp_path, unidentified=True).spindle().table
    both = exact.usable & found.usable
    assert (found.standard_deviation[both] > exact.standard_deviation[both]).mean() > 0.99
    assert any("tolerances of the blanks" in note for note in found.notes)


def other_lines(folder: Path) -> None:
    lines = np.arange(4000.0, 6000.0, 4.0)
    matrix = np.ones((lines.size, 1, 1)) * np.diag([1e-8, 1e-6])
    write_spindle(folder / "spindle.npz", MeasuredPart(frequency_hz=lines, matrix=matrix, name="s"))


def windowed(folder: Path) -> None:
    table = read_spindle(folder / "spindle.npz")
    assert isinstance(table, MeasuredPart)
    write_spindle(folder / "spindle.npz", replace(table, decay_rate=20.0))


def tip_alone(folder: Path) -> None:
    (folder / "spindle.csv").write_bytes((folder / "tool_tip.csv").read_bytes())


def nothing(folder: Path) -> None:
    del folder


CHAIN = 'chain = ["tool", "joint", "holder", "spindle"]\n\n[assemblies.longer]'


@pytest.mark.parametrize(
    ("old", "new", "prepare", "message"),
    [
        ("", "", other_lines, r"measurements.tool_tip: has 413 usable lines .* spindle.npz is known on none of them"),
        ("", "", windowed, r"measurements.tool_tip: has a decay rate of 0 1/s .* spindle.npz one of 20 1/s"),
        ("spindle.npz", "spindle.csv", tip_alone, r"spindles.spindle.file: .*spindle.csv: .* a full receptance matrix"),
        ("spindle.npz", "campaign.toml", nothing, r"spindles.spindle.file: .*campaign.toml: has the format None"),
        ('blanks = ["gauge"]\nfile = "spindle.npz"', "", nothing, r"spindles.spindle: has neither a file nor blanks"),
        (
            CHAIN,
            CHAIN.replace('"holder", "spindle"', '"spindle", "holder"'),
            nothing,
            r"chain\[2\]: is .* as the last name",
        ),
        (
            CHAIN,
            CHAIN.replace('"holder", "spindle"', '"spindle", "spindle"'),
            nothing,
            r"chain\[2\]: is .* expected it once",
        ),
        ('chain = ["gauge", "spindle"]', 'chain = ["gauge"]', nothing, r"blanks\[0\]: is .* whose chain ends with"),
        (
            'chain = ["gauge", "spindle"]',
            'chain = ["spindle"]',
            nothing,
            r"assemblies.gauge.chain: has a spindle alone",
        ),
        ('x = { assembly = "tool" }', 'x = { assembly = "gauge" }', nothing, r"cuts.slot.x.assembly: is .* a blank"),
        (
            "[unknowns]",
            '[unknowns]\n"gauge.segment[0].density" = { lower = "7000 kg/m^3", upper = "8000 kg/m^3" }',
            nothing,
            r"blanks\[0\]: is .*gauge.segment\[0\].density is among the unknowns",
        ),
    ],
)
def test_mistakes(
    ready: Path, tmp_path: Path, old: str, new: str, prepare: Callable[[Path], None], message: str
) -> None:
    folder = copied(ready, tmp_path, CAMPAIGN.replace(old, new) if old else CAMPAIGN)
    prepare(folder)
    with pytest.raises(CampaignError, match=message):
        campaign.load(folder)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "spindles.spindle.file would replace spindle.npz, which exists"),
        (("-o", "s.csv"), "--output is s.csv, but the table is written to a file .npz"),
        (("--modes", "auto"), "spindle.npz, but modes are written to a file .toml; leave out --modes"),
        (("--modes", "many", "-o", "s.toml"), "--modes is 'many', expected a number of modes such as 6, or auto"),
        (("-o", "campaign.toml", "--modes", "4", "--overwrite"), "which is the campaign file"),
        (("--name", "spndle", "--overwrite"), 'there is no spindle "spndle" with blanks'),
    ],
)
def test_mistakes_of_the_command(
    ready: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, arguments: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(copied(ready, tmp_path))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert call("spindle", ".", *arguments) == 2
    assert message in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_blank_that_is_described_as_too_flexible(tmp_path: Path) -> None:
    write_campaign(tmp_path, sd=0.005, seed=SEED, lines=COARSE)
    text = campaign_text(CAMPAIGN).replace('outer_diameter = "50 mm"', 'outer_diameter = "25 mm"')
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    with pytest.raises(CampaignError, match=r"spindles.spindle: .* negative static stiffness: .* diameters"):
        campaign.load(tmp_path, unidentified=True).spindle()


def test_a_limit_beside_a_gap_is_rejected(ready: Path, tmp_path: Path) -> None:
    """The largest response of the tip, at the first mode of the tool, is between two lines of the table."""
    folder = copied(ready, tmp_path)
    table = read_spindle(folder / "spindle.npz")
    assert isinstance(table, MeasuredPart)
    tip = np.abs(campaign.load(folder).predict().frfs[0].receptance)
    top = float(table.frequency_hz[np.argmax(tip)])
    kept = np.abs(table.frequency_hz - top) > 40.0
    gap = replace(
        table, frequency_hz=table.frequency_hz[kept], matrix=table.matrix[kept], covariance=table.covariance[kept]
    )
    write_spindle(folder / "spindle.npz", gap)
    text = campaign_text(CAMPAIGN.replace('x = { assembly = "tool" }', 'x = { assembly = "longer" }'))
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    assert any("is not known between" in text for text in campaign.load(folder).stability().rejection)


CANDIDATE = """
[candidates.longer]
kind = "frf"
assembly = "longer"
lower = "100 Hz"
upper = "3 kHz"
step = "20 Hz"
standard_deviation = "0.2 %"
"""


def test_a_candidate_is_limited_by_the_spindle(ready: Path, tmp_path: Path) -> None:
    """Of an exact table the same candidate would tell more."""
    folder = copied(ready, tmp_path, CAMPAIGN + CANDIDATE)
    loaded = campaign.load(folder)
    assert any("of 146 lines are used; on the others spindle is not known" in note for note in loaded.notes)
    fit = loaded.identify()
    stated = loaded.next_measurement(fit, targets=["joint.k_theta"])
    table = read_spindle(folder / "spindle.npz")
    assert isinstance(table, MeasuredPart)
    write_spindle(folder / "spindle.npz", replace(table, covariance=None))
    exact = campaign.load(folder).next_measurement(fit, targets=["joint.k_theta"])
    shares = [found.ranking[0].shrink for found in (stated, exact)]
    assert shares[0] > 1.1 * shares[1]


@pytest.mark.slow
def test_a_cause_is_named_and_written_beside_a_measured_spindle(tmp_path: Path) -> None:
    """A sensor of 3 g on the tool that the campaign does not state."""
    print(f"seed {SEED}")
    sparse = LINES[::4]
    write_campaign(tmp_path, sd=0.002, seed=SEED, lines=sparse)
    rng = np.random.default_rng(SEED)
    for name, sides in TOOL_RECORDS.items():
        one, other = (Coordinate(*side) for side in sides)
        bare = tool_on_machine()
        sensor = PointMass(mass=3e-3, part=one.part, position=one.position, name="sensor")
        loaded_with = Assembly(bare.elements.values(), [*bare.attachments.values(), sensor])
        io.write(tmp_path / f"{name}.csv", measured(loaded_with, one, other, 0.002, rng, sparse))
    write_spindle(tmp_path / "spindle.npz", campaign.load(tmp_path, unidentified=True).spindle().identified)
    loaded = campaign.load(tmp_path)
    verdict = loaded.diagnose(["sensor_mass", "tool_density"], fast=True)
    assert verdict.explanation is not None
    (tmp_path / "extended").mkdir()
    again = campaign.load(campaign.write_extended(loaded, verdict, tmp_path / "extended" / "campaign.toml"))
    assert again.table.spindles["spindle"].file == "../spindle.npz"
    assert again.table.assemblies["gauge"].chain == ["gauge", "spindle"]
    fit = again.identify()
    low, high = fit.interval("joint.k_theta", 0.999)
    assert low < TRUE["joint.k_theta"] < high


def test_rejected_modes_are_not_written(
    ready: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    folder = copied(ready, tmp_path, CAMPAIGN.replace("spindle.npz", "spindle.toml"))
    monkeypatch.chdir(folder)
    reason = Rejection(unusable=("the fit has not converged",))
    rejected = replace(campaign.load(ready).identify(), converged=False, rejection=reason)
    mode = Mode(frequency_hz=1200.0, damping_ratio=0.05, y=0.5, theta=-3.0)
    part = ModalPart(modes=[mode], name="spindle")
    modes = SpindleModes(part=part, covariance=np.eye(len(part.addresses)), identification=rejected)
    monkeypatch.setattr("receptance.campaign.spindle.fit_spindle", lambda *_, **__: modes)
    before = left()
    assert call("spindle", ".", "--modes", "1", "--json", "s.json") == 3
    assert left() - before == {"s.json"}
    assert json.loads(Path("s.json").read_text())["rejected"] == ["the fit has not converged"]
    output = capsys.readouterr().out
    assert "spindle.toml was not written: the fit of the modes is rejected" in output
    assert "Spindle: spindle.toml" not in output
