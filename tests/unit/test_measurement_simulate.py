"""Simulated hammer tests: FRF, noise, double hits and overloads."""

from dataclasses import replace

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, GroundSpring, Part, Segment
from receptance.errors import ReceptanceWarning
from receptance.hammer import estimate_frf, find_hits, simulate_hits

TIP, END = Coordinate("bar"), Coordinate("bar", "end")
SILENT = {"force_noise_db": -300.0, "response_noise_db": -300.0}


def bar(loss_factor=0.01, length=0.2):
    steel = replace(STEEL, loss_factor=loss_factor)
    return Assembly([Part([Segment(length=length, outer_diameter=0.02, material=steel)], name="bar")])


def held(loss_factor=0.01):
    part = bar(loss_factor).elements["bar"]
    return Assembly([part], [GroundSpring(part="bar", position="end", k_y=1e7, k_theta=1e5, c_y=300.0, c_theta=1.0)])


@pytest.mark.parametrize(
    ("assembly", "quantity", "decay_rate"),
    [
        (bar(), "acceleration", 60.0),
        (bar(0.05), "acceleration", 0.0),
        (held(0.0), "velocity", 60.0),
        (held(0.0), "displacement", 60.0),
    ],
)
def test_the_frf_of_simulated_hits_is_the_receptance(assembly, quantity, decay_rate):
    records = simulate_hits(
        assembly, hits=3, quantity=quantity, response=TIP, excitation=TIP, duration_s=0.5, contact_s=1.5e-4, **SILENT
    )
    frf = estimate_frf(records, decay_rate=decay_rate, low_hz=200.0, high_hz=7000.0).to("receptance")
    expected = assembly.receptance(frf.complex_frequency_hz)
    error = np.abs(frf.values[:, 0, 0] / expected - 1.0)
    assert np.median(error) < 1e-5
    assert error.max() < 2e-3
    assert frf.usable.all()


def test_several_responses_and_one_long_record():
    records = simulate_hits(
        bar(), hits=4, response=[TIP, END], excitation=END, one_record=True, **SILENT, seed=3, duration_s=0.2
    )
    assert records.n_records == 1
    assert records.duration_s == pytest.approx(0.8)
    hits = find_hits(records)
    assert len(hits) == 4
    frf = estimate_frf(hits, decay_rate=30.0, low_hz=300.0, high_hz=6000.0).to("receptance")
    expected = bar().receptance(frf.complex_frequency_hz, response=[TIP, END], excitation=[END])
    error = np.abs(frf.values / expected - 1.0)[frf.usable]
    assert np.median(error) < 1e-4
    assert frf.responses == (TIP, END)


def test_no_wrap_around_of_an_undamped_bar():
    """A response that wraps around in the transform would be as large before the hit as after it."""
    records = simulate_hits(bar(0.0), hits=2, **SILENT, duration_s=0.1)
    response = records.response[:, :, 0]
    assert np.abs(response[:, :400]).max() < 2e-4 * np.abs(response).max()
    assert np.abs(response[:, -400:]).max() > 0.05 * np.abs(response).max()


def test_noise_has_the_stated_level():
    quiet = simulate_hits(bar(), hits=5, **SILENT, seed=1)
    noisy = simulate_hits(bar(), hits=5, force_noise_db=-50.0, response_noise_db=-60.0, seed=1)
    for one, other, level in ((quiet.force, noisy.force, -50.0), (quiet.response, noisy.response, -60.0)):
        found = 20.0 * np.log10(np.std(other - one) / np.abs(one).max())
        assert found == pytest.approx(level, abs=0.2)


def test_double_hits_and_overloads_are_detected():
    records = simulate_hits(bar(), hits=8, double_hits=[2, 5], overloads=[7], seed=6)
    with pytest.warns(ReceptanceWarning, match="hit 2 dropped: double hit.*hit 7 dropped: overload"):
        hits = find_hits(records)
    assert [hit.number for hit in hits.dropped] == [2, 5, 7]
    assert "double hit" in hits.hits[4].reason
    long = simulate_hits(bar(), hits=8, double_hits=[2, 5], overloads=[7], seed=6, one_record=True)
    with pytest.warns(ReceptanceWarning, match="hit 2 dropped: double hit.*hit 7 dropped: overload"):
        assert [hit.number for hit in find_hits(long).dropped] == [2, 5, 7]


def test_label_and_seed():
    records = [simulate_hits(bar(), hits=2, seed=seed, duration_s=0.1) for seed in (4, 4, 5)]
    np.testing.assert_array_equal(records[0].force, records[1].force)
    assert not np.array_equal(records[0].force, records[2].force)
    assert records[0].source == "simulated by receptance, seed 4"
    assert records[0].notes == ("simulated, not measured",)
    assert records[0].full_scale_force > records[0].force.max()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hits": 0}, "hits is 0, expected a whole number of at least 1"),
        ({"quantity": "mobility"}, "quantity is 'mobility'"),
        ({"double_hits": [11]}, "there is no hit 11, expected 1 to 10"),
        ({"contact_s": 0.01}, "expected a contact of two samples or more, and a hundred contacts after"),
        ({"contact_s": 1e-5}, "expected a contact of two samples or more"),
        ({"peak": -1.0}, "peak is -1, expected more than zero N"),
        ({"response": Coordinate("handle")}, "there is no part 'handle'"),
    ],
)
def test_invalid_settings(options, message):
    with pytest.raises(ValueError, match=message):
        simulate_hits(bar(), **options)


def test_invalid_assembly():
    with pytest.raises(TypeError, match="assembly is 5, expected an Assembly"):
        simulate_hits(5)
