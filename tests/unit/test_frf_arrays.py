"""FRFs as arrays: arithmetic with its variance, slices of frequency, and arrays and tables of other programs."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from receptance import FRF, Coordinate

LINES = np.arange(10.0, 20.0)
RNG = np.random.default_rng(20261123)


def made(rows: int = 2, columns: int = 1, **fields: object) -> FRF:
    shape = (LINES.size, rows, columns)
    return FRF(frequency_hz=LINES, values=RNG.normal(size=shape) + 1j * RNG.normal(size=shape), **fields)  # type: ignore[arg-type]


def test_numpy_takes_an_frf_as_an_array() -> None:
    frf = made()
    assert len(frf) == LINES.size
    np.testing.assert_array_equal(np.asarray(frf), frf.values)
    np.testing.assert_array_equal(abs(frf), np.abs(frf.values))
    np.testing.assert_array_equal(np.angle(frf), np.angle(frf.values))
    assert np.asarray(frf, dtype=np.complex64).dtype == np.complex64
    copied = np.asarray(frf)
    copied[0] = 0.0  # a copy: the values of an FRF do not change
    assert frf.values[0].all()
    with pytest.raises(TypeError):
        iter(frf)  # type: ignore[call-overload]


def test_slices_are_frequencies_in_hz() -> None:
    frf = made(labels=(["tip", "nose"], ["hammer"]))
    np.testing.assert_array_equal(frf[12:15].frequency_hz, [12.0, 13.0, 14.0, 15.0])
    assert frf[:12.5].shape == (3, 2, 1)
    np.testing.assert_array_equal(frf[:, "nose"].values, frf.values[:, 1:])
    assert frf[11:12, [1, 0], 0].labels == (("nose", "tip"), ("hammer",))
    for wrong in (3, slice(1, 5, 2), (slice(None), 0, 0, 0)):
        with pytest.raises(TypeError, match=r"expected frequencies in Hz as in \[500:2000\]"):
            frf[wrong]  # type: ignore[index]
    with pytest.raises(ValueError, match="there is no line"):
        frf[100:200]


@pytest.mark.parametrize("number", [2.0, 3, -1j, np.float64(0.5), np.complex128(1 + 1j)])
def test_a_factor_leaves_the_relative_variance(number: complex) -> None:
    frf = made(log_variance=0.01, label="tip")
    for scaled in (frf * number, number * frf):
        assert isinstance(scaled, FRF)
        np.testing.assert_allclose(scaled.values, number * frf.values, rtol=1e-15)
        np.testing.assert_array_equal(scaled.log_variance, frf.log_variance)
        assert scaled.label == "tip"
    np.testing.assert_allclose((frf / number).values, frf.values / number, rtol=1e-15)
    np.testing.assert_array_equal((-frf).values, -frf.values)
    with pytest.raises(ValueError, match="expected a factor other than zero"):
        frf * 0.0


def test_other_operands_give_arrays() -> None:
    one, other = made(), made()
    for found, expected in (
        (one / other, one.values / other.values),
        (one * other, one.values * other.values),
        (1.0 / one, 1.0 / one.values),
        (one - 1.0, one.values - 1.0),
        (1.0 - one, 1.0 - one.values),
        (one * other.values, one.values * other.values),
        (other.values * one, one.values * other.values),
    ):
        assert isinstance(found, np.ndarray)
        np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_the_variance_of_a_difference_is_that_of_draws() -> None:
    one = made(1, log_variance=4e-4, degrees_of_freedom=6.0)
    other = made(1, log_variance=1e-4, degrees_of_freedom=20.0)
    found = one - other
    draws = 40_000

    def drawn(frf: FRF) -> np.ndarray:
        normal = RNG.normal(size=(draws, *frf.shape)) + 1j * RNG.normal(size=(draws, *frf.shape))
        return frf.values * (1.0 + np.sqrt(frf.log_variance) * normal)

    spread = ((drawn(one) - drawn(other)) / found.values).real.var(axis=0)
    np.testing.assert_allclose(found.log_variance, spread, rtol=0.05)
    assert found.degrees_of_freedom is not None
    assert ((found.degrees_of_freedom > 5.9) & (found.degrees_of_freedom < 26.1)).all()
    assert (one + made(1)).log_variance is None


def test_sums_take_the_same_lines_and_units() -> None:
    frf = made()
    mobility = made().to("mobility")
    np.testing.assert_allclose((frf + mobility).values, frf.values + mobility.to("receptance").values, rtol=1e-14)
    with pytest.raises(ValueError, match="different lines, expected the same; resample one of them"):
        frf + frf[11:]
    with pytest.raises(ValueError, match="different units"):
        frf + made(responses=["y", "theta"])


@pytest.mark.parametrize("rows", [1, 3])
def test_arrays_of_other_programs(rows: int) -> None:
    """pyFBS has lines, responses, excitations; pyFRF and sdypy have responses, excitations, lines."""
    frf = made(rows, 2)
    np.testing.assert_array_equal(frf.to_array(), frf.values)
    last = frf.to_array("lines last")
    assert last.shape == (rows, 2, LINES.size)
    np.testing.assert_array_equal(FRF.from_array(last, LINES, "lines last").values, frf.values)
    np.testing.assert_array_equal(FRF.from_array(last[:, 0], LINES, "lines last").values[:, :, 0], frf.values[:, :, 0])
    np.testing.assert_array_equal(FRF.from_array(frf.values[:, :, 0], LINES).values[:, :, 0], frf.values[:, :, 0])
    assert FRF.from_array(frf.values, LINES, form="mobility").unit == "m/s/N"
    with pytest.raises(ValueError, match="order is 'last', expected one of 'lines first', 'lines last'"):
        frf.to_array("last")  # type: ignore[arg-type]


def test_xarray_and_back() -> None:
    pytest.importorskip("xarray", reason="needs xarray: pip install 'receptance[sweep]'")
    frf = made(
        2, 2, form="mobility", coherence=0.9, averages=5, log_variance=0.01, degrees_of_freedom=8.0, decay_rate=3.0,
        responses=[Coordinate("tool", 0.01), "theta"], excitations=[Coordinate("holder", "end"), Coordinate()],
        usable=LINES > 12.0, labels=(["a", "b"], ["c", "d"]), label="tip", source="here", notes=["measured"],
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = FRF.from_xarray(frf.to_xarray())
    for name in frf.__dataclass_fields__:
        np.testing.assert_equal(getattr(again, name), getattr(frf, name), err_msg=name)
    with pytest.raises(ValueError, match=r"expected one of FRF\.to_xarray"):
        FRF.from_xarray(frf.to_xarray().drop_vars("frf"))


def test_pandas_and_back() -> None:
    pytest.importorskip("pandas", reason="needs pandas: pip install 'receptance[sweep]'")
    for frf in (made(2, 3), made(2, 2, labels=(["a", "b"], ["c", "d"]))):
        table = frf.to_pandas()
        assert table.index.name == "frequency_hz"
        again = FRF.from_pandas(table.sample(frac=1.0, axis=1, random_state=1) if frf.labels else table)
        assert again.labels is not None
        order = [again.labels[0].index(name) for name in table.columns.get_level_values(0).unique()]
        sources = [again.labels[1].index(name) for name in table.columns.get_level_values(1).unique()]
        np.testing.assert_array_equal(again.values[:, order][:, :, sources], frf.values)
    single = made(1)
    np.testing.assert_array_equal(FRF.from_pandas(single.to_pandas().iloc[:, 0]).values, single.values)
    with pytest.raises(ValueError, match="expected one for each pair"):
        FRF.from_pandas(made(2, 2).to_pandas().iloc[:, :3])
