"""Errors for invalid input name the quantity and the position."""

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, Part, PointJoint, ReceptanceWarning, Segment
from receptance.fit import Observation, Unknown, find_bands, identify

BAR = [Segment(length=0.1, outer_diameter=0.02, material=STEEL)]
PAIR = Assembly([Part(BAR, name="tool"), PointJoint(k_y=1e8, k_theta=1e5, name="joint"), Part(BAR, name="holder")])
LINES = np.linspace(100.0, 5000.0, 50)
VALUES = PAIR.receptance(LINES)
K_Y = Unknown(address="joint.k_y", lower=1e6, upper=1e10)
K_THETA = Unknown(address="joint.k_theta", lower=1e3, upper=1e7)


def measure(**changes):
    return Observation(**({"assembly": PAIR, "frequency_hz": LINES, "receptance": VALUES} | changes))


def with_value(index, value):
    changed = VALUES.copy()
    changed[index] = value
    return changed


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"assembly": BAR}, TypeError, "assembly is .*expected an Assembly"),
        ({"frequency_hz": [], "receptance": []}, ValueError, "frequency_hz is empty"),
        ({"frequency_hz": LINES[::-1]}, ValueError, "not ascending: line 1 is 4900 Hz after 5000"),
        ({"frequency_hz": np.r_[LINES[:-1], np.nan]}, ValueError, r"frequency_hz\[49\] is nan"),
        (
            {"frequency_hz": LINES + 1j},
            ValueError,
            r"frequency_hz\[0\] is 100[+]1j Hz, expected an imaginary part of zero",
        ),
        ({"frequency_hz": LINES.reshape(5, 10)}, ValueError, r"frequency_hz has shape \(5, 10\)"),
        ({"receptance": VALUES[:-1]}, ValueError, r"receptance has shape \(49,\) but frequency_hz \(50,\)"),
        ({"receptance": with_value(7, np.nan)}, ValueError, "receptance at 800 Hz is .*nan.*finite"),
        ({"receptance": with_value(8, 0.0)}, ValueError, "receptance at 900 Hz is 0.*leave the line out"),
        ({"standard_deviation": 0.0}, ValueError, r"standard_deviation\[0\] is 0"),
        ({"standard_deviation": np.ones(3)}, ValueError, r"standard_deviation has shape \(3,\)"),
        ({"response": Coordinate("spindle")}, ValueError, "there is no part 'spindle'"),
        ({"response": "tool"}, TypeError, "response is 'tool', expected one Coordinate"),
    ],
)
def test_measured_frf(changes, error, words):
    with pytest.raises(error, match=words):
        measure(**changes)


def test_label_names_the_measurement():
    with pytest.raises(ValueError, match="Observation 'bench 3': frequency_hz is empty"):
        measure(frequency_hz=[], receptance=[], label="bench 3")


def test_line_at_zero_is_dropped_with_a_note():
    lines = np.r_[0.0, LINES]
    with pytest.warns(ReceptanceWarning, match="0 Hz is dropped"):
        frf = measure(frequency_hz=lines, receptance=np.r_[np.nan, VALUES], standard_deviation=np.full(51, 0.1))
    np.testing.assert_array_equal(frf.frequency_hz, LINES)
    np.testing.assert_array_equal(frf.receptance, VALUES)
    assert frf.standard_deviation.shape == LINES.shape
    result = identify(frf, K_Y, starts=1)
    assert any("0 Hz is dropped" in note for note in result.notes)


def test_measurements_copy_their_arrays():
    lines = LINES.copy()
    frf = measure(frequency_hz=lines)
    lines[0] = -1.0
    assert frf.frequency_hz[0] == 100.0
    with pytest.raises(ValueError, match="read-only"):
        frf.frequency_hz[0] = 1.0


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"frequency_hz": []}, ValueError, "frequency_hz is empty"),
        ({"frequency_hz": [500.0, 400.0]}, ValueError, "not ascending"),
        ({"frequency_hz": [0.0, 400.0]}, ValueError, r"frequency_hz\[0\] is 0 Hz"),
        ({"modes": [1]}, ValueError, "1 modes for 2 frequencies"),
        ({"modes": [0, 1]}, ValueError, "from 1 on"),
        ({"modes": [2, 2]}, ValueError, "expected ascending numbers"),
        ({"standard_deviation_hz": -5.0}, ValueError, r"standard_deviation_hz\[0\] is -5"),
        ({"assembly": None}, TypeError, "expected an Assembly"),
    ],
)
def test_measured_frequencies(changes, error, words):
    with pytest.raises(error, match=words):
        Observation.from_modes(**({"assembly": PAIR, "frequency_hz": [500.0, 900.0]} | changes))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"lower": 1e10, "upper": 1e6}, ValueError, "lower is 1e[+]10 and upper 1e[+]06, expected lower below upper"),
        ({"start": 1e11}, ValueError, "start is 1e[+]11, outside the bounds 1e[+]06 to 1e[+]10"),
        ({"lower": 0.0, "scale": "log"}, ValueError, "lower is 0, expected more than zero on a log scale"),
        ({"scale": "cubic"}, ValueError, "scale is 'cubic', expected one of log, linear"),
        ({"lower": np.nan}, ValueError, "lower is nan"),
        ({"start": "much"}, TypeError, "start is 'much'"),
        ({"address": 3}, TypeError, "address is 3"),
    ],
)
def test_unknown(changes, error, words):
    with pytest.raises(error, match=words):
        Unknown(**({"address": "joint.k_y", "lower": 1e6, "upper": 1e10} | changes))


