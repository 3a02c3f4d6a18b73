"""FRF: fields, validation, forms and selection."""

import pickle
import warnings

import numpy as np
import pytest

from bar_frf import BAR, END, LINES, SLOPE, TIP, VALUES, make
from receptance import (
    FRF,
    STEEL,
    Assembly,
    Coordinate,
    Observation,
    Part,
    PointMass,
    ReceptanceWarning,
    Segment,
)
from receptance.frf.variance import pool_variance, variance_from_coherence
from receptance.hammer import HammerRecords
from receptance.modal import ring_down
from receptance.model.coordinates import UnknownPosition
from receptance.stability import Milling, TipModes, stability_lobes


def test_arrays_have_the_documented_shapes():
    frf = make()
    assert frf.shape == (100, 3, 2)
    for name, dtype in {
        "frequency_hz": np.float64,
        "values": np.complex128,
        "coherence": np.float64,
        "log_variance": np.float64,
        "degrees_of_freedom": np.float64,
        "correlated_lines": np.float64,
        "usable": np.bool_,
    }.items():
        array = getattr(frf, name)
        assert array.dtype == dtype, name
        assert array.flags.c_contiguous, name
        assert not array.flags.writeable, name
        assert array.shape == ((100,) if name in ("frequency_hz", "correlated_lines", "usable") else (100, 3, 2)), name
    np.testing.assert_array_equal(frf.coherence[:, 2, 1], np.linspace(0.5, 1.0, 100))
    np.testing.assert_allclose(frf.standard_deviation**2, frf.log_variance, rtol=1e-15)
    assert (frf.form, frf.averages, frf.decay_rate, frf.label) == ("receptance", 10, 0.0, "blank")
    assert frf.responses == (TIP, END, SLOPE)
    assert frf.notes == ("first note",)


def test_one_entry_may_be_given_flat():
    frf = FRF(frequency_hz=[1, 2], values=[1, 2j])
    assert frf.shape == (2, 1, 1)
    assert frf.values.dtype == np.complex128
    assert frf.coherence is None
    assert frf.standard_deviation is None
    np.testing.assert_array_equal(frf.correlated_lines, 1.0)


def test_arrays_are_copies():
    lines, values = LINES.copy(), VALUES.copy()
    frf = make(frequency_hz=lines, values=values)
    lines[0], values[0] = -1.0, 0.0
    assert frf.frequency_hz[0] == 50.0
    assert frf.values[0, 0, 0] == VALUES[0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        frf.values[0] = 1.0
    with pytest.raises(AttributeError):
        frf.form = "mobility"


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"frequency_hz": []}, ValueError, "FRF 'blank': frequency_hz is empty"),
        ({"frequency_hz": LINES[::-1]}, ValueError, r"not ascending: \[1\] is 4950 Hz after 5000 Hz"),
        ({"frequency_hz": np.r_[LINES[:-1], np.nan]}, ValueError, r"frequency_hz\[99\] is nan"),
        ({"frequency_hz": LINES + 1j}, TypeError, "complex lines follow from decay_rate"),
        ({"frequency_hz": [[1.0], [2.0, 3.0]]}, ValueError, "rows of different lengths"),
        ({"values": VALUES[:-1]}, ValueError, r"values has shape \(99, 3, 2\) for 100 lines"),
        ({"values": VALUES.astype(str)}, TypeError, "values has dtype <U"),
        (
            {"values": np.where(LINES == 550.0, np.nan, 1.0)[:, None, None] * VALUES},
            ValueError,
            "values at 550 Hz is .nan",
        ),
        ({"form": "inertance"}, ValueError, "form is 'inertance', expected one of receptance, mobility, accelerance"),
        ({"responses": [TIP, END]}, ValueError, "there are 2 responses for values with 3"),
        (
            {"responses": ["tip", "y", "y"]},
            TypeError,
            r"responses\[0\] is 'tip', expected a Coordinate, or 'y' or 'theta'",
        ),
        ({"decay_rate": -1.0}, ValueError, "decay_rate is -1, expected zero or more 1/s"),
        ({"coherence": np.full(100, -0.2)}, ValueError, "coherence at 50 Hz is -0.2 .*expected 0 to 1"),
        (
            {"coherence": np.where(LINES == 550.0, 1.25, 0.5)},
            ValueError,
            "coherence at 550 Hz is 1.25, expected 0 to 1",
        ),
        ({"coherence": np.ones((100, 3))}, ValueError, r"coherence has shape \(100, 3\), expected one number"),
        ({"averages": 0}, ValueError, "averages is 0, expected a whole number from 1 to 1000000000"),
        ({"log_variance": -1.0}, ValueError, r"log_variance\[0, 0, 0\] is -1, expected at least 0"),
        ({"degrees_of_freedom": 0}, ValueError, r"degrees_of_freedom\[0, 0, 0\] is 0, expected more than 0"),
        (
            {"correlated_lines": 0.5},
            ValueError,
            r"correlated_lines\[0\] is 0.5, expected a finite number of at least 1",
        ),
        ({"usable": np.ones(100)}, ValueError, "usable has dtype float64"),
        ({"labels": ("a", "b")}, TypeError, "labels is"),
        ({"labels": (("a",), ("b", "c"))}, ValueError, "labels names 1 responses and 2 excitations, expected 3 and 2"),
        ({"notes": "one text"}, TypeError, "notes is 'one text'"),
    ],
)
def test_invalid_fields_are_refused(changes, error, words):
    with pytest.raises(error, match=words):
        make(**changes)


