"""From FRFs to observations: entry, lines, standard deviations, notes; several responses together."""

import warnings

import numpy as np
import pytest

from receptance import FRF, Assembly, Coordinate, GroundSpring, Observation, ReceptanceWarning, identify
from receptance.diagnosis import diagnose
from receptance.model.coordinates import UnknownPosition
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, assert_found, make_assembly

TIP, NOSE = Coordinate("tool"), Coordinate("holder", 0.0)
SLOPE = Coordinate("tool", 0.0, "theta")
ASSEMBLY = make_assembly()


def make(responses=(TIP, NOSE, SLOPE), **changes):
    values = ASSEMBLY.receptance(LINES, response=list(responses), excitation=[TIP])
    fields = {"frequency_hz": LINES, "values": values, "responses": responses, "excitations": TIP, "label": "bench"}
    return FRF(**(fields | changes))


@pytest.mark.parametrize("response", [TIP, NOSE, SLOPE])
def test_entries_by_coordinate_number_and_label(response):
    frf = make(labels=(("1", "2", "3"), ("1",)))
    index = frf.responses.index(response)
    expected = ASSEMBLY.receptance(LINES, response=response, excitation=TIP)
    for requested in (response, index, str(index + 1)):
        observed = Observation.from_frf(ASSEMBLY, frf, response=requested)
        np.testing.assert_array_equal(observed.receptance, expected)
        assert (observed.response, observed.excitation) == (response, TIP)
        assert (observed.label, observed.notes, observed.standard_deviation) == ("bench", (), None)


def test_a_joint_from_several_responses_of_one_frf():
    rng = np.random.default_rng(11)
    sd = 0.01
    noise = sd * (rng.normal(size=(LINES.size, 3, 1)) + 1j * rng.normal(size=(LINES.size, 3, 1)))
    exact = make(log_variance=sd**2, degrees_of_freedom=60.0).to("accelerance")
    frf = exact.with_(values=exact.values * np.exp(noise))
    observed = [Observation.from_frf(ASSEMBLY, frf, response=i) for i in range(3)]
    together = identify(observed, STIFFNESSES + DASHPOTS, starts=4)
    alone = identify(observed[:1], STIFFNESSES + DASHPOTS, starts=4)
    assert together.converged
    assert together.units == ["standard deviations"] * 3
    for address, value in TRUE.items():
        error = together.standard_errors[address]
        assert abs(together.values[address] - value) < 4.0 * error, address
        # More responses, smaller errors: three times the lines at least if each has as much information as the first.
        assert error < alone.standard_errors[address]
    clean = [Observation.from_frf(ASSEMBLY, exact, response=i) for i in range(3)]
    assert_found(identify(clean, STIFFNESSES + DASHPOTS, starts=4), TRUE)


def test_a_rotation_per_force_alone_finds_the_joint():
    observed = Observation.from_frf(ASSEMBLY, make().to("mobility"), response=SLOPE)
    assert_found(identify(observed, STIFFNESSES + DASHPOTS), TRUE)


