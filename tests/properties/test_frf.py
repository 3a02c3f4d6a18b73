"""Properties of any FRF: conversions and their inverses, selections, resampling on the lines, pickles."""

import pickle
import warnings

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from properties.strategies import parts
from receptance import FRF, Assembly, Coordinate
from receptance.frf.plausibility import check_drive_point
from receptance.units import FORMS

forms = st.sampled_from(FORMS)


@st.composite
def frfs(draw, *, zero_line=True):
    """Draw an FRF with everything it can have; the places are not known, so no drive point is judged."""
    n, n_out, n_in = draw(st.integers(1, 12)), draw(st.integers(1, 3)), draw(st.integers(1, 2))
    steps = draw(st.lists(st.floats(0.01, 50.0), min_size=n, max_size=n))
    first = 0.0 if zero_line and draw(st.booleans()) else draw(st.floats(0.1, 2e4))
    lines = first + np.cumsum(steps) - steps[0]
    assume(np.all(np.diff(lines) > 0.0))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    shape = (n, n_out, n_in)
    side = st.sampled_from(["y", "theta"])

    def maybe(value):
        return value if draw(st.booleans()) else None

    return FRF(
        frequency_hz=lines,
        values=10.0 ** rng.uniform(-12, 3, shape) * np.exp(2j * np.pi * rng.random(shape)),
        form=draw(forms),
        responses=draw(st.lists(side, min_size=n_out, max_size=n_out)),
        excitations=draw(st.lists(side, min_size=n_in, max_size=n_in)),
        decay_rate=draw(st.sampled_from([0.0, 1.0, 200.0])),
        coherence=maybe(rng.random(shape)),
        averages=maybe(draw(st.integers(1, 100))),
        log_variance=maybe(rng.exponential(1e-3, shape)),
        degrees_of_freedom=maybe(rng.uniform(1.0, 60.0, shape)),
        correlated_lines=rng.uniform(1.0, 9.0, n),
        usable=maybe(rng.random(n) < 0.7),
        labels=maybe((tuple(f"r{i}" for i in range(n_out)), tuple(f"e{i}" for i in range(n_in)))),
        label=draw(st.text(max_size=5)),
        notes=draw(st.lists(st.text(max_size=5), max_size=2)),
    )