def test_coherence_above_one_by_rounding_is_clipped_and_noted():
    frf = make(coherence=np.r_[1.00003, np.full(99, 0.9)])
    assert frf.coherence.max() == 1.0
    assert any("rounding on 6 lines" in note for note in frf.notes)


def test_coherence_above_one_is_refused_with_the_cause():
    coherence = np.full(100, 0.9)
    coherence[:2] = 1.246, 1.1
    with pytest.raises(ValueError, match="outside 0 to 1 on 1 more line") as caught:
        make(coherence=coherence)
    for words in ("50 Hz is 1.246", "share of the response's power explained by the force", "without its coherence"):
        assert words in str(caught.value)


@pytest.mark.parametrize("field", ["values", "coherence", "log_variance"])
def test_the_line_at_zero_hz_is_dropped_only_if_it_is_not_finite(field):
    lines = np.r_[0.0, LINES]
    fields = {
        "values": np.concatenate([np.ones((1, 3, 2)), VALUES]),
        "coherence": np.r_[0.3, np.full(100, 0.9)],
        "log_variance": np.full(101, 0.1),
        "usable": None,
    }
    assert make(frequency_hz=lines, **fields).frequency_hz[0] == 0.0
    fields[field] = fields[field].copy()
    fields[field][0] = np.nan
    frf = make(frequency_hz=lines, **fields)
    np.testing.assert_array_equal(frf.frequency_hz, LINES)
    assert frf.coherence.shape == (*frf.correlated_lines.shape, 3, 2) == (100, 3, 2)
    assert frf.notes[-1] == f"the line at 0 Hz is dropped: {field} not finite there"


def test_single_non_finite_line_at_zero_hz_is_an_error():
    with pytest.raises(ValueError, match="only line is at 0 Hz"):
        FRF(frequency_hz=[0.0], values=[np.inf])


@pytest.mark.parametrize(
    ("form", "units"),
    [
        ("receptance", (("m/N", "m/(N m)"), ("m/N", "m/(N m)"), ("rad/N", "rad/(N m)"))),
        ("mobility", (("m/s/N", "m/s/(N m)"), ("m/s/N", "m/s/(N m)"), ("rad/s/N", "rad/s/(N m)"))),
        ("accelerance", (("m/s^2/N", "m/s^2/(N m)"), ("m/s^2/N", "m/s^2/(N m)"), ("rad/s^2/N", "rad/s^2/(N m)"))),
    ],
)
def test_units(form, units):
    frf = make().to(form)
    assert frf.units == units
    assert frf.select(responses=2, excitations=1).unit == units[2][1]
    with pytest.raises(ValueError, match="several units"):
        frf.unit  # noqa: B018


def test_conversion_of_a_rigid_mass_under_an_exponential_window():
    # A free mass has receptance -1 / (m w^2) and accelerance 1 / m at any complex w.
    sigma, m = 30.0, 2.5
    w = 2 * np.pi * LINES - 1j * sigma
    frf = FRF(frequency_hz=LINES, values=-1.0 / (m * w**2), decay_rate=sigma)
    np.testing.assert_allclose(frf.complex_frequency_hz, w / (2 * np.pi), rtol=1e-15)
    np.testing.assert_allclose(frf.to("accelerance").values[:, 0, 0], 1.0 / m, rtol=1e-13)
    assert abs(frf.with_(decay_rate=0.0).to("accelerance").values[0, 0, 0] * m - 1.0) > 0.1