def test_lines_band_mask_and_zero():
    lines = np.r_[0.0, LINES]
    values = np.concatenate([np.ones((1, 3, 1)), make().values])
    frf = make(frequency_hz=lines, values=values, usable=lines < 9e3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        observed = Observation.from_frf(ASSEMBLY, frf, response=TIP, low_hz=0.0, high_hz=12e3)
    np.testing.assert_array_equal(observed.frequency_hz, LINES[LINES < 9e3])
    observed = Observation.from_frf(ASSEMBLY, frf.to("accelerance").with_(usable=None), response=TIP)
    np.testing.assert_array_equal(observed.frequency_hz, LINES)
    assert any("0 Hz is dropped" in note for note in observed.notes)


def test_spread():
    frf = make(log_variance=1e-4)
    for one, factor in (
        (frf, 1.0),
        (frf.with_(correlated_lines=9.0), 9.0),
        # Estimated variances weigh wrongly: nu / (nu - 4).
        (frf.with_(degrees_of_freedom=18), 18.0 / 14.0),
        (frf.with_(degrees_of_freedom=3), 2.0),
        (frf.with_(degrees_of_freedom=np.inf), 1.0),
        (frf.to("accelerance"), 1.0),
    ):
        observed = Observation.from_frf(ASSEMBLY, one, response=0)
        np.testing.assert_allclose(observed.standard_deviation, np.sqrt(1e-4 * factor))
    floor = Observation.from_frf(ASSEMBLY, frf.with_(degrees_of_freedom=18), response=0, floor=0.003)
    np.testing.assert_allclose(floor.standard_deviation, np.sqrt(1e-4 * 18.0 / 14.0 + 9e-6))
    # A variance that follows the receptance is smoothed_variance, by less than the noise itself.
    variance = 1e-4 * np.exp(np.sin(LINES / 1e3))
    observed = Observation.from_frf(ASSEMBLY, make(log_variance=variance), response=0)
    np.testing.assert_allclose(observed.standard_deviation, np.sqrt(variance), rtol=0.02)


# Neighbours that are independent are further away if lines are correlated, and have less information.
@pytest.mark.parametrize(("correlated", "left"), [(1, 0.4), (6, 0.8)])
def test_weights_are_independent_of_the_noise_of_their_line(correlated, left):
    """Additive noise over the measured magnitude would weigh lines more that noise has made larger."""
    rng = np.random.default_rng(4)
    clean = ASSEMBLY.receptance(LINES)
    level = 0.1 * np.median(np.abs(clean))
    quiet = level < 0.3 * np.abs(clean)
    biases, smoothed_variance = [], []
    for draw in range(20):
        if draw % 2 == 0:  # each noise with both signs, so that odd terms cancel
            parts = np.cumsum(rng.standard_normal((2, LINES.size + correlated)), axis=1) / np.sqrt(correlated)
            noise = level * ((parts[0] + 1j * parts[1])[correlated:] - (parts[0] + 1j * parts[1])[:-correlated])
        measured = clean + (-1.0) ** draw * noise
        frf = FRF(frequency_hz=LINES, values=measured, log_variance=(level / np.abs(measured)) ** 2)
        data = Observation.from_frf(ASSEMBLY, frf.with_(correlated_lines=correlated))
        error = np.log(np.abs(measured / clean))
        biases.append(np.mean((error / (level / np.abs(measured)) ** 2)[quiet]))
        smoothed_variance.append(correlated * np.mean((error / data.standard_deviation**2)[quiet]))
        ratio = data.standard_deviation**2 / correlated / (level / np.abs(clean)) ** 2
        assert np.median(np.abs(np.log(ratio[quiet]))) < 0.1
    # 2 for every line, independent of its noise.
    assert np.mean(biases) == pytest.approx(2.0, abs=0.3)
    assert abs(np.mean(smoothed_variance)) < left


def test_a_variance_of_zero_among_others_is_a_rounded_one():
    variance = np.full(LINES.size, 3e-4)
    variance[::3] = 0.0
    observed = Observation.from_frf(ASSEMBLY, make(log_variance=variance), response=0)
    np.testing.assert_allclose(observed.standard_deviation[::3], np.sqrt(0.5e-4), rtol=0.3)
    assert any("zero on 400 of 1200 lines: half a unit of its last digit, 5e-05" in note for note in observed.notes)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_coherence_of_two_decimals_gives_an_interval_with_the_truth(seed):
    """Ten averages with 2 % of scatter; 97 % of the lines have a coherence of 1.00."""
    assembly = make_assembly(k_y=4.2e8)
    true = assembly.receptance(LINES)
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(2, 10, LINES.size)) + 1j * rng.normal(size=(2, 10, LINES.size))
    hits = true * (1.0 + 0.02 * noise[0]) + 0.002 * np.median(np.abs(true)) * noise[1]
    coherence = np.abs(hits.mean(axis=0)) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)
    exact = FRF(frequency_hz=LINES, values=hits.mean(axis=0), coherence=coherence, averages=10)
    rounded = exact.with_(coherence=coherence.round(2))
    assert 0.95 < np.mean(rounded.coherence == 1.0) < 1.0
    full, few = (
        identify(Observation.from_frf(assembly, frf), STIFFNESSES + DASHPOTS, starts=2) for frf in (exact, rounded)
    )
    assert abs(few.values["joint.k_y"] - 4.2e8) < 3.0 * few.standard_errors["joint.k_y"]
    assert 1.0 < few.standard_errors["joint.k_y"] / full.standard_errors["joint.k_y"] < 4.0
    deviation = Observation.from_frf(assembly, rounded).standard_deviation
    assert deviation.min() > np.sqrt(0.005 / 18.0) * 0.99


