"""Errors of the model in predictions: nodes, summits that are no natural frequencies, lines between modes, few data."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, Observation, Part, PointMass, Segment, Unknown, identify
from receptance.fit.discrepancy import Curve, Discrepancy
from receptance.fit.parameters import Site
from receptance.fit.predictor import Predictor

LENGTH = 1.3
LINES = np.linspace(60.0, 1000.0, 2000)
MIDDLE = 0.65
ERROR = Predictor(discrepancy=Discrepancy(frequency=1e-3, relative=0.1))


def make_bar(*masses: PointMass) -> Assembly:
    segments = [
        Segment(length=high - low, outer_diameter=0.035, inner_diameter=0.021, material=STEEL)
        for low, high in pairwise((0.0, 0.5, MIDDLE, 0.8, LENGTH))
    ]
    return Assembly([Part(segments, name="bar")], masses)


def observed(structure: Assembly, hit: float) -> Observation:
    sensor, place = Coordinate("bar", 0.5), Coordinate("bar", hit)
    return Observation(
        assembly=make_bar(),
        frequency_hz=LINES,
        receptance=structure.receptance(LINES, response=sensor, excitation=place),
        standard_deviation=0.01,
        response=sensor,
        excitation=place,
    )


def test_a_peak_at_a_node_of_the_model_has_the_interval_of_its_natural_frequency() -> None:
    """The middle of the bar is a node of the second and the fourth mode, but not of a bar with a mass at one end."""
    structure = make_bar(PointMass(mass=0.005, part="bar", position=0.0))
    predicted = ERROR.at(Site(make_bar())).observed(observed(structure, MIDDLE))
    natural = make_bar().natural_frequencies(1000.0)
    peaks = {peak.mode: peak for peak in predicted.peaks if peak.measured_hz is not None}
    assert set(peaks) == {1, 2, 3, 4}
    for number in (2, 4):
        assert peaks[number].predicted_hz == pytest.approx(natural[number - 1], rel=1e-6)
        assert peaks[number].deviation_hz == pytest.approx(1e-3 * natural[number - 1], rel=1e-3)
        assert peaks[number].within()


def test_a_summit_between_antiresonances_has_no_interval() -> None:
    """Beside the node of the third mode the record has a summit, 15 % below it, that is no natural frequency."""
    predicted = ERROR.at(Site(make_bar())).observed(observed(make_bar(), 0.8))
    natural = make_bar().natural_frequencies(1200.0)
    near = {
        peak.predicted_hz: bool(np.abs(natural / peak.predicted_hz - 1.0).min() < 0.02)
        for peak in predicted.peaks
        if peak.predicted_hz is not None
    }
    assert sorted(near.values()) == [False, True, True, True, True]
    for peak in predicted.peaks:
        assert (peak.deviation_hz is not None) == near[peak.predicted_hz or 0.0]
        assert (peak.mode is not None) == near[peak.predicted_hz or 0.0]


def test_bands_of_draws_have_the_error_between_modes() -> None:
    """Where modes nearly cancel, an error of 10 % of each is a larger one of their sum, in draws as to first order."""
    bar, places = ERROR.at(Site(make_bar())), (Coordinate("bar", 0.5), Coordinate("bar", 0.8))
    drawn = bar.receptance(LINES, *places, draws=400, seed=3)
    widths = [np.log(high / low) for low, high in (drawn.band(), bar.receptance(LINES, *places).band())]
    between = Curve.of(LINES, drawn.receptance).growth > 3.0
    assert 100 < between.sum() < 1500
    ratio = widths[0][between] / widths[1][between]
    assert 0.9 < np.median(ratio) < 1.2
    assert np.quantile(ratio, 0.05) > 0.7


def test_few_data_that_reject_no_model_do_not_show_that_it_is_right() -> None:
    """Of two natural frequencies one is off by four standard deviations, which chance explains in one of 300 cases."""
    natural = make_bar().natural_frequencies(1000.0)
    modulus = {"bar.segment[*].youngs_modulus": (1e11, 4e11)}
    fits = []
    for count, error in ((2, 4.0), (4, 0.0)):
        deviations = 2e-3 * natural[:count]
        shifts = np.zeros(count)
        shifts[1] = error
        modes = Observation.from_modes(
            assembly=make_bar(), frequency_hz=natural[:count] + shifts * deviations, standard_deviation_hz=deviations
        )
        fits.append(identify(modes, [Unknown(address=a, lower=b[0], upper=b[1]) for a, b in modulus.items()]))
    few, right = fits
    assert few.adequacy is not None
    assert few.adequacy.passed
    assert not few.rejection
    assert few.discrepancy is not None
    assert any("too few to tell" in note for note in few.notes)
    # The discrepancy is about the error that is left.
    assert 2e-3 < few.discrepancy.frequency < 1.2e-2
    assert right.discrepancy is None
    widths = [fit.interval(fit.addresses[0])[1] / fit.interval(fit.addresses[0])[0] - 1.0 for fit in fits]
    assert widths[0] > 3.0 * widths[1]
