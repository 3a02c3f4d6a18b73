"""Estimates of FRFs from hits: accuracy, variance, bias, usable lines and notes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import hammer
from receptance import Coordinate
from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, estimate_frf, find_hits

RATE = 25600.0
STRUCTURE = hammer.Structure((0.0, 900.0, 2500.0), (0.0, 0.008, 0.01), (2.0, 3.0, -1.0), RATE)
SILENT = {"force_noise_db": -300.0, "response_noise_db": -300.0}
LONG = 0.6


def strike(hits=10, seed=1, structure=STRUCTURE, **options):
    random = np.random.default_rng(seed)
    return hammer.strike(structure, random, hits=hits, **{"duration_s": LONG} | options)


def records_of(made, **options):
    given = {
        "force": made.force,
        "response": made.response,
        "quantity": made.structure.quantity,
        "sample_rate_hz": RATE,
    }
    return HammerRecords(**given | options)


def error_of(frf, decay_rate=0.0, structure=STRUCTURE):
    return np.log(frf.values[:, 0, 0] / structure.frf(frf.frequency_hz, decay_rate))


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
@pytest.mark.parametrize("decay_rate", [0.0, 30.0])
def test_without_noise_every_estimator_is_exact(estimator, decay_rate):
    frf = estimate_frf(records_of(strike(**SILENT)), estimator=estimator, decay_rate=decay_rate, high_hz=3000.0)
    assert frf.decay_rate == decay_rate
    assert frf.form == "accelerance"
    assert frf.averages == 10
    assert np.abs(error_of(frf, decay_rate)).max() < 2e-5
    assert frf.usable.all()
    other = np.abs(error_of(frf, 30.0 - decay_rate))
    assert other.max() > 0.3, "the shifted line is another FRF than the real one"


def test_spacing_and_band_of_the_lines():
    frf = estimate_frf(records_of(strike(**SILENT)), low_hz=100.0, high_hz=1500.0)
    np.testing.assert_allclose(frf.frequency_hz[[0, -1]], [100.0, 1500.0])
    np.testing.assert_allclose(np.diff(frf.frequency_hz), 1.0 / LONG)
    whole = estimate_frf(records_of(strike(**SILENT)))
    assert whole.frequency_hz[0] == pytest.approx(1.0 / LONG)
    assert whole.frequency_hz[-1] < RATE / 2.0


def test_a_window_on_the_response_alone_excludes_all_lines():
    """e^(-sigma t) at the hit, 10 ms after the block's beginning, is missing from the force: 18 % at 20/s."""
    made = strike(hits=3, **SILENT)
    force = np.roll(made.true_force[0], 256 - np.flatnonzero(made.true_force[0])[0])
    response = STRUCTURE.respond(force)
    records = records_of(made, force=[force] * 3, response=[response] * 3)
    with pytest.warns(ReceptanceWarning, match="neither the FRF on the real lines nor that at w - i sigma"):
        frf = estimate_frf(records, decay_rate=20.0, exponential_on="response")
    band = (frf.frequency_hz > 200.0) & (frf.frequency_hz < 2500.0)
    share = np.abs(np.exp(error_of(frf, 20.0)))[band]
    assert np.median(share) == pytest.approx(np.exp(-20.0 * 0.0102), rel=2e-3)
    assert np.median(share) == pytest.approx(0.82, abs=0.01)
    assert not frf.usable.any()
    assert frf.decay_rate == 0.0
    assert any("the exponential window is on the response alone" in note for note in frf.notes)
    assert estimate_frf(records, exponential_on="response").usable.any(), "without a window there is nothing to refuse"


@pytest.mark.parametrize("more", [0.0, 25.0])
@pytest.mark.parametrize("one_record", [False, True])
def test_a_response_window_of_the_recorder_is_applied_to_the_force(more, one_record):
    made = strike(hits=4, **SILENT)
    force, response = made.force, made.response
    if one_record:
        quick = hammer.Structure((0.0, 900.0), (0.0, 0.02), (2.0, 3.0), RATE)
        force = made.force.reshape(-1)
        response = quick.respond(force)
    else:
        quick = STRUCTURE
    time = np.arange(force.shape[-1]) / RATE
    records = records_of(made, force=force, response=response * np.exp(-4.0 * time), response_decay_rate=4.0)
    frf = estimate_frf(records, decay_rate=more, high_hz=2600.0)
    assert frf.decay_rate == 4.0 + more
    assert np.abs(error_of(frf, 4.0 + more, quick)).max() < 2e-4
    assert any("applied to the force as well" in note for note in frf.notes)


