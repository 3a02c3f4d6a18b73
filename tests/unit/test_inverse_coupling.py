"""Inverse coupling: the joint's stiffness line by line, its variance, and the mask of undetermined lines."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from receptance import Coordinate, Observation, identify
from receptance.coupling import InverseCoupling, invert_coupling
from receptance.fit import Tolerance
from tool_in_holder import TRUE, make_assembly

TIP, NOSE, SHANK = Coordinate(), Coordinate("holder", 0.0), Coordinate("tool", 0.03)
LINES = np.linspace(50.0, 8000.0, 400)
AT = {"k_y": (0, 0), "k_theta": (1, 1), "k_ytheta": (0, 1)}
ALL = tuple(AT)
COUPLED = {"k_ytheta": 2e6, "c_ytheta": 0.3}
ELSEWHERE = {"k_y": 3e9, "k_theta": 7e6, "k_ytheta": 10.0, "c_y": 30.0, "c_theta": 5.0, "c_ytheta": 0.0}


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def measure(true, response, excitation=TIP, *, described=None, noise=None, sd=0.005, lines=LINES, label=""):
    h = true.receptance(lines, response=response, excitation=excitation)
    if noise is not None:
        h = h * np.exp(sd * (noise.normal(size=h.size) + 1j * noise.normal(size=h.size)))
    return Observation(
        assembly=described or true,
        frequency_hz=lines,
        receptance=h,
        response=response,
        excitation=excitation,
        standard_deviation=sd,
        label=label,
    )


def blind(true, terms):
    """Return the assembly with wrong values of all joint parameters that are solved for."""
    wrong = {name: value for name, value in ELSEWHERE.items() if f"k{name[1:]}" in terms}
    return true.replace({f"joint.{name}": value for name, value in wrong.items()})


def errors_of(found: InverseCoupling, true) -> dict[str, np.ndarray]:
    """Return how far each term is off, the coupling relative to sqrt(k_y k_theta)."""
    k = true.elements["joint"].stiffness(np.asarray(found.frequency_hz).real)
    size = {"k_ytheta": np.sqrt(np.abs(k[:, 0, 0] * k[:, 1, 1]))}
    return {t: np.abs(found.term(t)[0] - k[:, *AT[t]]) / size.get(t, np.abs(k[:, *AT[t]])) for t in found.terms}


@pytest.mark.parametrize(
    ("pairs", "terms"),
    [
        ([(TIP, TIP)], ("k_y",)),
        ([(NOSE, TIP)], ("k_theta",)),
        ([(TIP, TIP), (NOSE, TIP)], ("k_y", "k_theta")),
        ([(TIP, TIP), (NOSE, NOSE)], ("k_y", "k_ytheta")),
        ([(TIP, TIP), (NOSE, TIP), (NOSE, NOSE)], ALL),
        ([(TIP, TIP), (NOSE, TIP), (NOSE, NOSE), (SHANK, NOSE)], ALL),
    ],
)
def test_exact_where_the_data_are(pairs, terms):
    true = make_assembly(**COUPLED)
    described = blind(true, terms)
    found = invert_coupling([measure(true, *pair, described=described) for pair in pairs], terms=terms)
    assert found.terms == terms
    for term, off in errors_of(found, true).items():
        assert off.max() < 1e-6, term
    for name, value in found.start().items():
        assert value == pytest.approx(true.get(name), rel=1e-6), name


@pytest.mark.parametrize("decay", [0.0, 20.0])
def test_a_window_on_both_channels(decay):
    """Complex lines: the stiffness is k + i w c with the complex w, and its parts are separated."""
    true = make_assembly()
    lines = LINES - 1j * decay / (2.0 * np.pi)
    found = invert_coupling([measure(true, place, lines=lines) for place in (TIP, NOSE)])
    for name, value in found.start().items():
        assert value == pytest.approx(TRUE[name], rel=1e-6), name


def test_overhangs_for_coordinates():
    """The same joint at two overhangs, each measured at its tip, is two equations as well."""
    true = [make_assembly(overhang) for overhang in (0.05, 0.08)]
    found = invert_coupling([measure(t, TIP, described=blind(t, ("k_y", "k_theta"))) for t in true])
    for term, off in errors_of(found, true[0]).items():
        assert np.mean(off < 1e-6) > 0.97, term
    for name, value in found.start().items():
        assert value == pytest.approx(TRUE[name], rel=1e-6), name


@pytest.mark.slow
def test_standard_deviations_against_random_draws(rng):
    true = make_assembly(**COUPLED)
    # Lines are solved alone, so that 150 lines within 1 mHz are 150 draws of one line.
    lines = (LINES[60::60, None] + np.linspace(0.0, 1e-3, 150)).ravel()
    pairs = [(TIP, TIP), (NOSE, TIP), (NOSE, NOSE)]
    exact, found = (
        invert_coupling([measure(true, *pair, lines=lines, sd=2e-5, noise=noise) for pair in pairs])
        for noise in (None, rng)
    )
    for term in ALL:
        value, stated, _ = exact.term(term)
        error = ((found.term(term)[0] - value) / stated).reshape(-1, 150)
        for part in (error.real, error.imag):
            # The standard deviation of 150 draws is known to 6 %.
            assert np.std(part, axis=1) == pytest.approx(1.0, abs=0.22), term


def test_condition_number_bounds_error_growth(rng):
    true = make_assembly(**COUPLED)
    lines = LINES[10::40]
    pairs = [(TIP, TIP), (NOSE, TIP), (NOSE, NOSE)]
    exact = invert_coupling([measure(true, *pair, lines=lines) for pair in pairs])
    k = exact.stiffness
    size = np.stack([np.abs(k[:, 0, 0]), np.abs(k[:, 1, 1]), np.sqrt(np.abs(k[:, 0, 0] * k[:, 1, 1]))], axis=1)
    most = np.zeros(lines.size)
    for _ in range(100):
        error = 1e-8 * np.exp(2j * np.pi * rng.random(3)) * rng.dirichlet([1.0, 1.0, 1.0]) ** 0.5
        obs = [
            Observation(
                assembly=true,
                frequency_hz=lines,
                receptance=true.receptance(lines, response=r, excitation=e) * (1.0 + err),
                response=r,
                excitation=e,
                standard_deviation=0.01,
            )
            for (r, e), err in zip(pairs, error, strict=True)
        ]
        moved = invert_coupling(obs).stiffness - k
        off = np.stack([moved[:, 0, 0], moved[:, 1, 1], moved[:, 0, 1]], axis=1) / size
        most = np.maximum(most, np.linalg.norm(off, axis=1) / 1e-8)
    clear = exact.condition < 1e4
    assert np.all(most[clear] <= 1.02 * exact.condition[clear])
    assert np.median(most[clear] / exact.condition[clear]) > 0.6


def test_a_tolerance_is_an_error_of_all_lines():
    """One standard deviation of the modulus, put into the truth, moves the stiffness by the model's deviation."""
    true = make_assembly()
    error = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 1e-4}, relative=True)
    other = true.replace({"tool.segment[0].youngs_modulus": true.get("tool.segment[0].youngs_modulus") * 1.0001})
    found = invert_coupling([measure(true, place) for place in (TIP, NOSE)], tolerances=error)
    moved = invert_coupling([measure(other, place, described=true) for place in (TIP, NOSE)])
    usable_lines = found.usable[:, 1, 1]
    change = np.abs(moved.stiffness[:, 1, 1] - found.stiffness[:, 1, 1])
    assert change[usable_lines] == pytest.approx(found.model_deviation[usable_lines, 1, 1], rel=0.05)
    assert np.all(found.model_deviation[:, 0, 1] == 0.0)


