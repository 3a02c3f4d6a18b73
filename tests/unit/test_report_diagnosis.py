"""The report of a diagnosis: complete, escaped, without network, and rendered in a browser."""

from __future__ import annotations

import math
from datetime import date
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blank_in_holder import make_assembly
from receptance import CARBIDE, Assembly, Observation, Part, PointMass, Segment, Unknown
from receptance.diagnosis import diagnose
from receptance.diagnosis.by_mode import Curve, modes_of, residuals_by_mode
from receptance.diagnosis.fitting import evaluate
from receptance.diagnosis.held_out import FREQUENCIES, Gain
from receptance.diagnosis.model import Model
from receptance.diagnosis.presentation import improvement_text
from receptance.fit.discrepancy import Discrepancy
from receptance.report.table import amount

SEED = 20261122
LINES = np.linspace(200.0, 6000.0, 500)
TITLE = '12 mm <script>alert(1)</script> & "mill" äöü 端'
LABEL = "</script><img src=x onerror=alert(2)> {:.0f}"
LARGEST = 1 << 20
"""Bytes of a page."""


@pytest.fixture(scope="module")
def verdict() -> Any:
    """A sensor of one gram that is not in the model."""
    rng = np.random.default_rng(SEED)
    observations = [
        Observation(
            assembly=make_assembly(overhang),
            frequency_hz=LINES,
            receptance=make_assembly(overhang, PointMass(mass=1e-3)).receptance(LINES)
            * np.exp(0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.01,
            label=LABEL.format(1e3 * overhang),
        )
        for overhang in (0.05, 0.07, 0.09)
    ]
    sensed = make_assembly(0.08, PointMass(mass=1e-3)).natural_frequencies(6000.0)[:1]
    observations.append(
        Observation.from_modes(
            assembly=make_assembly(0.08), frequency_hz=sensed, standard_deviation_hz=2.0, label="peak"
        )
    )
    bounds = {"k_y": (1e6, 1e11), "k_theta": (1e2, 1e8), "c_y": (1e-1, 1e6), "c_theta": (1e-4, 1e3)}
    unknowns = [Unknown(address=f"joint.{name}", lower=low, upper=high) for name, (low, high) in bounds.items()]
    causes = ["sensor_mass", "tool_density", "tool_modulus"]
    return diagnose(observations, unknowns, causes=causes, max_causes=1, held_out=True)


@pytest.fixture(scope="module")
def page(verdict: Any) -> str:
    return verdict.to_html(TITLE)


def test_mode_deviation_by_the_sensor(verdict: Any) -> None:
    """Against natural frequencies of both assemblies, calculated beside the data."""
    assert verdict.verdict == "named"
    before = {one.label: one for one in residuals_by_mode(verdict.selection.base)}
    after = residuals_by_mode(verdict.explanation.fit)
    assert {one.label for one in after} == set(before)
    assert all(abs(one.frequency_percent) < 0.05 for one in after)
    assert max(abs(one.frequency_percent) for one in before.values()) > 0.3
    own = before[LABEL.format(90)]
    true = make_assembly(0.09, PointMass(mass=1e-3)).natural_frequencies(6000.0)[0]
    assert own.measured_hz == pytest.approx(true, rel=1e-3)
    modelled = verdict.base_fit.identification.assemblies[2].natural_frequencies(6000.0)[0]
    assert own.frequency_percent == pytest.approx(100.0 * (modelled / true - 1.0), abs=0.03)
    assert np.isnan(before["peak"].damping_percent)


def test_noise_in_an_antiresonance_is_no_mode() -> None:
    lines = np.arange(200.0, 6400.0, 4.0)
    bar = Assembly([Part([Segment(length=0.15, outer_diameter=0.012, material=CARBIDE)], name="bar")])
    clean = bar.receptance(lines)
    dip = int(np.argmin(np.abs(clean)))
    noisy = clean.copy()
    noisy[dip] *= 30.0
    deviation = 0.002 * np.median(np.abs(clean)) / np.abs(clean)
    for values, spread in ((noisy, 0.05), (noisy, 1.0), (clean, 0.05)):
        one = Observation(
            assembly=bar,
            frequency_hz=lines,
            receptance=values,
            standard_deviation=np.where(np.arange(lines.size) == dip, spread, np.minimum(deviation, 0.05)),
        )
        curve = Curve("bar", "bar", lines, values, clean, np.zeros((2, lines.size)))
        measured = [mode.measured_hz for mode in modes_of(one, curve)]
        near = [hz for hz in measured if abs(hz - lines[dip]) < 20.0]
        # A clear peak with little noise is a mode that the model does not have.
        assert bool(near) == (values is noisy and spread < 0.1)
        assert len(measured) - len(near) == 1


def test_modes_are_listed_beside_a_discrepancy() -> None:
    """A discrepancy enlarges the deviations of lines at resonances, which are modes nevertheless."""
    lines = np.arange(200.0, 6400.0, 4.0)
    bar = Assembly([Part([Segment(length=0.15, outer_diameter=0.012, material=CARBIDE)], name="bar")])
    one = Observation(
        assembly=bar, frequency_hz=lines, receptance=bar.receptance(lines), standard_deviation=0.01, label="bar"
    )
    loss = Unknown(address="bar.segment[0].loss_factor", lower=1e-6, upper=0.3, start=1e-3)
    model = Model((one,), (loss,), ())
    allowed = model.allow(Discrepancy(frequency=0.01, relative=0.05))
    assert np.max(allowed.observations[0].standard_deviations) > 0.5
    found = [[mode.measured_hz for mode in residuals_by_mode(evaluate(each, {}))] for each in (model, allowed)]
    assert len(found[0]) == 1
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_page_is_complete(page: str, verdict: Any) -> None:
    low, high = (1e3 * end for end in verdict.causes[0].parameters["sensor_mass.mass"][1:])
    for words in (
        "the model is inadequate, and the data identify the cause",
        "Mass of the sensor: ",
        f"g (95 %: {low:.3f} to {high:.3f} g)",
        "State the sensor in the campaign",
        "residuals over noise, rms",
        "held out: distance of the spectra",
        "measured (dB)",
        "the model as it is",
        "Residuals at each mode",
        "odds to<br>the best",
        "versions: receptance",
        date.today().isoformat(),
    ):
        assert words.casefold() in page.casefold(), words
    # Three receptances that were fitted, and the same ones left out in turn; natural frequencies; the odds.
    assert page.count('<svg class="figure"') == 3 + 3 + 1 + 1
    assert page.count("<title>held out: ") == 3
    assert "<script" not in page
    assert len(page.encode()) < LARGEST


def test_card_states_effect_with_units(verdict: Any) -> None:
    """Ratios, decibels and percent beside the numbers of the result."""
    cells = {row[0]: row for table in verdict.tables() for row in table.rows}
    before, after = (math.sqrt(one.misfit) for one in (verdict.adequacy, verdict.adequacy_after))
    _, *values, change = cells["residuals over noise, rms"]
    assert values == [f"{amount(before)} times", f"{amount(after)} times"]
    assert float(change.split(" dB")[0]) == pytest.approx(20.0 * math.log10(after / before), rel=0.05)
    spectra = cells["held out: distance of the spectra"]
    assert float(spectra[1].removesuffix(" dB")) == pytest.approx(
        20.0 / math.log(10.0) * verdict.gain.held_out_before, rel=0.01
    )
    assert cells["joint.k_y"][2].split(" ± ")[0] == amount(verdict.extended.values["joint.k_y"], "N/m")
    assert cells["mass of the sensor"][1:3] == ["100 %", "1 : 1"]
    assert cells["mass of the sensor"][-1] == "reported"
    others = [one for one in verdict.candidates if one.title in cells and one.id != "sensor_mass"]
    for one in others:
        assert cells[one.title][-1].startswith(("leaves residuals of", "less likely", "log", "density", "modulus"))


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        ((-0.0429, 0.0753), "between 0.0429 % worse and 0.0753 % better"),
        ((0.1, 0.3), "better by 0.100 to 0.300 %"),
        ((-0.3, -0.1), "worse by 0.100 to 0.300 %"),
    ],
)
def test_improvement_that_may_be_none_names_both_sides(interval: tuple[float, float], words: str) -> None:
    gain = Gain(metric=FREQUENCIES, held_out_before=1.41, held_out_after=1.40, interval=interval, folds=({},) * 3)
    assert improvement_text(gain).startswith(words)


