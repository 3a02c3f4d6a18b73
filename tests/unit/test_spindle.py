"""Spindles from blanks: inverse coupling, rotations by differences, modes, and errors."""

from __future__ import annotations

import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from machine_spindle import (
    LINES,
    as_table,
    at_two_places,
    make_blank,
    make_spindle,
    measure,
    seen_at_the_plane,
    with_spindle,
)
from receptance import (
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    MeasuredPart,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointMass,
    ReceptanceWarning,
    Segment,
)
from receptance.coupling import fit_spindle, identify_spindle, rotations, spindle_of
from receptance.coupling.line_bands import bands_of
from receptance.fit import Tolerance
from receptance.fit.parameters import Site
from receptance.fit.predictor import Predictor

SPARSE = LINES[::6]
TRUE = seen_at_the_plane(make_spindle(), SPARSE)
SIZE = np.sqrt(np.abs(TRUE[:, [0, 1], [0, 1]]))
SIZE = SIZE[:, :, None] * SIZE[:, None, :]
"""Magnitude of each term; sqrt(|G_yy G_tt|) for the coupling."""


def relative_error(matrix: np.ndarray, usable: np.ndarray) -> float:
    """Return the largest error on usable lines."""
    return float(np.max((np.abs(matrix - TRUE) / SIZE)[usable]))


def test_mass_on_the_blank_is_removed_with_it() -> None:
    sensor = PointMass(mass=0.01, part="blank", position=0.0, name="sensor")
    blank = Assembly(make_blank().elements.values(), [sensor])
    found = identify_spindle(at_two_places(blank, 0.07, sd=1e-9, lines=SPARSE))
    assert found.usable.all()
    assert relative_error(found.matrix, found.usable) < 1e-9


@pytest.mark.parametrize("lengths", [(0.08, 0.12, 0.17), (0.08, 0.12, 0.17, 0.2)])
def test_tips_of_several_blanks_are_sufficient(lengths: tuple[float, ...]) -> None:
    observed = [measure(make_blank(length), 0.0, 0.0, sd=1e-9, lines=LINES[::2]) for length in lengths]
    found = identify_spindle(observed, limit=1e-4)
    true = seen_at_the_plane(make_spindle(), LINES[::2])
    assert found.usable.mean() > 0.95
    assert np.max((np.abs(found.matrix - true) / np.abs(true))[found.usable]) < 1e-5
    assert np.isnan(found.rms) == (len(lengths) == 3)


def test_lines_of_an_exponential_window() -> None:
    lines = SPARSE - 3j
    blank = make_blank()
    whole = with_spindle(blank, make_spindle())
    tip, near = Coordinate("blank", 0.0), Coordinate("blank", 0.07)
    observed = [
        Observation(
            assembly=blank,
            frequency_hz=lines,
            receptance=whole.receptance(lines, response=a, excitation=b),
            response=a,
            excitation=b,
            standard_deviation=1e-9,
        )
        for a, b in ((tip, tip), (near, tip), (near, near))
    ]
    found = identify_spindle(observed)
    assert found.decay_rate == pytest.approx(6.0 * np.pi)
    np.testing.assert_allclose(found.matrix, seen_at_the_plane(make_spindle(), lines), rtol=1e-8)
    part = found.part()
    machine = Assembly([*blank.elements.values(), part])
    np.testing.assert_allclose(machine.receptance(lines), whole.receptance(lines), rtol=1e-9)


def test_spindle_files_round_trip(tmp_path: Any) -> None:
    from receptance.io import read_frf, write

    found = identify_spindle(at_two_places(make_blank(), 0.07, sd=1e-3, lines=SPARSE))
    write(tmp_path / "spindle.npz", found.as_frf())
    part = spindle_of(read_frf(tmp_path / "spindle.npz"), name="spindle")
    np.testing.assert_allclose(part.matrix, found.part().matrix, rtol=1e-12)
    assert pickle.loads(pickle.dumps(found)).usable.sum() == found.usable.sum() > 120
    assert found.to_dict()["limit"] == 0.2
    assert len(found.plot().axes) == 4