def test_conversion_at_zero_hz():
    frf = FRF(frequency_hz=[0.0, 10.0], values=[1.0, 2.0], log_variance=[0.1, 0.2])
    up = frf.to("accelerance")
    assert up.values[0, 0, 0] == 0.0
    down = up.to("receptance")
    np.testing.assert_array_equal(down.frequency_hz, [10.0])
    np.testing.assert_allclose(down.values.ravel(), 2.0, rtol=1e-15)
    assert down.log_variance.ravel() == 0.2
    assert "0 Hz is dropped: the displacement does not follow from the acceleration" in down.notes[0]
    # Under a window the line is not at zero, so none is dropped.
    windowed = frf.with_(decay_rate=3.0)
    np.testing.assert_allclose(windowed.to("accelerance").to("receptance").values, frf.values, rtol=1e-15)
    with pytest.raises(ValueError, match="its only line"):
        FRF(frequency_hz=[0.0], values=[1.0], form="accelerance").to("mobility")


def test_select_by_number_coordinate_and_label():
    frf = make()
    expected = VALUES[:, [2, 0]][:, :, [1]]
    for responses, excitations in (
        ([2, 0], 1),
        ([SLOPE, TIP], SLOPE),
        (["1:+RZ", "1:+Y"], "1:+RZ"),
        ((-1, TIP), [np.int64(1)]),
    ):
        found = frf.select(responses=responses, excitations=excitations)
        np.testing.assert_array_equal(found.values, expected)
        np.testing.assert_array_equal(found.coherence, frf.coherence[:, [2, 0]][:, :, [1]])
        assert found.responses == (SLOPE, TIP)
        assert found.excitations == (SLOPE,)
        assert found.labels == (("1:+RZ", "1:+Y"), ("1:+RZ",))
        assert found.values.flags.c_contiguous


def test_select_lines():
    found = make().select(low_hz=100.0, high_hz=200.0)
    np.testing.assert_array_equal(found.frequency_hz, [100.0, 150.0, 200.0])
    np.testing.assert_array_equal(found.values, VALUES[1:4])
    np.testing.assert_array_equal(found.usable, [False, True, True])


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"responses": 3}, ValueError, "none of the responses is 3; they are 0: y at 'bar' 0 m .1:[+]Y"),
        ({"responses": Coordinate("tool")}, ValueError, "none of the responses is Coordinate"),
        ({"excitations": "3:+X"}, ValueError, "none of the excitations is '3:[+]X'"),
        ({"responses": []}, ValueError, "responses is empty"),
        ({"responses": 1.5}, TypeError, "expected a number, Coordinate or label"),
        ({"responses": [None]}, TypeError, "responses holds None"),
        ({"low_hz": 5001.0}, ValueError, "no line from 5001 to inf Hz"),
        ({"low_hz": 60.0, "high_hz": 70.0}, ValueError, "no line from 60 to 70 Hz"),
        ({"low_hz": "60"}, TypeError, "low_hz is '60'"),
    ],
)
def test_select_an_unknown_entry(options, error, words):
    with pytest.raises(error, match=words):
        make().select(**options)


def test_masked():
    found = make().masked()
    assert found.frequency_hz[0] == 150.0
    assert found.usable.all()
    assert found.masked() is found
    everything = make(usable=None)
    assert everything.masked() is everything
    with pytest.raises(ValueError, match="no line is usable"):
        make(usable=np.zeros(100, dtype=bool)).masked()


def test_unknown_positions():
    frf = FRF(frequency_hz=[1.0], values=np.ones((1, 2, 1)), responses=["y", "theta"])
    assert frf.responses == (UnknownPosition("y"), UnknownPosition("theta"))
    assert frf.excitations == (UnknownPosition(),)
    assert frf.units == (("m/N",), ("rad/N",))
    assert UnknownPosition() != Coordinate()
    assert Coordinate() != UnknownPosition()
    assert repr(UnknownPosition()) == "UnknownPosition('y')"
    assert pickle.loads(pickle.dumps(UnknownPosition("theta"))) == UnknownPosition("theta")
    placed = frf.with_(responses=[TIP, SLOPE])
    assert placed.responses == (TIP, SLOPE)
    assert placed.excitations == (UnknownPosition(),)
    with pytest.raises(ValueError, match="direction is 'x'"):
        UnknownPosition("x")