@pytest.mark.parametrize("quantity", hammer.KINDS)
def test_form_and_coordinates_of_the_records(quantity):
    clamped = hammer.Structure((400.0, 900.0), (0.02, 0.01), (2.0, -1.0), RATE, quantity)
    made = strike(structure=clamped, **SILENT)
    nose = Coordinate("holder", 0.02)
    frf = estimate_frf(records_of(made, responses=nose, excitation="y", label="nose", source="a.uff"), high_hz=2000.0)
    assert frf.form == {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}[quantity]
    assert frf.responses == (nose,)
    assert (frf.label, frf.source) == ("nose", "H1 of 10 hits, a.uff")
    assert np.abs(error_of(frf, 0.0, clamped)).max() < 2e-4


def test_variance_agrees_with_the_coherence():
    """With next to no noise on the force and lines of their own it is (1 - g^2) / (2 (n - 1) g^2)."""
    made = strike(force_noise_db=-110.0, response_noise_db=-60.0)
    frf = estimate_frf(records_of(made), pooled_lines=1, high_hz=3000.0)
    g2 = frf.coherence[:, 0, 0]
    clear = g2 < 1.0 - 1e-6
    np.testing.assert_allclose(frf.log_variance[clear, 0, 0], ((1.0 - g2) / (18.0 * g2))[clear], rtol=1e-3)
    np.testing.assert_allclose(frf.degrees_of_freedom, 18.0, rtol=1e-3)


@pytest.mark.slow
def test_variance_with_hits_of_very_different_strength():
    """The force is no random signal: the variance of errors over its estimate is that of F(2, 2 (n - 1))."""
    found = []
    for seed in range(40):
        made = strike(seed=seed, hits=4, duration_s=0.3, force_noise_db=-110.0)
        strength = np.array([1.0, 0.3, 0.1, 0.03])[:, None]
        noise = made.response - STRUCTURE.respond(made.force)
        records = records_of(
            made, force=strength * made.force, response=STRUCTURE.respond(strength * made.force) + noise
        )
        frf = estimate_frf(records, pooled_lines=1, decay_rate=40.0, low_hz=1200.0, high_hz=2400.0)
        lines = slice(None, None, 60)
        ratio = np.abs(error_of(frf, 40.0)[lines]) ** 2 / (2.0 * frf.log_variance[lines, 0, 0])
        found += ratio.tolist()
    assert stats.kstest(found, stats.f(2.0, 6.0).cdf).pvalue > 1e-3


def test_noise_on_the_force_biases_h1_but_not_hv():
    made = strike(hits=150, duration_s=0.25, force_noise_db=-26.0, response_noise_db=-70.0)
    options = {"decay_rate": 40.0, "low_hz": 300.0, "high_hz": 2200.0}
    with pytest.warns(ReceptanceWarning, match=r"noise biases H1; Hv accounts for noise on the force"):
        h1 = estimate_frf(records_of(made), **options)
    hv = estimate_frf(records_of(made), estimator="Hv", **options)
    with pytest.warns(ReceptanceWarning, match="use Hv|decayed|usable"):
        h2 = estimate_frf(records_of(made), estimator="H2", **options, largest_deviation=1e-4)
    errors = [error_of(frf, 40.0).real.mean() for frf in (h1, hv, h2)]
    deviation = np.sqrt(np.mean(hv.log_variance))
    assert errors[0] < -0.01
    assert abs(errors[1]) < 0.5 * deviation
    assert errors[0] < errors[1]
    magnitudes = [np.abs(frf.values[:, 0, 0]) for frf in (h1, hv, h2)]
    assert np.all(magnitudes[0] <= magnitudes[1])
    assert np.all(magnitudes[1] <= magnitudes[2] * (1.0 + 0.5 * deviation))
    assert not h1.usable.any()
    assert hv.usable.all()


def test_hv_without_silence_is_the_geometric_mean():
    made = strike(force_noise_db=-45.0, response_noise_db=-30.0)
    records = records_of(made, force=np.where(made.true_force > 0.0, made.force, 0.0))
    frfs = {}
    for estimator in ("H1", "H2", "Hv"):
        with pytest.warns(ReceptanceWarning, match="noise on the force could not be estimated"):
            frfs[estimator] = estimate_frf(records, estimator=estimator).values[:, 0, 0]
    np.testing.assert_allclose(np.abs(frfs["Hv"]) ** 2, np.abs(frfs["H1"] * frfs["H2"]), rtol=1e-12)