def test_user_text_is_escaped(page: str) -> None:
    assert "<script>alert(1)" not in page
    assert "<img src=x" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;mill&quot; äöü 端" in page


def test_page_has_no_external_links(page: str) -> None:
    """Outside the scripts there is no address; inside them loading is forbidden (the page's own policy)."""
    loading: list[str] = []

    class Attributes(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            loading.extend(name for name, _ in attrs if name in {"src", "href", "srcset", "action", "data"})

    Attributes().feed(page)
    assert loading == []
    assert "default-src 'none'" in page


def test_natural_frequencies_without_an_explanation(tmp_path: Path) -> None:
    """Overhangs that deviate from the stated ones with alternating sign: no cause of the list explains it."""
    observations = [
        Observation.from_modes(
            assembly=make_assembly(overhang),
            frequency_hz=make_assembly(overhang + off).natural_frequencies(9000.0)[:2],
            standard_deviation_hz=0.3,
            label=f"{1e3 * overhang:.0f} mm",
        )
        for overhang, off in ((0.06, 8e-4), (0.07, -8e-4), (0.08, 8e-4), (0.09, -8e-4))
    ]
    unknowns = [
        Unknown(address="joint.k_y", lower=1e6, upper=1e11),
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    ]
    verdict = diagnose(observations, unknowns, causes=["tool_density", "collet_mass"], max_causes=1, held_out=True)
    assert verdict.verdict == "unexplained"
    output, page = verdict.summary(1000), verdict.to_html()
    assert "if all standard deviations were" in output
    for words in (
        "With the density of the tool the residuals fall from",
        "leaves residuals of",
        "Held-out modes",
        "The model as it is",
        f"in {verdict.adequacy.worst[0]}.",
    ):
        assert words in page, words
    for words in ("damping<br>[%]", "level<br>[dB]", "phase<br>[°]", "Effect of"):
        assert words not in page, words
