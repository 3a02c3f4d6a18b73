"""Detection of hits, and the reasons for dropping some."""

import warnings

import numpy as np
import pytest
from scipy.signal import ellip, firwin, sosfilt

import hammer
from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, find_hits
from receptance.hammer.hits import spectrum_loss_db

RATE = 25600.0
STRUCTURE = hammer.Structure((0.0, 900.0, 2500.0), (0.0, 0.01, 0.02), (2.0, 3.0, -1.0), RATE)
N = 5120
TIME = np.arange(N) / RATE


def strike(hits=5, **options):
    given = {"force_noise_db": -60.0, "response_noise_db": -60.0, "duration_s": N / RATE}
    return hammer.strike(STRUCTURE, np.random.default_rng(3), hits=hits, **given | options)


def records_of(force, response, **options):
    return HammerRecords(force=force, response=response, sample_rate_hz=RATE, quantity="acceleration", **options)


def test_clean_hits_are_kept_without_warnings():
    made = strike()
    hits = find_hits(records_of(made.force, made.response))
    assert len(hits) == len(hits.kept) == 5
    assert hits.notes == ()
    assert hits.n_samples == N
    force, response = hits.blocks()
    np.testing.assert_array_equal(force, made.force)
    np.testing.assert_array_equal(response[:, :, 0], made.response)
    for hit, true in zip(hits.kept, made.true_force, strict=True):
        begins = np.flatnonzero(true)[0]
        assert abs(hit.onset - begins) <= 2
        assert abs(hit.release - np.flatnonzero(true)[-1]) <= 3
        assert hit.peak == pytest.approx(true.max(), rel=0.02)
    np.testing.assert_allclose(hits.noise, 1e-3 * made.true_force.max(), rtol=0.1)