@pytest.mark.slow
def test_noise_through_a_short_window_is_noncircular_at_low_frequencies():
    """Below 1 / (window length) the force's noise is in phase with the pulse: twice the variance, in one part."""
    real, imaginary = [], []
    for seed in range(40):
        made = strike(seed=seed, duration_s=0.25, force_noise_db=-45.0, response_noise_db=-120.0)
        frf = estimate_frf(records_of(made), decay_rate=40.0, low_hz=60.0, high_hz=100.0)
        deviation = error_of(frf, 40.0) / np.sqrt(frf.log_variance[:, 0, 0])
        real.append(np.mean(deviation.real**2))
        imaginary.append(np.mean(deviation.imag**2))
    assert 0.6 < np.mean(real) < 1.5
    assert np.mean(imaginary) < 0.2


def test_several_channels():
    made = strike()
    other = hammer.Structure((0.0, 600.0), (0.0, 0.02), (1.0, -2.0), RATE)
    quiet = other.respond(made.force)
    both = records_of(made, response=np.stack([made.response, quiet], axis=2), responses=["y", "y"])
    frf = estimate_frf(both)
    alone = [estimate_frf(both.channel(k)) for k in range(2)]
    assert frf.shape == (frf.frequency_hz.size, 2, 1)
    for k in range(2):
        for name in ("values", "log_variance", "coherence", "degrees_of_freedom"):
            np.testing.assert_allclose(getattr(frf, name)[:, k], getattr(alone[k], name)[:, 0], rtol=1e-6)
    np.testing.assert_array_equal(frf.usable, alone[0].usable & alone[1].usable)
    assert alone[1].usable.sum() > frf.usable.sum()


def test_one_hit_has_no_variance():
    with pytest.warns(ReceptanceWarning, match="there is a single hit"):
        frf = estimate_frf(records_of(strike(hits=1)), high_hz=3000.0)
    assert frf.coherence is None
    assert frf.log_variance is None
    assert frf.averages == 1
    assert np.median(np.abs(error_of(frf))) < 0.03


def test_notes_state_the_reasons_of_excluded_lines():
    made = strike(contact_s=6e-4, response_noise_db=-40.0)
    frf = estimate_frf(records_of(made))
    notes = "\n".join(frf.notes)
    assert "where the force spectrum is over 20 dB down" in notes
    assert "above the range of the recorder's filter (sampling rate / 2.56)" in notes
    assert "where the scatter is large (standard deviation of the log over 0.12)" in notes
    assert np.sqrt(frf.log_variance[frf.usable]).max() <= 0.12
    spectrum = np.abs(np.fft.rfft(made.true_force, axis=1)[:, 1 : frf.frequency_hz.size + 1]) ** 2
    level = 10.0 * np.log10(spectrum.sum(axis=0) / spectrum.sum(axis=0).max())
    assert level[frf.usable].min() > -21.0
    wider = estimate_frf(records_of(made), force_drop_db=10.0, largest_deviation=0.5)
    assert level[wider.usable].min() > -11.0
    stated = f"usable: {frf.usable.sum()} of {frf.usable.size} lines"
    assert stated in notes


@pytest.mark.parametrize("noise_db", [-300.0, -60.0])
@pytest.mark.parametrize("duration_s", [0.1, 0.15])
def test_truncation_error_within_a_factor(duration_s, noise_db):
    made = strike(duration_s=duration_s, force_noise_db=noise_db, response_noise_db=noise_db)
    with pytest.warns(ReceptanceWarning, match=r"not decayed at the end of the block .*decay_rate=\d+"):
        frf = estimate_frf(records_of(made), high_hz=3000.0)
    clean = strike(duration_s=duration_s, **SILENT)
    with pytest.warns(ReceptanceWarning, match="decayed"):
        true = np.abs(error_of(estimate_frf(records_of(clean), high_hz=3000.0)))
    refused = true[~frf.usable]
    kept = true[frf.usable] / np.sqrt(frf.log_variance[frf.usable, 0, 0])
    assert refused.size > 10
    # Up to a factor of two where the residue's phase is not that of the estimate.
    assert kept.size == 0 or np.quantile(kept, 0.99) < 2.0
    assert refused.max() > 3.0 * (true[frf.usable].max() if frf.usable.any() else 0.0)