def test_undetermined_lines_are_masked() -> None:
    rng = np.random.default_rng(11)
    found = identify_spindle(at_two_places(make_blank(), 0.07, sd=0.01, rng=rng, lines=SPARSE))
    assert 0.5 < found.usable.mean() < 0.98
    # Masked lines have larger errors than usable ones, and usable ones are within their variance.
    error = np.abs(found.matrix - TRUE) / SIZE
    assert np.median(error[~found.usable]) > 2.0 * np.median(error[found.usable])
    assert found.condition[~found.usable].min() > np.median(found.condition)
    assert any("lines are usable" in note for note in found.notes)
    with pytest.raises(ValueError, match="is not known between"):
        found.part().receptance(np.arange(SPARSE[0], SPARSE[-1], 7.0))
    nothing = identify_spindle(at_two_places(make_blank(), 0.07, sd=0.01, rng=rng, lines=SPARSE), limit=1e-4)
    with pytest.raises(ValueError, match="no line is usable: the relative standard deviation"):
        nothing.part()


def test_bands_have_all_lines_and_say_why() -> None:
    rng = np.random.default_rng(11)
    found = identify_spindle(at_two_places(make_blank(), 0.07, sd=0.01, rng=rng))
    bands = bands_of(found)
    assert sum(band.lines for band in bands) == LINES.size
    assert sum(band.usable for band in bands) == found.usable.sum()
    assert all(one.high_hz < other.low_hz for one, other in pairwise(bands))
    poor = [band for band in bands if band.usable < 0.5 * band.lines]
    worst = max(poor, key=lambda band: band.condition)
    assert worst.reason == "theta/M"
    assert worst.deviation > found.limit
    good = [band for band in bands if band not in poor]
    assert worst.condition > 3.0 * max(band.condition for band in good)
    # In the others the standard deviation would be small enough, if it were valid.
    assert all(band.reason == "noise" and band.deviation < found.limit for band in poor if band is not worst)


def test_tolerances_of_a_blank_are_propagated() -> None:
    """To first order the covariance contains the change of the result by a described error."""
    observed = at_two_places(make_blank(), 0.07, sd=1e-4, lines=SPARSE)
    deviation = 2e-5
    error = Tolerance(name="diameter", moves={"blank.segment[0].outer_diameter": deviation})
    exact, stated = identify_spindle(observed), identify_spindle(observed, tolerances=error)
    wrong = make_blank(diameter=0.05 + deviation)
    moved = identify_spindle([changed(one, assembly=wrong) for one in observed]).matrix - exact.matrix
    added = np.einsum("nii->ni", stated.covariance - exact.covariance).real
    change = np.abs(np.stack([moved[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1))], axis=1)) ** 2
    np.testing.assert_allclose(added, change, rtol=0.05)


def test_the_discrepancy_of_modes_is_one_error_of_all_lines() -> None:
    mode = Mode(frequency_hz=900.0, damping_ratio=0.05, y=0.3, theta=2.0)
    part = ModalPart(modes=[mode], residual_y=5e-9, residual_theta=5e-7, discrepancy=0.02, name="spindle")
    machine = Assembly([*make_blank().elements.values(), part])
    linear = Predictor().at(Site(machine, "machine"), ()).linear(SPARSE)
    drawn = linear.drawn_errors(4000, 1)
    np.testing.assert_allclose(np.mean(np.abs(drawn) ** 2, axis=0), 2.0 * linear.variance, rtol=0.1)
    correlation = np.corrcoef(drawn[:, 0], drawn[:, 1])
    assert abs(correlation[0, 1]) > 0.99
    table = MeasuredPart(
        frequency_hz=SPARSE,
        matrix=part.receptance(SPARSE),
        covariance=np.einsum("nij,nkj->nik", *(part.error_root(SPARSE),) * 2),
        name="spindle",
    )
    tabled = Assembly([*make_blank().elements.values(), table])
    of_table = Predictor().at(Site(tabled, "machine"), ()).linear(SPARSE)
    np.testing.assert_allclose(of_table.variance, linear.variance, rtol=1e-6)
    independent = of_table.drawn_errors(4000, 1)
    assert abs(np.corrcoef(independent[:, 0], independent[:, 1])[0, 1]) < 0.1


