"""Fits of models that are not adequate: how they are judged, widened and used."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from machine_with_catalogue import TEXT, load
from receptance import STEEL, Assembly, Observation, Part, Segment, Tolerance, Unknown, identify
from receptance.catalogue import Catalogue, predict_catalogue
from receptance.catalogue.results import write_depths
from receptance.fit.adequacy import Strain
from receptance.fit.discrepancy import Curve, Discrepancy
from receptance.report import ACCEPTED, Rejection
from receptance.stability import Milling, TipModes, stability_lobes
from receptance.stability.lobes import with_rejection

LINES = np.linspace(500.0, 8000.0, 800)
SEED = 20261127
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


def bar(modulus: float = 1.0) -> Assembly:
    """Return a free bar of lossy steel with a multiple of its modulus."""
    steel = replace(STEEL, youngs_modulus=modulus * STEEL.youngs_modulus, loss_factor=0.02)
    return Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=steel)], name="bar")])


def measure(true: Assembly, sd: float = 0.02) -> Observation:
    """Return the tip FRF of a bar, described with the nominal modulus."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    noise = sd * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    return Observation(
        assembly=bar(),
        frequency_hz=LINES,
        receptance=true.receptance(LINES) * np.exp(noise),
        standard_deviation=sd,
        label="tip",
    )


LOSS = Unknown(address="bar.segment[0].loss_factor", lower=1e-4, upper=0.3)


def modulus(share: float) -> Tolerance:
    """Return the tolerance of the modulus."""
    return Tolerance(name="modulus", moves={"bar.segment[*].youngs_modulus": share}, relative=True)


def test_an_error_at_its_stop_is_never_adequate() -> None:
    """The modulus is off by more than eight tolerances: among 1,600 residuals the one of its prior does not show."""
    observed = measure(bar(1.0085), sd=0.03)
    stated = identify(observed, LOSS, tolerances=modulus(1e-3), starts=2, noise="stated")
    assert stated.rms < 1.05
    assert stated.adequacy.of_lines
    assert stated.adequacy.strain.at_stop == ("modulus",)
    assert not stated.adequacy.passed
    assert stated.rejection.unusable
    found = identify(observed, LOSS, tolerances=modulus(1e-3), starts=2)
    assert abs(found.values["modulus"]) < 4.0
    assert 1e-3 < found.discrepancy.frequency < 1e-2
    assert "limit of the fit" in found.rejection.widened[0]
    assert found.rejection.unusable == ()


def test_an_adequate_model_has_no_discrepancy() -> None:
    found = identify(measure(bar(1.001)), LOSS, tolerances=modulus(1e-3), starts=2)
    assert found.adequacy.passed
    assert found.discrepancy is None
    assert found.scatter_freedom is None
    assert not found.rejection
    assert found.data()["discrepancy"] is None


def test_predictions_have_the_error_of_the_model() -> None:
    """A longer bar of the wrong modulus: every interval holds the truth, none without the discrepancy."""
    tolerance = modulus(1e-4)
    longer = {"bar.segment[0].length": 0.25}
    true, described = bar(1.02).replace(longer), bar().replace(longer)
    for noise, holds in (("judged", True), ("stated", False)):
        fit = identify(measure(bar(1.02)), LOSS, tolerances=tolerance, starts=2, noise=noise)
        predicted = fit.at(described)
        for mode, frequency in zip(
            predicted.natural_frequencies(8e3).modes, true.natural_frequencies(8e3), strict=True
        ):
            low, high = mode.interval_hz()
            assert (low <= frequency <= high) == holds
        frf = predicted.receptance(LINES, draws=100, seed=1)
        linear = predicted.receptance(LINES)
        exact = np.abs(true.receptance(LINES))
        for band in (frf.band(), linear.band()):
            assert (np.mean((band[0] <= exact) & (exact <= band[1])) > 0.9) == holds
        peaks = predicted.peak_frequencies(LINES, predicted.linear(LINES)).modes
        assert [low <= f <= high for (low, high), f in zip(
            (peak.interval_hz() for peak in peaks), true.natural_frequencies(8e3), strict=True
        )] == [holds] * len(peaks)  # fmt: skip