def test_start_converges_to_the_optimum(rng):
    true = make_assembly(**COUPLED)
    described = blind(true, ALL)
    data = [measure(true, *p, described=described, noise=rng) for p in [(TIP, TIP), (NOSE, TIP), (NOSE, NOSE)]]
    unknowns = invert_coupling(data).unknowns()
    assert {u.address for u in unknowns} >= {"joint.k_y", "joint.k_theta", "joint.k_ytheta", "joint.c_y"}
    one = identify(data, unknowns, starts=1)
    many = identify(data, unknowns, starts=4)
    assert one.converged
    assert one.rms == pytest.approx(many.rms, rel=1e-6)
    for name in ("joint.k_y", "joint.k_theta", "joint.k_ytheta"):
        assert one.values[name] == pytest.approx(true.get(name), rel=0.02), name


def test_uninformative_lines(rng):
    """At low frequency a stiff joint is not in the data; these lines are masked, and medians are unaffected."""
    true = make_assembly()
    found = invert_coupling([measure(true, place, noise=rng) for place in (TIP, NOSE)])
    low = LINES < 700.0
    assert not found.usable[low, 0, 0].any()
    assert found.usable[LINES > 7500.0, 0, 0].all()
    assert found.start()["joint.k_theta"] == pytest.approx(TRUE["joint.k_theta"], rel=0.02)
    assert any("usable for k_y" in note for note in found.notes)


def test_errors_in_the_assumed_model(rng):
    """A coupling that is not solved for is in no constant joint, as the note states."""
    true = make_assembly(**COUPLED)
    data = [measure(true, place, noise=rng) for place in (TIP, NOSE)]
    assert invert_coupling(data).rms == pytest.approx(1.0, abs=0.05)
    plain = true.replace({"joint.k_ytheta": 0.0, "joint.c_ytheta": 0.0})
    wrong = [measure(true, place, described=plain, noise=rng) for place in (TIP, NOSE)]
    found = invert_coupling(wrong)
    assert found.rms > 3.0
    assert any("no k + i w c fits all lines" in note for note in found.notes)