def differences(blank: Assembly, count: int, spacing: float, sd: float = 1e-9) -> tuple[Observation, ...]:
    """Return rotations from evenly spaced points, `count` of them."""
    places = [spacing * i for i in range(count)]
    return rotations([measure(blank, b, a, sd=sd, lines=LOW) for i, a in enumerate(places) for b in places[i:]])


LOW = LINES[:100:3]


def errors(blank: Assembly, rotations: tuple[Observation, ...]) -> list[float]:
    """Return the median relative errors after comparing them with the stated deviations."""
    machine, found = with_spindle(blank, make_spindle()), []
    for one in rotations:
        exact = machine.receptance(LOW, response=one.response, excitation=one.excitation)
        found.append(float(np.median(np.abs(one.receptance / exact - 1.0))))
        stated = float(np.median(np.asarray(one.standard_deviation)))
        assert stated == pytest.approx(found[-1], rel=0.4, abs=1e-8)
    return found


def test_rotations_by_differences_report_their_error() -> None:
    """Truncation decreases with the spacing in a slender blank, but not in a thick one (shear); noise increases."""
    slender, thick = make_blank(0.12, 0.006), make_blank(0.12, 0.05)
    coarse, fine = (errors(slender, differences(slender, 2, s)) for s in (0.02, 0.01))
    assert coarse[1] / fine[1] > 3.0  # theta/F: s^2
    assert coarse[2] / fine[2] == pytest.approx(2.0, rel=0.2)  # theta/M: s
    coarse, fine = (errors(slender, differences(slender, 3, s)) for s in (0.02, 0.01))
    assert coarse[1] / fine[1] > 3.0
    near, nearer = (errors(thick, differences(thick, 2, s)) for s in (0.02, 0.01))
    assert nearer[2] > 2.0 * near[2]
    # The noise of theta/M alone: 1/s^2.
    noise = []
    for s in (0.02, 0.06):
        places = [(0.0, 0.0), (0.0, s), (s, s)]
        observed = [measure(thick, b, a, sd=1e-3, lines=LOW) for a, b in places]
        noise.append(np.median(np.asarray(rotations(observed, truncation=False)[2].standard_deviation)))
        assert "truncation" in rotations(observed)[2].notes[0]
    assert noise[0] > 3.0 * noise[1]


def test_both_of_a_reciprocal_pair_count_as_two_measurements() -> None:
    """The noise of y/F at the second place through the first is that of a mean of two."""
    blank = make_blank(0.12)
    once = [measure(blank, b, a, sd=1e-2, lines=LOW) for a, b in ((0.0, 0.0), (0.0, 0.03), (0.03, 0.03))]
    twice = [*once, measure(blank, 0.0, 0.03, sd=1e-2, lines=LOW)]
    y, cross, _ = (one.receptance for one in once)
    for observed, share in ((once, 1.0), (twice, 0.5)):
        found = rotations(observed, truncation=False)[1]
        # theta/F is (H_21 - H_11)/s, and each H errs by a hundredth of itself.
        expected = 1e-2 * np.sqrt(np.abs(y) ** 2 + share * np.abs(cross) ** 2) / np.abs(cross - y)
        np.testing.assert_allclose(np.asarray(found.standard_deviation), expected, rtol=1e-9)


def test_spindle_by_differences_has_their_truncation_error() -> None:
    blank = make_blank(0.12)
    observed = [measure(blank, b, a, sd=1e-6, lines=SPARSE) for a, b in ((0.0, 0.0), (0.0, 0.03), (0.03, 0.03))]
    by_differences = identify_spindle(rotations(observed), limit=0.5, allow_mismatch=True)
    directly = identify_spindle(observed)
    assert relative_error(directly.matrix, directly.usable) < 1e-3
    assert relative_error(by_differences.matrix, directly.usable) > 0.02
    # An error of this size has no standard deviation of first order.
    assert by_differences.usable.mean() < 0.1


