"""A rejected fit: every result that uses it begins with the rejection, as text, figure, HTML and JSON."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from machine_with_catalogue import TEXT, load
from receptance.campaign import Campaign
from receptance.catalogue import Catalogue, CatalogueSummary, predict_catalogue, tool_lobes
from receptance.catalogue.figure import draw_tool
from receptance.catalogue.results import summaries
from receptance.fit import Observation
from receptance.predict import Candidate, next_measurement
from receptance.report import ACCEPTED, Rejection, Result

HEADING = "Not adequate: the intervals include an error of the model"
CUT = """
[stability]
speeds = ["4000 rpm", "20000 rpm"]
step = "1000 rpm"
draws = 60

[cuts.slot]
kind = "milling"
teeth = 4
k_t = "800 MPa"
k_n = "250 MPa"
x = { assembly = "endmill" }
"""


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Any:
    wrong = re.sub(r'frequencies = \["[0-9.]+ Hz"\]', 'frequencies = ["2000 Hz"]', TEXT)
    assert wrong != TEXT
    return load(tmp_path_factory.mktemp("machine"), text=wrong)


@pytest.fixture(scope="module")
def fit(machine: Campaign) -> Any:
    return machine.identify()


def require_rejection(result: Result, rejection: Rejection) -> None:
    """Require the texts at the beginning of everything that shows a result."""
    assert result.rejection == rejection
    texts = tuple(rejection)
    lines = result.summary(200).splitlines()
    assert lines[1] == HEADING
    assert texts[0][:60] in lines[2]
    page = result.to_html()
    assert page.index(HEADING) < page.index("<svg") < page.index("<table")
    assert next(iter(result.to_dict())) == "not_adequate"
    assert result.to_dict()["not_adequate"] == list(texts)
    assert result.plot().get_suptitle().startswith(f"{HEADING}.\n{texts[0][:30]}")


def test_a_rejected_fit_states_misfit_and_error_of_the_model(fit: Any) -> None:
    assert fit.rejection.unusable == ()
    text, bound = fit.rejection.widened
    assert re.match(r"the model leaves residuals of \d+ times the noise", text)
    assert str(fit.discrepancy) in text
    assert "at its upper bound 1e+07" in bound
    assert not fit.adequacy.passed
    assert not set(fit.rejection) & set(fit.warnings())
    assert fit.advice[:2] == list(fit.rejection)
    require_rejection(fit, fit.rejection)


def test_predictions_and_candidates_begin_with_it(machine: Campaign, fit: Any) -> None:
    require_rejection(machine.predict(fit), fit.rejection)
    assembly = machine.assemblies["short"]
    again = Observation.from_modes(label="again", assembly=assembly, modes=[1], standard_deviation_hz=2.0)
    require_rejection(
        next_measurement(fit, Candidate(observation=again)),
        fit.rejection,
    )


def test_the_catalogue_begins_with_it(machine: Campaign, fit: Any) -> None:
    predictions = list(predict_catalogue(Catalogue(machine), fit))
    require_rejection(CatalogueSummary(tools=tuple(summaries(predictions)), level=0.95), fit.rejection)
    assert draw_tool(predictions[0]).get_suptitle().startswith(HEADING)
    assert predictions[0].as_frf().notes[1:] == tuple(fit.rejection)


def test_the_stability_begins_with_it(tmp_path: Path, fit: Any) -> None:
    campaign = load(tmp_path, text=TEXT + ("" if "[cuts." in TEXT else CUT))
    found = campaign.stability(fit)
    require_rejection(found, fit.rejection)
    assert next(iter(found.values())).rejection == fit.rejection
    (tool, *_) = predict_catalogue(Catalogue(campaign), fit, draws=60)
    assert tool_lobes(tool, campaign, next(iter(campaign.cuts))).rejection == fit.rejection


def test_a_transfer_names_the_assemblies(machine: Campaign) -> None:
    found = machine.transfer(draws=0)
    assert all(re.match("(short|long): ", text) for text in found.rejection)
    require_rejection(found, found.rejection)


def test_an_accepted_fit_has_none(tmp_path: Path) -> None:
    fit = load(tmp_path).identify()
    assert fit.rejection == ACCEPTED
    assert not fit.rejection
    assert not {"rejected", "not_adequate"} & set(fit.to_dict())
    assert HEADING not in fit.summary()
    assert HEADING not in fit.to_html()