def test_the_suggested_window_is_sufficient():
    made = strike(duration_s=0.1)
    with pytest.warns(ReceptanceWarning) as caught:
        estimate_frf(records_of(made))
    suggested = float(str(caught[0].message).split("decay_rate=")[1].split(")")[0])
    frf = estimate_frf(records_of(made), decay_rate=suggested)
    notes = [note for note in frf.notes if "decayed" in note]
    assert frf.usable.sum() > 300
    assert not [note for note in notes if "use longer" in note]


def test_a_kept_double_hit_gives_the_same_frf():
    made = strike(hits=4, **SILENT)
    time = np.arange(made.force.shape[1]) / RATE
    bounce = hammer.pulse(time, 0.016, 4e-4, 30.0)
    force = made.force + bounce
    records = records_of(made, force=force, response=STRUCTURE.respond(force))
    with pytest.warns(ReceptanceWarning, match="second pulse"):
        hits = find_hits(records, double_hit_loss_db=np.inf)
    frf = estimate_frf(hits, high_hz=2600.0)
    assert np.abs(error_of(frf))[frf.usable].max() < 1e-4
    blind = replace(hits, hits=tuple(replace(hit, release=hit.onset + round(4e-4 * RATE)) for hit in hits.hits))
    with pytest.warns(ReceptanceWarning, match="there is force outside the force window"):
        cut = estimate_frf(blind, high_hz=2600.0)
    assert np.abs(error_of(cut)).max() > 0.05
    assert not cut.usable.any() or np.abs(error_of(cut))[cut.usable].max() < 0.03


def test_force_windows():
    made = strike(hits=10, force_noise_db=-45.0)
    frfs = [estimate_frf(records_of(made), force_window_s=length, high_hz=2500.0) for length in ("auto", 5e-3)]
    with pytest.warns(ReceptanceWarning, match="noise biases H1"):
        frfs.append(estimate_frf(records_of(made), force_window_s=None, high_hz=2500.0))
    variances = [np.median(frf.log_variance) for frf in frfs]
    assert variances[0] < variances[1] < variances[2]
    with pytest.raises(ValueError, match=r"force_window_s is 0.0001 s, expected at least the longest contact"):
        estimate_frf(records_of(made), force_window_s=1e-4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"estimator": "H3"}, "estimator is 'H3', expected one of H1, H2, Hv"),
        ({"exponential_on": "force"}, "exponential_on is 'force', expected one of both, response"),
        ({"decay_rate": -1.0}, "decay_rate is -1"),
        ({"pooled_lines": 4}, "pooled_lines is 4, expected an odd number"),
        (
            {"low_hz": 100.1, "high_hz": 100.2},
            "there is no line between 100.1 and 100.2 Hz; lines are 1.66667 Hz apart",
        ),
        ({"force_drop_db": 0.0}, "force_drop_db is 0"),
        ({"force_window_s": 0}, "force_window_s is 0"),
    ],
)
def test_invalid_settings(options, message):
    with pytest.raises(ValueError, match=message):
        estimate_frf(records_of(strike(hits=2)), **options)


def test_all_hits_dropped():
    made = strike(hits=2)
    hits = find_hits(records_of(made)).without(1, 2, reason="wrong place")
    with pytest.raises(ValueError, match=r"all hits were dropped\n(.*\n)+.*dropped: wrong place"):
        estimate_frf(hits)


def test_a_zero_channel_is_an_error():
    made = strike(hits=2)
    records = records_of(made, response=np.stack([made.response, 0.0 * made.response], axis=2), responses=["y", "y"])
    with pytest.raises(ValueError, match="response channel 1 is zero in all hits; is the sensor connected"):
        estimate_frf(records)


def test_notes_on_the_processing():
    made = strike(hits=5)
    hits = find_hits(records_of(made, notes=["laser at 45 degrees"])).without(2, reason="wrong place")
    frf = estimate_frf(hits, decay_rate=10.0, estimator="Hv")
    notes = "\n".join(frf.notes)
    for part in (
        "laser at 45 degrees",
        "hit 2 dropped: wrong place",
        "Hv of 4 hits",
        "force window:",
        "10 1/s on both",
    ):
        assert part in notes
    assert frf.source.startswith("Hv of 4 of 5 hits")
