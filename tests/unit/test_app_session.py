"""The page gives the answers of the library: identification, prediction, diagnosis, causes, lobes, catalogue, files."""

from __future__ import annotations

import csv
import dataclasses
import re

import numpy as np
import pytest

from receptance import campaign, examples
from receptance.campaign import CampaignCheck
from receptance.catalogue import Catalogue, predict_catalogue, summary_of
from receptance.session.state import Session

pytest.importorskip("bokeh")
CAUSES = ("sensor_mass", "time_delay")
FEWEST_STEPS = 3
"""Steps of a diagnosis after which it is stopped: by then the model without causes is fitted."""


@pytest.fixture(scope="module")
def sensor(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensor")
    examples.write("forgotten-sensor", folder)
    return folder


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("machine")
    examples.write("machine", folder)
    return folder


def opened(folder):
    session = Session(folder, threads=1)
    session.open("campaign.toml")
    return session


def ended(session):
    """Return the calculation that runs, after its end."""
    session.work.wait(120.0)
    work = session.finish()
    assert work is not None
    assert work.error is None
    return work


@pytest.fixture(scope="module")
def diagnosed(sensor):
    """Return a session with a diagnosis, which tests do not change, and the verdict of the library."""
    session = opened(sensor)
    session.diagnose(CAUSES)
    ended(session)
    return session, campaign.load(sensor, threads=1).diagnose(CAUSES)


def step_of(work):
    """Return the number of the step of a diagnosis."""
    match = re.match(r"step (\d+) ", work.progress)
    return 0 if match is None else int(match[1])


def content(result):
    """Return all values of a result but the times that it took."""
    data = result.to_dict()
    data.pop("settings", None)
    return data


def test_the_page_identifies_and_predicts_as_the_library(sensor):
    session, library = opened(sensor), campaign.load(sensor, threads=1)
    session.identify()
    ended(session)
    identified = library.identify()
    assert content(session.identified) == content(identified)
    assert (
        session.trial.values.items()
        >= {n: v for n, v in identified.values.items() if n in session.trial.values}.items()
    )
    session.predict()
    ended(session)
    assert content(session.prediction) == content(library.predict(identified))


def test_the_page_diagnoses_as_the_library(diagnosed):
    session, verdict = diagnosed
    assert session.verdict.verdict == verdict.verdict == "named"
    assert [c.id for c in session.verdict.causes] == ["sensor_mass"]
    for mine, other in zip(session.verdict.candidates, verdict.candidates, strict=True):
        assert dataclasses.replace(mine, explanation=None) == dataclasses.replace(other, explanation=None)
        assert mine.parameters == other.parameters
    # The page shows the lines for the campaign file as the command does.
    assert session.verdict.campaign.lines


def test_what_the_campaign_lacks_is_what_check_says(sensor):
    session = opened(sensor)
    assert session.missing == CampaignCheck(campaign.load(sensor)).missing
    assert "cuts" in session.missing["stability"]
    assert not session.missing["diagnose"]
    assert Session(sensor).missing == {}


def test_a_diagnosis_that_is_stopped_has_the_answer_so_far(sensor):
    session = opened(sensor)
    session.diagnose()
    work = session.work
    while work.runs and step_of(work) < FEWEST_STEPS:
        work.wait(0.001)
    session.stop()
    assert ended(session) is work
    assert work.stopped
    assert session.verdict is not None
    assert not session.verdict.final
    assert session.verdict.verdict != "named"
    with pytest.raises(ValueError, match="interrupted"):
        session.accept()


def test_a_second_calculation_waits_for_the_first(sensor):
    session = opened(sensor)
    session.diagnose()
    with pytest.raises(ValueError, match="diagnose still runs; stop it first"):
        session.identify()
    session.stop()
    ended(session)


def test_a_chosen_cause_shows_the_curves_of_its_fit(diagnosed, sensor):
    session, _ = diagnosed
    measured = campaign.load(sensor).to_identify
    for cause in (None, *session.leading):
        session.show_cause(cause)
        fit = session.verdict.selection.base if cause is None else cause.explanation.fit
        for name, observation, part in zip(measured, fit.model.observations, fit.parts, strict=True):
            record = session.trial.records[name]
            # A diagnosis leaves out lines with much noise.
            used = np.isin(record.observation.frequency_hz, observation.frequency_hz)
            ratio = np.log(record.observation.receptance / record.calculated)[used]
            shown = np.concatenate([ratio.real, ratio.imag]) / observation.standard_deviations
            np.testing.assert_allclose(shown, part, rtol=1e-6, atol=1e-6)
    best = session.leading[0]
    session.show_cause(best)
    assert session.trial.variants == best.explanation.variants
    with_cause = session.trial.misfit
    session.show_cause(None)
    assert session.trial.variants == ()
    assert session.trial.misfit > 2.0 * with_cause


def test_an_accepted_cause_is_a_new_file_that_is_not_saved(diagnosed, sensor, tmp_path):
    session, verdict = diagnosed
    document = session.accept()
    library = campaign.load(sensor, threads=1)
    assert document.text == campaign.extended_text(library, verdict, sensor)
    assert document.is_changed
    assert not document.file.exists()
    assert document.campaign is not None
    # A file with its name is not replaced.
    document.file.write_text("title = 'mine'")
    try:
        assert session.accept().file.name == "extended-2.toml"
    finally:
        document.file.unlink()


def test_the_accepted_campaign_explains_the_data(diagnosed, sensor):
    accepted = opened(sensor)
    accepted.verdict = diagnosed[0].verdict
    document = accepted.accept()
    accepted.edit(document)
    assert accepted.verdict is None
    assert accepted.document is document
    accepted.identify()
    ended(accepted)
    assert not accepted.identified.rejection


def test_the_page_computes_the_lobes_of_the_library(machine):
    session, library = opened(machine), campaign.load(machine, threads=1)
    session.cut()
    ended(session)
    stability = library.stability()
    assert list(session.stability) == list(stability)
    for name, lobes in stability.items():
        for values in ("depth", "lower", "upper", "certain_depth", "chatter_hz"):
            np.testing.assert_array_equal(getattr(session.stability[name], values), getattr(lobes, values))
    # The fit behind the lobes is that of the page, and the sliders begin with it.
    assert session.identified.values == stability.identified.values
    nominal = session.trial.stability()
    expected = library.trial(library.identify(profiles=())).stability()
    for name, lobes in expected.items():
        np.testing.assert_allclose(nominal[name].depth, lobes.depth, rtol=1e-6)


def test_lobes_do_not_take_moved_values_away(machine):
    session = opened(machine)
    name = session.trial.unknowns[0].name
    session.move({name: 1.1 * session.trial.values[name]})
    moved = session.trial
    session.cut()
    ended(session)
    assert session.trial is moved
    assert session.identified is not None


def test_the_page_predicts_the_catalogue_of_the_library(machine):
    session, library = opened(machine), campaign.load(machine, threads=1)
    session.predict_catalogue()
    ended(session)
    catalogue = Catalogue(library)
    assert content(session.catalogue) == content(summary_of(catalogue, predict_catalogue(catalogue)))


def test_results_are_written_under_new_names(machine):
    session = opened(machine)
    session.predict_catalogue()
    ended(session)
    result, before = session.catalogue, {path.name for path in machine.iterdir()}
    written = [path for kind in ("svg", "png", "html", "csv", "svg") for path in session.export(result, kind)]
    assert [path.name for path in written] == [
        "campaign-catalogue.svg", "campaign-catalogue.png", "campaign-catalogue.html",
        "campaign-catalogue-the-most-flexible-mode-of-each-tool.csv", "campaign-catalogue-2.svg",
    ]  # fmt: skip
    assert {path.name for path in machine.iterdir()} == before | {path.name for path in written}
    assert written[2].read_text(encoding="utf-8") == result.to_html()
    with written[3].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["tool"] for row in rows] == [tool.name for tool in result.tools]
    for row, tool in zip(rows, result.tools, strict=True):
        assert float(row["frequency [Hz]"]) == pytest.approx(tool.values[0], rel=1e-6)
    for path in written:
        path.unlink()


def test_an_error_of_a_calculation_is_that_of_the_library(sensor):
    session = opened(sensor)
    session.diagnose(["no cause"])
    session.work.wait(60.0)
    with pytest.raises(ValueError, match="there is no cause") as raised:
        campaign.load(sensor).diagnose(["no cause"])
    assert str(session.finish().error) == str(raised.value)
    assert session.verdict is None