def assert_same(first, second, *, but=()):
    for name, value in vars(first).items():
        if name in but:
            continue
        other = getattr(second, name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(other, value, err_msg=name)
            assert other.dtype == value.dtype
            assert not other.flags.writeable
            assert other.flags.c_contiguous
        else:
            assert other == value, name


@given(frfs(), forms)
def test_conversion_and_inverse(frf, form):
    alone_at_zero = frf.frequency_hz.size == 1 and frf.complex_frequency_hz[0] == 0.0
    assume(not alone_at_zero)
    back = frf.to(form).to(frf.form)
    at_zero = frf.complex_frequency_hz[0] == 0.0
    kept = frf.select(low_hz=1e-9) if at_zero and form != frf.form else frf
    np.testing.assert_allclose(back.values, kept.values, rtol=1e-14)
    assert_same(kept, back, but=("values", "notes"))


@given(frfs(zero_line=False), forms)
def test_conversion_changes_phase_and_magnitude_as_differentiation(frf, form):
    power = FORMS.index(form) - FORMS.index(frf.form)
    s = 2j * np.pi * frf.frequency_hz + frf.decay_rate
    np.testing.assert_allclose(
        frf.to(form).values / frf.values, np.broadcast_to((s**power)[:, None, None], frf.shape), rtol=1e-13
    )


@given(frfs(), st.data())
def test_selection_in_any_order_and_in_steps(frf, data):
    _, n_out, n_in = frf.shape
    rows = data.draw(st.lists(st.integers(0, n_out - 1), min_size=1, max_size=4))
    columns = data.draw(st.lists(st.integers(-n_in, n_in - 1), min_size=1, max_size=4))
    low, high = sorted(data.draw(st.tuples(*[st.sampled_from(list(frf.frequency_hz))] * 2)))
    at_once = frf.select(responses=rows, excitations=columns, low_hz=low, high_hz=high)
    in_steps = frf.select(low_hz=low).select(excitations=columns).select(responses=rows).select(high_hz=high)
    assert_same(at_once, in_steps)
    inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    np.testing.assert_array_equal(at_once.values, frf.values[inside][:, rows][:, :, columns])
    assert at_once.units == tuple(tuple(frf.units[i][j] for j in columns) for i in rows)
    assert at_once.shape == (np.count_nonzero(inside), len(rows), len(columns))


@given(frfs(), forms)
def test_selection_and_conversion_commute(frf, form):
    assume(frf.complex_frequency_hz[0] != 0.0)
    first = frf.to(form).select(responses=-1, excitations=0, high_hz=float(frf.frequency_hz[-1]))
    second = frf.select(responses=-1, excitations=0).to(form)
    assert_same(first, second)


@given(frfs(), st.data())
def test_resampling_on_measured_lines_is_exact(frf, data):
    chosen = data.draw(st.lists(st.booleans(), min_size=frf.shape[0], max_size=frf.shape[0]).filter(any))
    lines = frf.frequency_hz[np.array(chosen)]
    found = frf.resample(lines)
    kept = frf.with_(usable=np.array(chosen)).masked()
    assert_same(kept, found, but=("usable", "correlated_lines"))
    assert np.all(found.correlated_lines <= kept.correlated_lines)
    if all(chosen):
        assert_same(frf, found)


@given(frfs(), st.floats(0.05, 0.95))
def test_resampling_between_lines_stays_between_neighbours(frf, share):
    assume(frf.shape[0] > 2 and frf.log_variance is not None)
    lines = frf.frequency_hz[:-1] + share * np.diff(frf.frequency_hz)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # random values bend as sharply as can be
        found = frf.resample(lines)
    low = np.minimum(frf.log_variance[:-1], frf.log_variance[1:])
    high = np.maximum(frf.log_variance[:-1], frf.log_variance[1:])
    assert np.all(found.log_variance >= low * (1.0 - 1e-9))
    assert np.all(found.log_variance <= high * (1.0 + 1e-9))
    assert np.all(np.isfinite(found.values))


@given(frfs())
def test_pickle_and_with(frf):
    assert_same(frf, pickle.loads(pickle.dumps(frf)))
    assert_same(frf, frf.with_())
    assert_same(frf, frf.conjugated().conjugated(), but=("notes",))
    assert_same(frf, frf.flipped().flipped(), but=("notes",))


@settings(max_examples=4)  # each draws a figure
@given(frfs())
def test_representations_raise_no_error(frf):
    assert repr(frf).startswith("FRF(")
    assert "</table>" in frf._repr_html_()


@given(parts(lossy=True, most=2, name="bar"), st.sampled_from(["y", "theta"]), st.booleans())
def test_no_warning_for_simulated_drive_points(part, direction, far):
    """Lossy parts of any size; lines that resolve the first peaks. Warnings are errors here."""
    assembly = Assembly([part])
    upper = 50.0
    while (modes := assembly.natural_frequencies(upper)).size < 2:
        upper *= 1.5
    lines = np.linspace(0.02, 1.3, 1500) * modes[1]
    place = Coordinate("bar", "end" if far else 0.0, direction)
    values = assembly.receptance(lines, response=place, excitation=place)
    frf = FRF(frequency_hz=lines, values=values, responses=place, excitations=place)
    for form in FORMS:
        # With the values given anew the drive point is judged anew.
        assert frf.to(form).with_(values=frf.to(form).values).notes == ()
        values = frf.to(form).values.ravel()
        assert check_drive_point(lines, -values, form).contradicted == bool(
            check_drive_point(lines, values, form).conventions
        )