def test_lines_without_a_solution_are_masked_and_named():
    """A response across the joint: on lines that no finite joint explains the free assembly has none either."""
    true = make_assembly(**COUPLED)
    pairs = [(TIP, TIP), (NOSE, TIP), (NOSE, NOSE)]
    whole = [measure(true, *pair, sd=1e-4) for pair in pairs]
    values, deviations = whole[1].receptance.copy(), np.full(LINES.size, 1e-4)
    values[[40, 200]] = 1e150, 1e-160
    deviations[300] = 1e-300
    odd = Observation(
        assembly=true,
        frequency_hz=LINES,
        receptance=values,
        response=NOSE,
        excitation=TIP,
        standard_deviation=deviations,
    )
    found = invert_coupling([whole[0], odd, whole[2]])
    masked = ~np.isfinite(found.term("k_y")[0])
    assert masked[300]
    assert not np.delete(masked, [40, 200, 300]).any()
    assert not found.usable[masked].any()
    listed = ", ".join(f"{line:g}" for line in LINES[masked])
    note = f"{masked.sum()} of 400 lines are masked, their equations have no finite and unique solution: {listed} Hz"
    assert note in found.notes
    others = np.delete(np.arange(LINES.size), [40, 200, 300])
    assert max(off[others].max() for off in errors_of(found, true).values()) < 1e-6


def test_no_response():
    rigid = make_assembly(k_y=1e14, k_theta=1e10)
    low = np.linspace(10.0, 100.0, 50)
    found = invert_coupling([measure(rigid, place, lines=low, sd=0.05) for place in (TIP, NOSE)])
    assert not found.usable.any()
    assert found.start() == {}
    with pytest.raises(ValueError, match="no line gives k_y and k_theta"):
        found.unknowns()


def test_too_few_equations():
    true = make_assembly()
    with pytest.raises(ValueError, match="2 unknown terms on each line, but there is one receptance"):
        invert_coupling(measure(true, TIP), terms=("k_y", "k_theta"))
    with pytest.raises(ValueError, match="responses to one load, which determine at most two"):
        invert_coupling([measure(true, place) for place in (TIP, NOSE, SHANK)])
    with pytest.raises(ValueError, match="cannot separate k_y and k_theta"):
        invert_coupling([measure(true, TIP), measure(true, TIP)])


def test_mistakes_give_messages():
    true = make_assembly()
    tip = measure(true, TIP)
    bare = Observation(assembly=true, frequency_hz=LINES, receptance=tip.receptance)
    with pytest.raises(ValueError, match="no standard deviation"):
        invert_coupling(bare)
    with pytest.raises(ValueError, match="no point joint 'taper'"):
        invert_coupling(tip, joint="taper")
    with pytest.raises(ValueError, match="expected some of k_y, k_theta, k_ytheta"):
        invert_coupling(tip, terms=("k_x",))
    with pytest.raises(ValueError, match="there is no line that all of"):
        invert_coupling([tip, measure(true, NOSE, lines=LINES + LINES[-1])])
    with pytest.raises(ValueError, match="expected the same joint"):
        invert_coupling([tip, measure(make_assembly(0.08, k_y=1e9), TIP)], terms=("k_theta",))
    with pytest.raises(TypeError, match="expected an Observation"):
        invert_coupling([3])
    with pytest.raises(ValueError, match="'k_y' was not solved for, only k_theta"):
        invert_coupling(tip).term("k_y")


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_records_of_different_lengths_are_resampled(factor):
    """The lines with the widest steps are kept, within the common band."""
    true = make_assembly()
    other = np.linspace(LINES[0], LINES[-1], int(LINES.size / factor))
    # A few lines were not usable, and the gap is not interpolated.
    other = np.delete(other, np.flatnonzero((other > 1000.0) & (other < 1100.0)))
    found = invert_coupling([measure(true, TIP), measure(true, NOSE, lines=other)])
    lines = found.frequency_hz.real
    assert set(lines) <= set(LINES if factor < 1.0 else other)
    assert lines.size > 0.9 * LINES.size
    assert not ((lines > 1010.0) & (lines < 1090.0)).any()
    start = found.start()
    joint = true.elements["joint"]
    assert start["joint.k_y"] == pytest.approx(joint.k_y, rel=1e-3)
    assert start["joint.k_theta"] == pytest.approx(joint.k_theta, rel=1e-3)
    assert any(f"resampled to the {lines.size} lines of" in note for note in found.notes)


def test_common_lines_and_result_object():
    true = make_assembly()
    found = invert_coupling([measure(true, TIP), measure(true, NOSE, lines=LINES[::2])])
    assert found.frequency_hz.size == LINES[::2].size
    assert any("200 lines are left out" in note for note in found.notes)
    assert "joint" in repr(found)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.stiffness, found.stiffness)
    assert set(found.to_dict()["terms"]) == {"k_y", "k_theta"}
    figure = found.plot()
    assert len(figure.axes) == 5
    with pytest.raises(ValueError, match="read-only"):
        found.stiffness[0, 0, 0] = 1.0