def test_a_number_at_its_lower_bound_has_no_error() -> None:
    """Errors of a damping ratio at its bound would make it negative, where an assembly has no value."""
    blank = Part([Segment(length=0.1, outer_diameter=0.05, material=STEEL)], name="blank")
    mode = Mode(frequency_hz=900.0, damping_ratio=2e-4, y=0.2, theta=1.0)
    true = ModalPart(modes=[mode], residual_y=5e-9, residual_theta=5e-7, residual_ytheta=2e-8)
    lines, places = np.arange(200.0, 2000.0, 20.0), [Coordinate("blank", 0.0), Coordinate("blank", 0.07)]
    noise = np.exp(0.01 * np.random.default_rng(7).standard_normal((lines.size, 2, 2)))
    h = Assembly([blank, true]).receptance(lines, response=places, excitation=places) * noise
    observed = [
        Observation(
            assembly=Assembly([blank]),
            frequency_hz=lines,
            receptance=h[:, i, j],
            standard_deviation=0.01,
            response=places[i],
            excitation=places[j],
        )
        for i, j in ((0, 0), (1, 0), (1, 1))
    ]
    fit = fit_spindle(observed, modes=1)
    at = fit.part.addresses.index("mode[0].damping_ratio")
    assert fit.part.modes[0].damping_ratio == pytest.approx(1e-3)
    assert not fit.covariance[at].any()
    assert fit.covariance[fit.part.addresses.index("mode[0].frequency_hz")].any()
    assert not any("spindle.mode[0].damping_ratio" in error.moves for error in fit.tolerances)


@pytest.mark.slow
def test_modes_are_known_where_few_lines_are() -> None:
    """Noise of 5 %: most lines are not usable, and the modes are as exact as all of them together."""
    rng = np.random.default_rng(5)
    lines = LINES[::2]
    observed = at_two_places(make_blank(), 0.07, sd=0.05, rng=rng, lines=lines)
    assert identify_spindle(observed, allow_mismatch=True).usable.mean() < 0.5
    fit = fit_spindle(observed)
    assert fit.identification is not None
    assert fit.identification.converged
    assert 0.9 < fit.identification.rms < 1.1
    machine = Assembly([*make_blank(0.15).elements.values(), fit.part])
    asked = lines[5:-5:10]
    error = np.log(np.abs(machine.receptance(asked) / with_spindle(make_blank(0.15), make_spindle()).receptance(asked)))
    assert np.median(np.abs(error)) < 0.02
    assert np.median(np.abs(error) / fit.standard_deviation(machine, asked)) < 1.5


@pytest.mark.slow
def test_modes_are_fitted_to_the_responses() -> None:
    rng = np.random.default_rng(5)
    observed = at_two_places(make_blank(), 0.07, sd=0.01, rng=rng, lines=LINES[::2])
    found = identify_spindle(observed)
    fit = fit_spindle(observed)
    assert fit.identification.rms < 1.2
    np.testing.assert_allclose([m.frequency_hz for m in fit.part.modes][:3], [1066.8, 1275.7, 2404.6], rtol=0.01)
    true = seen_at_the_plane(make_spindle(), LINES[::2])
    size = np.sqrt(np.abs(true[:, [0, 1], [0, 1]]))
    error = np.abs(fit.part.receptance(LINES[::2]) - true) / (size[:, :, None] * size[:, None, :])
    by_line = np.abs(found.matrix - true) / (size[:, :, None] * size[:, None, :])
    assert np.median(error) < 0.5 * np.median(by_line[found.usable])
    machine = Assembly([*make_blank(0.15).elements.values(), fit.part])
    with pytest.raises(ValueError, match="it is not extrapolated"):
        machine.receptance([5000.0])
    deviation = fit.standard_deviation(machine, LINES[::20])
    whole = with_spindle(make_blank(0.15), make_spindle()).receptance(LINES[::20])
    z = np.abs(np.log(machine.receptance(LINES[::20]) / whole)) / (np.sqrt(2.0) * deviation)
    assert np.sqrt(np.mean(z**2)) < 2.0
    # Draws have the stated deviation, to which errors of the modes and of the model contribute.
    drawn = np.log(np.abs(fit.draws(machine, LINES[::20], count=400))).std(axis=0)
    np.testing.assert_allclose(np.median(drawn / deviation), 1.0, atol=0.1)
    assert fit.covariance.shape == (len(fit.addresses),) * 2


def changed(one: Observation, **changes: Any) -> Observation:
    names = ("assembly", "frequency_hz", "receptance", "response", "excitation", "standard_deviation", "label")
    return Observation(**{name: getattr(one, name) for name in names} | changes)