def test_coherence_needs_averages_for_the_variance():
    rng = np.random.default_rng(5)
    hits = ASSEMBLY.receptance(LINES) * (1.0 + 0.03 * (rng.normal(size=(8, 1200)) + 1j * rng.normal(size=(8, 1200))))
    coherence = np.abs(hits.mean(axis=0)) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)
    frf = FRF(frequency_hz=LINES, values=hits.mean(axis=0), coherence=coherence)
    data = Observation.from_frf(ASSEMBLY, frf.with_(averages=8))
    assert np.median(data.standard_deviation) == pytest.approx(0.03 / np.sqrt(8.0), rel=0.1)
    with pytest.warns(
        ReceptanceWarning, match="the coherence is not used, because the number of averaged records is unknown"
    ):
        without = Observation.from_frf(ASSEMBLY, frf)
    assert without.standard_deviation is None
    assert any("`averages = 10` for" in note for note in without.notes)
    with pytest.raises(ValueError, match=r"has no standard deviation.*`averages = 10` for"):
        diagnose(without, STIFFNESSES)


def test_correlated_lines_enlarge_standard_errors():
    # Every line three times has the information of one: same values, same errors.
    lines = np.linspace(100.0, 15e3, 400)
    copies = np.repeat(lines, 3) + np.tile([0.0, 1e-7, 2e-7], 400)
    rng = np.random.default_rng(2)
    noise = np.exp(0.02 * (rng.normal(size=400) + 1j * rng.normal(size=400)))
    values = ASSEMBLY.receptance(lines) * noise
    once = FRF(frequency_hz=lines, values=values, log_variance=4e-4)
    thrice = FRF(frequency_hz=copies, values=np.repeat(values, 3), log_variance=4e-4, correlated_lines=3.0)
    first, second = (identify(Observation.from_frf(ASSEMBLY, f), STIFFNESSES, starts=2) for f in (once, thrice))
    for address in first.values:
        assert second.values[address] == pytest.approx(first.values[address], rel=1e-6)
        assert second.standard_errors[address] == pytest.approx(first.standard_errors[address], rel=1e-3)


def test_infinite_variance_excludes_lines_and_zero_needs_a_floor():
    variance = np.full(LINES.size, 1e-4)
    variance[[5, 9]] = np.inf
    observed = Observation.from_frf(ASSEMBLY, make(log_variance=variance), response=0)
    assert observed.frequency_hz.size == LINES.size - 2
    assert "2 lines of infinite variance are left out" in observed.notes
    exact = make(log_variance=0.0)
    with pytest.raises(ValueError, match=r"the variance is zero on all lines.*give a floor"):
        _ = Observation.from_frf(ASSEMBLY, exact, response=0).standard_deviation
    with pytest.warns(ReceptanceWarning, match=r"zero on all lines.*the floor of 0.002 is the only standard deviation"):
        deviation = Observation.from_frf(ASSEMBLY, exact, response=0, floor=0.002).standard_deviation
    np.testing.assert_allclose(deviation, 0.002, rtol=1e-12)
    without = Observation.from_frf(ASSEMBLY, make(), response=0, floor=0.01)
    assert without.standard_deviation[0] == 0.01
    assert any("floor of 0.01 is its standard deviation" in note for note in without.notes)
    with pytest.raises(ValueError, match="no line is left for bench"):
        Observation.from_frf(ASSEMBLY, make(log_variance=np.inf), response=0)


def test_few_degrees_of_freedom_are_noted_in_the_result():
    frf = make(log_variance=1e-4, degrees_of_freedom=4, notes=["hit 3 dropped"])
    observed = Observation.from_frf(ASSEMBLY, frf, response=0)
    assert observed.notes[0] == "hit 3 dropped"
    assert "from 4 degrees of freedom are uncertain" in observed.notes[1]
    result = identify(observed, STIFFNESSES, starts=1)
    assert set(observed.notes) <= set(result.notes)