def test_reasons_of_dropped_hits():
    made = strike(hits=7)
    force, response = made.force.copy(), made.response.copy()
    bounce = hammer.pulse(TIME, 0.02, 4e-4, 0.4 * force[1].max())
    force[1] += bounce
    response[1] += STRUCTURE.respond(bounce)
    force[2] = np.minimum(force[2], 0.7 * force[2].max())
    response[3] = np.clip(response[3], -0.5 * np.abs(response[3]).max(), None)
    force[4] = force[4, ::-1][: N // 2].mean() + 0.0 * force[4]
    force[5] = np.roll(force[5], -np.flatnonzero(made.true_force[5])[3])
    force[6] *= 1.3 / force[6].max() * force.max()
    with pytest.warns(ReceptanceWarning, match=r"blank: hit 2 dropped: double hit: .*hit 3 dropped: overload"):
        hits = find_hits(records_of(force, response, label="blank", full_scale_force=0.99 * force[6].max()))
    reasons = [hit.reason for hit in hits.hits]
    assert reasons[0] == ""
    assert "a contact with 40 % of the force" in reasons[1]
    assert "ms later" in reasons[1]
    assert "the force has a flat top of" in reasons[2]
    assert "the response has a flat top of" in reasons[3]
    assert reasons[4].startswith("no hit: the largest force")
    assert "the record begins within the contact" in reasons[5]
    assert "the force reaches" in reasons[6]
    assert "full scale is" in reasons[6]
    assert len(hits) == 1
    assert [hit.number for hit in hits.dropped] == [2, 3, 4, 5, 6, 7]
    assert len(hits.tables()[0].rows) == 7
    assert "1 of 7 kept" in repr(hits)
    assert all(f"hit {number} dropped: " in " ".join(hits.notes) for number in range(2, 8))


@pytest.mark.parametrize("noise_db", [-300.0, -80.0, -60.0, -45.0])
def test_detection_of_second_contacts_in_noise(noise_db):
    random = np.random.default_rng((0, 5))
    made = hammer.strike(STRUCTURE, random, hits=20, force_noise_db=noise_db, response_noise_db=-60.0, duration_s=0.2)
    force = made.force.copy()
    share = max(0.03, 12.0 * 10.0 ** (noise_db / 20.0))
    for row in range(0, 20, 2):
        peak = made.true_force[row].max()
        largest = made.true_force.max()
        force[row] += hammer.pulse(TIME, random.uniform(0.015, 0.19), 4e-4, max(share * largest, 0.03 * peak))
    with pytest.warns(ReceptanceWarning, match="double hit"):
        hits = find_hits(records_of(force, made.response), double_hit_loss_db=0.0, deviating_hits="keep")
    assert [hit.number - 1 for hit in hits.dropped] == list(range(0, 20, 2))


def test_several_records_with_several_hits():
    made = strike(hits=4)
    force, response = made.force.reshape(2, -1), made.response.reshape(2, -1)
    with pytest.warns(ReceptanceWarning, match="double hit"):
        assert len(find_hits(records_of(force, response)).hits) == 2
    hits = find_hits(records_of(force, response), one_per_record=False, duration_s=0.9 * TIME[-1], pre_trigger_s=0.005)
    assert [hit.record for hit in hits.hits] == [0, 0, 1, 1]
    assert [hit.peak for hit in hits.hits] == pytest.approx(made.force.max(axis=1), rel=0.05)


def test_a_kept_double_hit_extends_to_its_last_contact():
    made = strike(hits=2)
    force = made.force.copy()
    force[1] += hammer.pulse(TIME, 0.03, 4e-4, 0.2 * force[1].max())
    with pytest.warns(ReceptanceWarning, match="hit 2: a second pulse"):
        hits = find_hits(records_of(force, made.response), double_hit_loss_db=np.inf)
    assert len(hits) == 2
    assert "second pulse" in hits.hits[1].note
    assert hits.hits[1].release == pytest.approx(0.0304 * RATE, abs=4)


def long_record(gaps, seed=1, noise=0.02):
    """Return one record with hits so many seconds apart, the last gap being what follows the last hit."""
    starts = np.cumsum([0.05, *gaps[:-1]])
    n = round((starts[-1] + gaps[-1]) * RATE)
    time = np.arange(n) / RATE
    force = sum(hammer.pulse(time, start, 4e-4, 100.0) for start in starts)
    random = np.random.default_rng(seed)
    response = STRUCTURE.respond(force)
    return records_of(force + noise * random.standard_normal(n), response + 0.2 * random.standard_normal(n)), starts


def recorded(contact_s, bounce=None, phase="linear", noise=0.0, seed=3):
    """A half-sine 0.1 s into a record at 512 Hz, and a second one, through a recorder's filter."""
    rate, over, n = 512.0, 64, 1024
    time = np.arange(n * over) / (rate * over)
    fine = np.zeros(time.size)
    for start, peak in ((0.1, 40.0), *([(0.1 + bounce[0], 40.0 * bounce[1])] if bounce else [])):
        inside = (time > start) & (time < start + contact_s)
        fine[inside] += peak * np.sin(np.pi * (time[inside] - start) / contact_s)
    if phase == "linear":
        force = np.convolve(fine, firwin(over * 40 + 1, 0.4 * rate, fs=rate * over), "same")[::over]
    else:
        force = sosfilt(ellip(8, 0.05, 90, 0.4 * rate, fs=rate * over, output="sos"), fine)[::over]
    force = force + noise * np.abs(force).max() * np.random.default_rng(seed).normal(size=n)
    ring = np.exp(-3.0 * np.arange(n) / rate) * np.sin(2.0 * np.pi * 40.0 * np.arange(n) / rate)
    return HammerRecords(force=force, response=ring, sample_rate_hz=rate, quantity="acceleration")


@pytest.mark.parametrize("phase", ["linear", "minimum"])
@pytest.mark.parametrize("noise", [0.0, 0.003])
@pytest.mark.parametrize("contact_ms", [0.5, 2.0, 10.0])
def test_ringing_of_the_anti_alias_filter_is_not_a_second_contact(contact_ms, noise, phase):
    """Before and after a pulse of few samples; real second contacts with the same recorder are found."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        found = find_hits(recorded(1e-3 * contact_ms, None, phase, noise))
        assert [hit.reason for hit in found.hits] == [""]
        for after_s in (0.035, 0.06):
            for share in (0.1, 0.3, 1.0):
                found = find_hits(recorded(1e-3 * contact_ms, (after_s, share), phase, noise), double_hit_loss_db=0.0)
                assert len(found.hits) == 1
                words = found.hits[0].reason
                assert words.startswith("double hit: a contact with"), (after_s, share, words)
                reported, later = float(words.split()[5]), float(words.split()[10])
                assert reported == pytest.approx(100.0 * share, rel=0.35)
                assert later == pytest.approx(1e3 * after_s, abs=14.0)


@pytest.mark.parametrize("samples", [1, 3, 8])
def test_a_second_contact_close_to_the_first_is_not_ringing(samples):
    """Pulses without a filter, the second one some samples after the end of the first: no negative force between."""
    seed = 3
    for gap in (2, 4, 8):
        for share in (0.15, 0.3, 0.6, 0.9):
            force = 1e-3 * np.random.default_rng(seed).normal(size=2048)
            pulse = 40.0 * np.sin(np.pi * (np.arange(samples) + 0.5) / samples)
            second = 50 + samples + gap
            force[50 : 50 + samples] += pulse
            force[second : second + samples] += share * pulse
            response = 30.0 * np.exp(-30.0 * np.arange(2048) / 12800.0) * np.sin(np.arange(2048) * 0.4)
            records = HammerRecords(force=force, response=response, sample_rate_hz=12800.0, quantity="acceleration")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ReceptanceWarning)
                (hit,) = find_hits(records, double_hit_loss_db=0.0).hits
            assert "double hit" in hit.reason, (samples, gap, share)


def test_one_long_record():
    records, starts = long_record([0.4, 0.5, 0.45, 0.5])
    hits = find_hits(records)
    assert len(hits) == 4
    np.testing.assert_allclose([hit.time_s for hit in hits.kept], starts, atol=2 / RATE)
    assert hits.duration_s == pytest.approx(0.4, abs=1e-3)
    assert {hit.onset - hit.start for hit in hits.kept} == {256}
    assert find_hits(records, duration_s=0.3, pre_trigger_s=0.02).duration_s == pytest.approx(0.3)


def test_an_early_hit_drops_only_the_one_before_it():
    records, _ = long_record([0.4, 0.15, 0.4, 0.4])
    with pytest.warns(ReceptanceWarning) as caught:
        hits = find_hits(records)
    assert [bool(hit.reason) for hit in hits.hits] == [False, True, False, False]
    assert "the next hit follows after 0.15 s, within the block" in str(caught[0].message)


def test_the_last_hit_is_dropped_if_its_block_is_truncated():
    records, _ = long_record([0.4, 0.4, 0.1])
    with pytest.warns(ReceptanceWarning, match=r"hit 3 dropped: truncated: the record ends 0\.\d+ s before the block"):
        hits = find_hits(records)
    assert len(hits) == 2


def test_contacts_close_together_are_one_double_hit():
    records, _ = long_record([0.4, 0.03, 0.4, 0.4])
    with pytest.warns(ReceptanceWarning, match="hit 2 dropped: double hit: a contact with 100 % of the force 30 ms"):
        hits = find_hits(records)
    assert len(hits.hits) == 3


def test_a_hit_during_ringing_is_kept_with_a_remark():
    slow = hammer.Structure((0.0, 900.0), (0.0, 0.001), (2.0, 30.0), RATE)
    time = np.arange(round(3.2 * RATE)) / RATE
    force = sum(hammer.pulse(time, start, 4e-4, 100.0) for start in (0.1, 1.1, 1.4))
    response = slow.respond(force) + 0.05 * np.random.default_rng(1).standard_normal(time.size)
    with pytest.warns(ReceptanceWarning, match=r"hit 3: the response before it is \d+ % of the largest"):
        hits = find_hits(records_of(force, response), duration_s=0.25)
    assert len(hits) == 3


def test_warning_for_negative_pulses():
    made = strike(hits=2)
    with pytest.warns(ReceptanceWarning, match="the hammer's pulses are negative"):
        hits = find_hits(records_of(-made.force, made.response))
    assert all(hit.peak < 0.0 for hit in hits.kept)


def test_trigger_and_records_of_different_length():
    made = strike(hits=2)
    both = [records_of(made.force[0], made.response[0]), records_of(made.force[1, :4000], made.response[1, :4000])]
    assert find_hits(both).n_samples == 4000
    late = records_of(np.roll(made.force[1], 4500), made.response[1])
    with pytest.warns(
        ReceptanceWarning, match=r"hit 1 dropped: truncated: the contact does not end within the block of 0\.1"
    ):
        assert len(find_hits([late, both[1]])) == 1
    with pytest.warns(ReceptanceWarning, match="no hit: the largest force"):
        assert len(find_hits(both, trigger=1e4)) == 0
    with pytest.raises(ValueError, match=r"sample_rate_hz is 25600.0 in records\[0\] and 1000.0 in records\[1\]"):
        find_hits([both[0], HammerRecords(force=TIME, response=TIME, sample_rate_hz=1000.0, quantity="acceleration")])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"trigger": 0.0}, "trigger is 0, expected more than zero"),
        ({"duration_s": 5.0}, "duration_s is 5 s, 128000 samples, expected 16 samples to the 0.2 s"),
        ({"deviating_hits": "ignore"}, "deviating_hits is 'ignore', expected one of drop, keep"),
        ({"double_hit_loss_db": -1.0}, "double_hit_loss_db is -1.0, expected zero or more dB"),
        ({"double_hit_loss_db": np.nan}, "double_hit_loss_db is nan"),
        ({"pre_trigger_s": -1.0}, "pre_trigger_s is -1"),
        ({"pre_trigger_s": 0.1, "duration_s": 0.1}, "pre_trigger_s is 0.1 s, expected less than duration_s, 0.1 s"),
    ],
)
def test_invalid_settings(options, message):
    made = strike(hits=2)
    with pytest.raises(ValueError, match=message):
        find_hits(records_of(made.force, made.response), **options)


def test_invalid_records():
    with pytest.raises(ValueError, match="records is empty, expected at least one HammerRecords"):
        find_hits([])
    with pytest.raises(TypeError, match=r"records\[0\] is 5, expected a HammerRecords"):
        find_hits([5])


def test_dropping_by_hand():
    made = strike(hits=3)
    hits = find_hits(records_of(made.force, made.response))
    fewer = hits.without(2, reason="the thread touched the holder")
    assert [hit.number for hit in fewer.kept] == [1, 3]
    assert fewer.notes == ("hit 2 dropped: the thread touched the holder",)
    assert len(hits) == 3
    with pytest.raises(ValueError, match="there is no hit 4"):
        hits.without(4)
    with pytest.raises(ValueError, match="state why"):
        hits.without(1, reason="")


def test_a_slow_signal_on_a_coarse_digitiser_is_not_clipped():
    made = strike(hits=2, force_noise_db=-300.0, response_noise_db=-300.0)
    step = made.force.max() / 60.0
    fine = np.repeat(made.force, 20, axis=1)
    smooth = np.apply_along_axis(lambda row: np.convolve(row, np.ones(40) / 40.0, "same"), 1, fine)
    response = np.random.default_rng(2).standard_normal(fine.shape)
    records = HammerRecords(
        force=step * np.round(smooth / step), response=response, sample_rate_hz=20 * RATE, quantity="acceleration"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(find_hits(records)) == 2


@pytest.mark.parametrize(("samples", "reason"), [(1, "or an overload"), (2, "or an overload"), (3, "flat top of 3")])
def test_overloads_of_few_samples(samples, reason):
    """The limit of the channel is ten times the other pulses: one or two samples show in the gain of the hit."""
    made = strike(hits=4)
    force = made.force.copy()
    first = int(np.argmax(force[0])) - samples // 2
    force[0, first : first + samples] = 10.0 * made.force.max()
    with pytest.warns(ReceptanceWarning, match="hit 1 dropped"):
        hits = find_hits(records_of(force, made.response))
    assert reason in hits.hits[0].reason
    assert len(hits) == 3
    if samples == 2:
        assert "the two largest samples of the force are equal" in hits.hits[0].note
        assert "full_scale_force decides" in hits.hits[0].note


@pytest.mark.parametrize(
    ("factor", "reason"),
    [(-1.0, "opposite sign to the other hits"), (0.5, "0.5 times that of"), (0.0, "does not belong to its force")],
)
def test_a_bad_record_among_six_is_named(factor, reason):
    """Hit from the other side, half the gain, cable off."""
    made = strike(hits=6)
    response = made.response.copy()
    silence = made.response[3] - STRUCTURE.respond(made.true_force[3])
    response[3] = factor * response[3] if factor else silence
    with pytest.warns(ReceptanceWarning, match="hit 4 dropped"):
        hits = find_hits(records_of(made.force, response))
    assert reason in hits.hits[3].reason
    assert len(hits) == 5
    with pytest.warns(ReceptanceWarning, match="hit 4: "):
        assert len(find_hits(records_of(made.force, response), deviating_hits="keep")) == 6


def test_two_hits_that_contradict_each_other_are_kept_with_a_note():
    made = strike(hits=2)
    with pytest.warns(ReceptanceWarning, match="the FRFs of the two hits differ by a factor of 2"):
        hits = find_hits(records_of(made.force, made.response * np.array([[1.0], [2.0]])))
    assert len(hits) == 2


def test_a_small_rebound_is_kept_and_its_loss_is_stated():
    made = strike(hits=3, force_noise_db=-300.0)
    force = made.force.copy()
    force[1] += hammer.pulse(TIME, 0.03, 4e-4, 0.06 * force[1].max())
    response = STRUCTURE.respond(force)
    with pytest.warns(ReceptanceWarning, match=r"hit 2: a second pulse .* takes up to 1\.\d dB"):
        hits = find_hits(records_of(force, response))
    assert len(hits) == 3
    # (1 - a) / (1 + a) of two equal pulses, 1.04 dB
    assert spectrum_loss_db(force[1, hits.hits[1].onset : hits.hits[1].release]) == pytest.approx(1.04, abs=0.1)


@pytest.mark.parametrize("order", [8])
@pytest.mark.parametrize("cutoff", [0.1, 0.2, 0.39])
@pytest.mark.parametrize("contact_ms", [0.05, 0.2, 1.0])
def test_ringing_of_a_filter_of_any_cutoff_is_kept(order, cutoff, contact_ms):
    rate, over, n = 5120.0, 32, 2048
    time = np.arange(n * over) / (rate * over)
    inside = (time > 0.02) & (time < 0.02 + 1e-3 * contact_ms)
    pulse = np.where(inside, np.sin(np.pi * (time - 0.02) / (1e-3 * contact_ms)), 0.0)
    force = sosfilt(ellip(order, 0.05, 80, cutoff * rate, fs=rate * over, output="sos"), pulse)[::over]
    ring = np.exp(-3.0 * np.arange(n) / rate) * np.sin(np.arange(n) / 2.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        hits = find_hits(HammerRecords(force=force, response=ring, sample_rate_hz=rate, quantity="acceleration"))
    assert [hit.reason for hit in hits.hits] == [""]