def test_draws_of_a_tip_stay_passive() -> None:
    receptance = bar().receptance(LINES)
    curve = Curve.of(LINES, receptance)
    rng = np.random.default_rng(SEED)
    moved = np.array(
        [curve.moved_by(0.05 * rng.normal(size=curve.modes), 0.5 * rng.normal(size=curve.modes)) for _ in range(50)]
    )
    assert np.all(moved.imag <= 0.0)
    same = curve.moved_by(np.zeros(curve.modes), np.zeros(curve.modes))
    np.testing.assert_allclose(same, receptance, rtol=1e-12)
    # All modes 1 % higher and 10 % larger.
    higher = curve.moved_by(np.full(curve.modes, np.log(1.01)), np.full(curve.modes, np.log(1.1)))
    expected = 1.1 * bar().receptance(LINES[50:-50] / 1.01)
    # The stiffness has its peaks at antiresonances, between two lines.
    np.testing.assert_allclose(higher[50:-50], expected, rtol=0.02, atol=5e-10)


def test_the_variance_of_lines_is_that_of_draws() -> None:
    discrepancy = Discrepancy(frequency=2e-4, relative=0.02)
    curve = Curve.of(LINES, bar().receptance(LINES))
    rng = np.random.default_rng(SEED)
    moved = [
        curve.moved_by(2e-4 * rng.normal(size=curve.modes), 0.02 * rng.normal(size=curve.modes)) for _ in range(400)
    ]
    drawn = np.log(np.abs(np.array(moved) / curve.receptance)).std(axis=0)
    stated = np.sqrt(discrepancy.log_variance(curve))
    at_peaks = np.searchsorted(LINES, curve.peaks_hz)
    np.testing.assert_allclose(drawn[at_peaks], stated[at_peaks], rtol=0.25)
    assert np.mean(drawn > 1.5 * stated) < 0.05


def test_without_a_usable_fit_no_depth_is_stated(tmp_path: Path) -> None:
    text = TEXT + ("" if "[cuts." in TEXT else CUT)
    text += "" if "[settings]" in text else "\n[settings]\nmax_evaluations = 1\nstarts = 1\n"
    wrong = re.sub(r'frequencies = \["[0-9.]+ Hz"\]', 'frequencies = ["2000 Hz"]', text)
    campaign = load(tmp_path, text=wrong)
    fit = campaign.identify()
    fit = replace(fit, rejection=Rejection(unusable=("not converged: raise max_evaluations",)))
    found = campaign.stability(fit)
    (lobes, *_) = found.values()
    assert np.isnan(lobes.depth).all()
    assert lobes.best_cuts == ()
    assert found.rejection == fit.rejection
    assert "no limit is known" in " ".join(found.sentences())
    assert found.to_dict()["rejected"] == ["not converged: raise max_evaluations"]
    target = tmp_path / "depths.csv"
    tools = predict_catalogue(Catalogue(campaign), fit, draws=60)
    names = [tool.row.name for tool in write_depths(target, tools, campaign, next(iter(campaign.cuts)))]
    header, *rows = target.read_text().splitlines()
    assert header.endswith(",note")
    assert [row.split(",")[0] for row in rows] == names
    assert all(",,,,,,,," in row and row.endswith("not converged: raise max_evaluations") for row in rows)


def test_depths_with_a_useless_lower_end_are_refused() -> None:
    tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[5.0, 5.0]])
    lines = np.arange(700.0, 1300.0, 1.0)
    exact = tip.receptance(lines)
    speeds = np.arange(4e3, 2e4, 1e3)
    cut = Milling(teeth=2, k_t=6e8, k_n=2e8)
    widened = Rejection(widened=("the model leaves residuals",))
    for factor, refused in ((1.5, False), (6.0, True)):
        draws = [exact * size for size in np.geomspace(1.0 / factor, factor, 30)]
        lobes = stability_lobes(cut, lines, exact, speeds_rpm=speeds, draws=np.array(draws))
        found = with_rejection(replace(lobes, name="slot", probability=0.9), widened)
        assert bool(found.rejection.unusable) == refused
        assert np.isnan(found.depth).all() == refused
        assert found.rejection.widened == widened.widened
        assert with_rejection(lobes, ACCEPTED) == lobes
        if refused:
            assert "measure the tip itself" in found.rejection.unusable[0]
            assert found.best_cuts == ()
            assert found.to_dict()["always_stable"] is None


def test_an_error_at_its_stop_is_strained_also_where_the_data_hardly_show_it() -> None:
    assert Strain().passed
    assert not Strain(at_stop=("length",)).passed
