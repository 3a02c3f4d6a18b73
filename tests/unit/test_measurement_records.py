"""Hammer records: shapes, units, coordinates and validation."""

import pickle

import numpy as np
import pytest

from receptance import Coordinate
from receptance.hammer import HammerRecords
from receptance.io import TimeSeries
from receptance.model.coordinates import UnknownPosition
from receptance.units import CHANNEL_UNITS

N = 64
FORCE = np.linspace(0.0, 1.0, N)
RESPONSE = np.linspace(1.0, -1.0, N)


def make(**changes):
    given = {"force": FORCE, "response": RESPONSE, "sample_rate_hz": 1000.0, "quantity": "acceleration"}
    return HammerRecords(**given | changes)


@pytest.mark.parametrize(
    ("force", "response", "shape"),
    [
        ((N,), (N,), (1, N, 1)),
        ((N,), (N, 3), (1, N, 3)),
        ((2, N), (2, N), (2, N, 1)),
        ((2, N), (2, N, 3), (2, N, 3)),
    ],
)
def test_shapes(force, response, shape):
    records = make(force=np.ones(force), response=np.ones(response))
    assert records.response.shape == shape
    assert records.force.shape == shape[:2]
    assert (records.n_records, records.n_channels) == (shape[0], shape[2])
    assert records.duration_s == pytest.approx(0.064)
    assert records.time_s[-1] == pytest.approx(0.063)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"response": np.ones((N + 1,))}, r"response has shape \(65,\) for a force of \(64,\), expected \(64,\) or"),
        ({"force": np.ones((2, 2, N))}, r"force has shape \(2, 2, 64\), expected \(n,\) or \(n_records, n\)"),
        ({"force": FORCE[:8], "response": RESPONSE[:8]}, "at least 16 samples"),
        ({"force": np.where(np.arange(N) == 7, np.nan, FORCE)}, r"force\[7\] is nan, expected a finite number"),
        (
            {"quantity": "accelerance"},
            "quantity is 'accelerance', expected one of displacement, velocity, acceleration",
        ),
        ({"force": 1e40 * FORCE}, "the largest value of force is 1e.40, outside the range"),
        ({"sample_rate_hz": 0.0}, "sample_rate_hz is 0, expected more than zero Hz"),
        (
            {"response_unit": "N"},
            r"response_unit is 'N', which is .*, expected a unit of acceleration such as \"m/s\^2\"",
        ),
        ({"response_unit": "furlong/fortnite"}, "is not understood as a unit"),
        ({"force_unit": ""}, "force_unit is '', expected a unit of force"),
        ({"force_unit": "0 N"}, "a factor of 0"),
        ({"responses": [Coordinate(), Coordinate()]}, "2 responses for values with 1"),
        ({"full_scale_response": [1.0, 2.0]}, r"full_scale_response has shape \(2,\)"),
    ],
)
def test_invalid_values(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes, label="tip")


@pytest.mark.parametrize("changes", [{"force": FORCE.astype(complex)}, {"response_unit": 3}, {"excitation": 5}])
def test_invalid_types(changes):
    with pytest.raises(TypeError):
        make(**changes)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("m/s^2", 1.0), ("g", 9.80665), ("mm/s**2", 1e-3), ("V/(10 mV/(m/s^2))", 100.0), ("V/(100 mV/g_0)", 98.0665)],
)
def test_units_of_acceleration(unit, factor):
    np.testing.assert_allclose(make(response_unit=unit).response[0, :, 0], RESPONSE * factor, rtol=1e-12)


def test_full_scales_follow_the_unit():
    records = make(
        response=np.stack([RESPONSE, RESPONSE], axis=1),
        force_unit="V/(2 mV/N)",
        full_scale_force=10.0,
        response_unit="g",
        full_scale_response=[50.0, 5.0],
    )
    assert records.full_scale_force == pytest.approx(5000.0)
    np.testing.assert_allclose(records.full_scale_response, [490.3325, 49.03325])


def test_coordinates():
    assert make().responses == (UnknownPosition("y"),)
    nose = Coordinate("holder", 0.0)
    records = make(response=np.ones((N, 2)), responses=[nose, "theta"], excitation=nose)
    assert records.responses == (nose, UnknownPosition("theta"))
    assert records.channel(1).responses == (UnknownPosition("theta"),)
    with pytest.raises(ValueError, match="there is no channel 2, expected 0 to 1"):
        records.channel(2)


def test_a_rotation_has_units_of_an_angle():
    records = make(responses="theta", response_unit="deg/s**2")
    np.testing.assert_allclose(records.response[0, :, 0], np.deg2rad(RESPONSE))


def test_records_are_copies_and_pickle():
    force = FORCE.copy()
    records = make(force=force, label="tip")
    force[:] = 0.0
    assert records.force[0, -1] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        records.force[0, 0] = 1.0
    again = pickle.loads(pickle.dumps(records))
    np.testing.assert_array_equal(again.response, records.response)
    assert repr(again) == "HammerRecords('tip', 1 record of 0.064 s at 1000 Hz, acceleration, 1 channel)"


def series(quantities=("force", "acceleration", "acceleration")):
    """Return a time series with channels of these quantities."""
    return TimeSeries(
        values=np.stack([FORCE, RESPONSE, 2.0 * RESPONSE], axis=1),
        channels=("hammer", "tip", "nose"),
        sample_rate_hz=1000.0,
        units=[CHANNEL_UNITS.get(quantity, "V") for quantity in quantities],
        label="hit 1",
        source="hit1.uff",
        notes=("a note",),
    )


def test_from_series():
    records = HammerRecords.from_series(series(), force="hammer", responses=["nose", 1], full_scale_force=2.0)
    np.testing.assert_array_equal(records.force[0], FORCE)
    np.testing.assert_array_equal(records.response[0, :, 0], 2.0 * RESPONSE)
    assert (records.quantity, records.label, records.source, records.notes, records.full_scale_force) == (
        "acceleration",
        "hit 1",
        "hit1.uff",
        ("a note",),
        2.0,
    )


def test_from_series_with_rotations():
    records = HammerRecords.from_series(series(("force", "angular velocity", "")), force=0, responses=1)
    assert records.quantity == "velocity"
    assert records.responses == (UnknownPosition("theta"),)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"force": "tip", "responses": "nose"}, "channel 'tip' holds acceleration, expected the force of the hammer"),
        ({"force": "hammer", "responses": "x"}, "there is no channel 'x'; the channels are 'hammer', 'tip', 'nose'"),
        ({"force": "hammer", "responses": ["tip", "nose"]}, "the responses are 'tip': acceleration, 'nose': unknown"),
        ({"force": 9, "responses": "tip"}, "there is no channel 9"),
        ({"force": "hammer", "responses": "tip", "at": "theta"}, "channel 'tip' is acceleration, at"),
    ],
)
def test_from_series_refuses(options, message):
    with pytest.raises(ValueError, match=message):
        HammerRecords.from_series(series(("force", "acceleration", "")), **options)