def test_with_validates_its_fields():
    frf = make()
    assert frf.with_(label="nose").label == "nose"
    assert frf.with_(coherence=None).coherence is None
    np.testing.assert_array_equal(frf.with_(label="nose").values, frf.values)
    with pytest.raises(TypeError, match="no field 'name'; the fields are label, source, notes, frequency_hz, values"):
        frf.with_(name="nose")
    with pytest.raises(ValueError, match="coherence at 50 Hz is 2"):
        frf.with_(coherence=2.0)


def test_conjugated_and_flipped_on_request():
    frf = make(responses=None)
    np.testing.assert_array_equal(frf.conjugated().values, VALUES.conj())
    np.testing.assert_array_equal(frf.flipped().values, -VALUES)
    assert frf.conjugated().flipped().notes[-2:] == ("conjugated on request", "sign changed on request")


def test_intervals():
    frf = make(log_variance=1e-4, degrees_of_freedom=4)
    # Student's t with 4 degrees of freedom: 2.7764 at 95 %, 4.6041 at 99 %.
    np.testing.assert_allclose(frf.log_interval(), 0.027764, rtol=1e-4)
    np.testing.assert_allclose(frf.log_interval(0.99), 0.046041, rtol=1e-4)
    np.testing.assert_allclose(frf.with_(degrees_of_freedom=None).log_interval(), 0.0195996, rtol=1e-5)
    np.testing.assert_allclose(frf.with_(degrees_of_freedom=np.inf).log_interval(), 0.0195996, rtol=1e-5)
    with pytest.raises(ValueError, match=r"no variance; .*with_coherence_variance"):
        make(log_variance=None).log_interval()
    for level in (0.0, 1.0, 95):
        with pytest.raises(ValueError, match="level is"):
            frf.log_interval(level)


def test_a_mass_at_the_tip_in_every_form():
    # The same change of the model in any form: conversions commute with simulation.
    heavy = Assembly(list(BAR.elements.values()), [PointMass(mass=0.01, part="bar", position=0.0, name="sensor")])
    ratio = {}
    for form in ("receptance", "mobility", "accelerance"):
        light, loaded = (
            FRF(frequency_hz=LINES, values=a.receptance(LINES)).to(form).values.ravel() for a in (BAR, heavy)
        )
        ratio[form] = loaded / light
    np.testing.assert_allclose(ratio["mobility"], ratio["receptance"], rtol=1e-13)
    np.testing.assert_allclose(ratio["accelerance"], ratio["receptance"], rtol=1e-13)


def test_a_drive_point_as_declared_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert make().notes == ("first note",)
    with pytest.warns(ReceptanceWarning, match="drive point"):
        make(values=-VALUES)


MASKED = np.ma.masked_array(np.linspace(1.0, 2.0, 100), mask=np.arange(100) == 7)


def test_masked_values_are_refused_by_all_functions():
    bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    lines = np.linspace(1.0, 2.0, 100)
    data = {"assembly": bar, "frequency_hz": lines, "receptance": np.ones(100), "standard_deviation": 0.01}
    for name in ("frequency_hz", "receptance", "standard_deviation", "force"):
        with pytest.raises(ValueError, match=f"{name} has 1 masked value"):
            Observation(**(data | {name: MASKED}))
    with pytest.raises(ValueError, match="frequency_hz has 1 masked value"):
        Observation.from_modes(assembly=bar, frequency_hz=MASKED[[0, 7]])
    for call in (
        lambda: bar.receptance(MASKED),
        lambda: HammerRecords(
            force=[MASKED, MASKED], response=np.ones((2, 100)), sample_rate_hz=1e3, quantity="velocity"
        ),
        lambda: variance_from_coherence(MASKED - 1.0, 5),
        lambda: pool_variance(np.ones(100), MASKED, 4.0),
        lambda: stability_lobes(Milling(teeth=2, k_t=6e8, k_n=2e8), lines, MASKED, speeds_rpm=[1e4]),
        lambda: ring_down(MASKED, sample_rate_hz=1e3, low_hz=50.0, high_hz=100.0),
        lambda: TipModes(frequency_hz=MASKED, damping_ratio=0.1 * lines, shapes=np.ones((100, 2))),
    ):
        with pytest.raises(ValueError, match="masked value"):
            call()