def test_scale_and_start_follow_from_the_bounds():
    assert Unknown(address="a.k_y", lower=1e6, upper=1e10).scale == "log"
    assert Unknown(address="a.k_y", lower=1e6, upper=1e10).start == pytest.approx(1e8)
    assert Unknown(address="a.k_ytheta", lower=-1.0, upper=3.0).scale == "linear"
    assert Unknown(address="a.k_ytheta", lower=-1.0, upper=3.0).start == 1.0
    assert Unknown(address="a.loss_factor", lower=0.0, upper=0.1).scale == "linear"


@pytest.mark.parametrize(
    ("unknowns", "options", "error", "words"),
    [
        ([], {}, ValueError, "unknowns is empty"),
        (["joint.k_y"], {}, TypeError, r"unknowns\[0\] is 'joint.k_y', expected an Unknown"),
        ([K_Y, K_Y], {}, ValueError, "'joint.k_y' and 'joint.k_y' both determine 'joint.k_y'"),
        (
            [
                Unknown(address="tool.segment[*].density", lower=7e3, upper=8e3),
                Unknown(address="tool.segment[0].density", lower=7e3, upper=8e3),
            ],
            {},
            ValueError,
            r"both determine 'tool.segment\[0\].density'",
        ),
        (
            [Unknown(address="joint.k_z", lower=1.0, upper=2.0)],
            {},
            ValueError,
            "'joint.k_z': no .* joint.k_y, joint.k_t",
        ),
        ([K_Y], {"objective": "peaks"}, ValueError, "objective is 'peaks', expected one of log, percentage"),
        ([K_Y], {"starts": 0}, ValueError, "starts is 0"),
        ([K_Y], {"seed": -1}, ValueError, "seed is -1"),
        ([K_Y], {"tolerance": 0.0}, ValueError, "tolerance is 0"),
        ([K_Y], {"threads": -1}, ValueError, "threads is -1"),
        ([K_Y], {"bands": []}, ValueError, "bands is empty"),
        ([K_Y], {"bands": [(300.0, 200.0)]}, ValueError, r"bands\[0\] is 300 to 200 Hz"),
        ([K_Y], {"bands": [(1.0, np.nan)]}, ValueError, r"bands\[0\]: the upper end is nan"),
        ([K_Y], {"bands": [(6e3, 7e3)]}, ValueError, "no line of .* lies in the band 6000 to 7000 Hz"),
        ([K_Y], {"objective": "percentage", "band_width_percent": 0.0}, ValueError, "width_percent is 0"),
        ([K_Y, K_THETA], {"bands": [(190.0, 210.0)], "objective": "percentage"}, ValueError, "2 unknowns but only 1 "),
    ],
)
def test_identify(unknowns, options, error, words):
    with pytest.raises(error, match=words):
        identify(measure(), unknowns, **options)


@pytest.mark.parametrize(
    ("observations", "words"), [([], "observations is empty"), ([VALUES], r"observations\[0\] is")]
)
def test_observations(observations, words):
    with pytest.raises((TypeError, ValueError), match=words):
        identify(observations, K_Y)


def test_more_unknowns_than_frequencies():
    modes = Observation.from_modes(assembly=PAIR, frequency_hz=[1000.0])
    with pytest.raises(ValueError, match="2 unknowns but only 1 observed"):
        identify(modes, [K_Y, K_THETA])


def test_standard_deviations_for_some_only():
    modes = Observation.from_modes(assembly=PAIR, frequency_hz=[1000.0], label="taps")
    with pytest.raises(ValueError, match=r"has a standard deviation but Observation.'taps'.* has none"):
        identify([measure(standard_deviation=0.1), modes], K_Y)


def test_no_peak_to_put_a_band_around():
    lines = np.linspace(10.0, 20.0, 20)
    flat = measure(frequency_hz=lines, receptance=PAIR.receptance(lines))
    with pytest.raises(ValueError, match="has no peak with a prominence"):
        find_bands(flat)