class TestErrors:
    """Unsuitable blanks and responses."""

    good = at_two_places(make_blank(), 0.07, sd=0.003, rng=np.random.default_rng(2), lines=SPARSE)
    other = measure(make_blank(0.15), 0.0, 0.0, sd=0.003, rng=np.random.default_rng(3), lines=SPARSE)

    @pytest.mark.parametrize("described", [make_blank(0.102), make_blank(diameter=0.049)])
    def test_a_blank_that_does_not_match(self, described: Assembly) -> None:
        wrong = [changed(one, assembly=described) for one in self.good]
        with pytest.raises(ValueError, match="no spindle explains the responses of all blanks: the rms is"):
            identify_spindle([*wrong, self.other])
        with pytest.warns(ReceptanceWarning, match="no spindle explains"):
            found = identify_spindle([*wrong, self.other], allow_mismatch=True)
        assert "no spindle explains" in found.notes[-1]
        assert identify_spindle([*self.good, self.other]).rms < 1.3

    @pytest.mark.parametrize("factor", [-1.0, -((2.0 * np.pi * SPARSE) ** 2)])
    def test_unsuitable_channel(self, factor: Any) -> None:
        wrong = [changed(self.good[0], receptance=factor * self.good[0].receptance), *self.good[1:]]
        with pytest.raises(ValueError, match="the spindle would be a source of energy on"):
            identify_spindle(wrong)

    def test_negative_static_stiffness(self) -> None:
        soft = [changed(one, assembly=make_blank(diameter=0.025)) for one in self.good]
        with pytest.raises(ValueError, match="negative static stiffness: at 1"):
            identify_spindle(soft)
        # Above its modes a spindle is a mass, whose receptance is negative as well.
        for first in (500.0, 1300.0, 2500.0):
            assert not identify_spindle([one.select(first <= SPARSE) for one in self.good]).mismatch

    def test_bands_that_do_not_overlap(self) -> None:
        early, late = SPARSE < 1000.0, SPARSE > 1000.0
        cut = [
            changed(one, frequency_hz=SPARSE[rows], receptance=one.receptance[rows], standard_deviation=0.003)
            for one, rows in zip(self.good, (early, early, late), strict=True)
        ]
        with pytest.raises(ValueError, match=r"no line that all of Observation\(.*from 100 to 9\d\d Hz\)"):
            identify_spindle(cut)

    def test_insufficient_measurements(self) -> None:
        with pytest.raises(ValueError, match="three unknown terms on each line, and there are 2 receptances"):
            identify_spindle(self.good[:2])
        same = [measure(make_blank(), x, 0.0, sd=0.01, lines=SPARSE) for x in (0.0, 0.03, 0.07)]
        with pytest.raises(ValueError, match="determine only 2 of the spindle"):
            identify_spindle(same)
        with pytest.raises(ValueError, match="has no standard deviation"):
            identify_spindle([changed(one, standard_deviation=None) for one in self.good])

    def test_more_than_a_blank(self) -> None:
        blank = make_blank()
        ended = Assembly([*blank.elements.values(), as_table(make_spindle(), SPARSE)])
        with pytest.raises(ValueError, match="its assembly ends with a spindle, expected the blank alone"):
            identify_spindle([changed(one, assembly=ended) for one in self.good])
        held = Assembly(blank.elements.values(), [GroundSpring(k_y=1e7, part="blank", position="end", name="hand")])
        with pytest.raises(ValueError, match="has the ground spring 'hand'"):
            identify_spindle([changed(one, assembly=held) for one in self.good])

    def test_differences_with_uneven_spacing(self) -> None:
        blank = make_blank()
        places = (0.0, 0.02, 0.05)
        uneven = [measure(blank, b, a, sd=0.01, lines=SPARSE) for i, a in enumerate(places) for b in places[i:]]
        with pytest.raises(ValueError, match=r"the points are 0\.02 and 0\.03 m apart"):
            rotations(uneven)
        with pytest.raises(ValueError, match="there is no observation between"):
            rotations(uneven[:2])
        with pytest.raises(ValueError, match="expected one blank"):
            rotations([*self.good, self.other])