def test_unknown_and_inconsistent_positions():
    values = ASSEMBLY.receptance(LINES)
    unplaced = FRF(frequency_hz=LINES, values=values)
    observed = Observation.from_frf(ASSEMBLY, unplaced)
    assert observed.response == observed.excitation == Coordinate()
    assert not isinstance(observed.response, UnknownPosition)
    assert sum("taken at the tip" in note for note in observed.notes) == 2
    reported = Observation.from_frf(ASSEMBLY, unplaced, response=NOSE, excitation=TIP)
    assert (reported.response, reported.excitation, reported.notes) == (NOSE, TIP, ())
    other = Observation.from_frf(ASSEMBLY, make(responses=(TIP,)), response=NOSE)
    assert other.response == NOSE
    assert any("is taken at" in note and "the FRF has" in note for note in other.notes)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({}, ValueError, "has 3 responses: select one with response=, a coordinate or a number"),
        ({"response": 3}, ValueError, "none of the responses is 3"),
        ({"response": Coordinate("holder", "end")}, ValueError, "none of the responses is"),
        ({"response": 0, "excitation": SLOPE}, ValueError, "its excitation is in direction 'y'"),
        ({"response": 0, "low_hz": 20e3}, ValueError, "no line from 20000"),
        ({"response": 0, "floor": -1.0}, ValueError, "floor is -1"),
        ({"response": "4"}, ValueError, "none of the responses is '4'"),
    ],
)
def test_bad_requests(options, error, words):
    with pytest.raises(error, match=words):
        Observation.from_frf(ASSEMBLY, make(), **options)


def test_input_other_than_an_frf():
    with pytest.raises(TypeError, match="frf is None, expected an FRF"):
        Observation.from_frf(ASSEMBLY, None)
    with pytest.raises(TypeError, match="assembly is None"):
        Observation.from_frf(None, make(), response=0)
    with pytest.raises(TypeError, match="notes is 'one'"):
        Observation(assembly=ASSEMBLY, frequency_hz=[1.0], receptance=[1.0], notes="one")


def test_integrated_noise_at_low_frequencies_is_noted_and_a_floating_body_is_not():
    lines = np.arange(2.0, 3000.0, 2.0)
    random = np.random.default_rng(7)  # seed
    scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)

    def notes(assembly, noise, **changes):
        """Return the notes for white noise of the accelerometer, relative to the accelerance of a mass."""
        accelerance = -((2.0 * np.pi * lines) ** 2) * assembly.receptance(lines) + noise * inertia * scatter
        frf = FRF(frequency_hz=lines, values=accelerance, form="accelerance", responses=TIP, excitations=TIP, **changes)
        return [one for one in Observation.from_frf(assembly, frf).notes if "1/f^2" in one]

    inertia = (2.0 * np.pi * 2.0) ** 2 * abs(ASSEMBLY.receptance([2.0])[0])
    assert not notes(ASSEMBLY, 0.0)
    assert not notes(ASSEMBLY, 0.02)
    (text,) = notes(ASSEMBLY, 2.0)
    assert "from 2 to " in text
    # Held by a spring, so that the same noise is more than the motion up to some frequency alone.
    ground = GroundSpring(k_y=1e9, k_theta=1e7, part="holder", position="end")
    held = Assembly(list(ASSEMBLY.elements.values()), [ground])
    assert not notes(held, 0.0)
    (text,) = notes(held, 0.1)
    start = float(text.partition("below about ")[2].partition(" Hz")[0])
    stiffness = 1.0 / abs(held.receptance([2.0])[0])
    # There the noise is as much as the motion of a spring at this frequency, and advised is three times as much.
    crossing = np.sqrt(0.1 * np.sqrt(2.0) * inertia * stiffness) / (2.0 * np.pi)
    assert 1.5 * crossing < start < 6.0 * crossing
    # A variance that covers it is enough: a fit then gives such lines no weight.
    magnitude = (2.0 * np.pi * lines) ** 2 * abs(held.receptance(lines))
    assert not notes(held, 0.1, log_variance=(0.1 * inertia / np.maximum(magnitude, 0.14 * inertia)) ** 2)
    assert notes(held, 0.1, log_variance=1e-4)
