"""Records that end while the structure still rings: operator, derivatives, detection of the end, cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scipy_fits
from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis import CATALOGUE, Model, diagnose
from receptance.diagnosis.truncation import ALL_RECORDS, record_ends
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.fit.parameters import END, Parameters
from receptance.fit.problem import Problem, Task, Unit

RECORD = 0.08
END_AT = 5039.5 / 72e3
"""Between two samples of the brute force, so that its sum ends there."""
LINES = np.arange(16, 400) / RECORD
JOINT = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=6e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6, start=200.0),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3, start=0.7),
]


def make_assembly(overhang: float) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_y=200.0, c_theta=0.7, name="joint"), holder])


def cut_off(assembly: Assembly, end: float = END_AT) -> np.ndarray:
    """Return the same by brute force: a long record in time, cut off, and transformed at the lines."""
    long, top = 4.0, 9000.0
    fine = np.arange(1, int(top * long)) / long
    fading = 0.5 + 0.5 * np.cos(np.pi * np.clip((fine - 5500.0) / (top - 5500.0), 0.0, 1.0))
    accelerance = np.concatenate([[0.0], assembly.receptance(fine) * (2j * np.pi * fine) ** 2 * fading, [0.0]])
    accelerance[0] = accelerance[1].real
    size = 8 * (accelerance.size - 1)
    times = np.arange(size) * long / size
    signal = np.fft.irfft(accelerance, size) * size / long
    # Negative times come last.
    times[times > 0.5 * long] -= long
    kept = (times > -0.01) & (times < end)
    waves = np.exp(-2j * np.pi * LINES[:, None] * times[kept])
    return (waves @ signal[kept]) * (long / size) / (2j * np.pi * LINES) ** 2


def measure(overhang: float, seed: int) -> Observation:
    rng = np.random.default_rng(seed)
    noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    return Observation(
        assembly=make_assembly(overhang),
        frequency_hz=LINES,
        receptance=cut_off(make_assembly(overhang)) * np.exp(noise),
        standard_deviation=0.01,
        label=f"{overhang}",
    )


@pytest.fixture(scope="module")
def records() -> list[Observation]:
    return [measure(overhang, i) for i, overhang in enumerate((0.06, 0.075, 0.09))]


def logarithms(observation: Observation, *more: Unknown) -> Problem:
    parameters = Parameters([*JOINT, *more], (), [observation.site(0)])
    return Task((observation,), parameters, ("logarithm",), threads=1).problem()


def test_truncated_record_equals_the_truncated_time_signal() -> None:
    assembly = make_assembly(0.09)
    reference = cut_off(assembly)
    # It is significant, and both agree on it; a late end has no effect.
    assert np.max(np.abs(np.log(assembly.receptance(LINES) / reference))) > 0.1
    for ends, values, tolerance in ((END_AT, reference, 5e-3), (0.45, assembly.receptance(LINES), 2e-3)):
        one = Observation(assembly=assembly, frequency_hz=LINES, receptance=values, ends=ends)
        problem = logarithms(one)
        np.testing.assert_allclose(problem.residual(problem.variables.start), 0.0, atol=tolerance)


FACTORS = [
    Unknown(address=END, lower=0.06, upper=0.08, start=END_AT, scale="linear"),
    Unknown(address="observation.log_gain", lower=-1.0, upper=1.0, start=0.1, scale="linear"),
    Unknown(address="observation.delay", lower=-1e-4, upper=1e-4, start=1e-6, scale="linear"),
    Unknown(address="observation.decay_rate", lower=0.0, upper=100.0, start=10.0, scale="linear"),
]


@pytest.mark.parametrize("lines", [LINES, LINES - 2j])
@pytest.mark.parametrize("unit", ["standard deviations", "percent"])
def test_residuals_of_truncated_records_are_those_of_the_plain_sum(lines: np.ndarray, unit: Unit) -> None:
    one = Observation(
        assembly=make_assembly(0.09),
        frequency_hz=lines,
        receptance=make_assembly(0.088).receptance(lines),
        standard_deviation=0.01,
        ends=END_AT,
    )
    tolerance = Tolerance(name="steel", moves={"holder.segment[*].density": 0.01}, relative=True)
    for factors in ([], FACTORS):
        parameters = Parameters([*JOINT, *factors], (tolerance,), [one.site(0)])
        task = Task((one,), parameters, (unit,), threads=1)
        problem, x = task.problem(), task.variables.start
        residual, jacobian = scipy_fits.residual_and_jacobian(task, x)
        # Magnitudes have no derivative by a delay.
        scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1.0)
        assert problem.residual(x) == pytest.approx(residual, rel=1e-9, abs=1e-8)
        assert problem.jacobian(x) / scale == pytest.approx(jacobian / scale, rel=1e-7, abs=1e-8)
        assert np.isfinite(problem.core.thinned(40).normal_matrix(x)).all()
        normal = problem.core.normal_matrix(x)
        assert normal[:-1, :-1] / np.outer(scale, scale) == pytest.approx(
            jacobian.T @ jacobian / np.outer(scale, scale), abs=1e-8
        )


def test_early_end_is_detected_and_named(records: list[Observation]) -> None:
    end = record_ends(records)[ALL_RECORDS]
    print(f"{1e3 * (end - END_AT):+.3f} ms")
    # A start that is late may end in another optimum.
    assert -4e-4 < end - END_AT <= 0.0
    tolerance = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)
    verdict = diagnose(
        records, JOINT, tolerances=[tolerance], causes=["coarse_resolution", "exponential_window"], max_causes=1
    )
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["coarse_resolution"])
    (parameter,) = verdict.causes[0].parameters.values()
    assert parameter[0] == pytest.approx(END_AT, abs=2e-4)
    predicted = verdict.at(make_assembly(0.08)).natural_frequencies(5000.0)
    found = predicted.predicted_hz
    np.testing.assert_allclose(found, make_assembly(0.08).natural_frequencies(5000.0), rtol=2e-3)


def test_early_end_is_kept_where_lines_are_left_out(records: list[Observation]) -> None:
    """A third of the lines does not show it."""
    model = Model(tuple(records), tuple(JOINT), threads=1).with_witnesses()
    few = replace(model, observations=tuple(one.select(np.arange(0, LINES.size, 3)) for one in records))
    assert ALL_RECORDS not in record_ends(few.receptances)
    assert few.ends == model.ends == record_ends(records)
    assert CATALOGUE["coarse_resolution"].variants(few)[0].name == "records end too early"


def test_stepped_sines_have_no_early_end(records: list[Observation]) -> None:
    stepped = [altered(one, ends=None, force=np.ones(LINES.size), label="stepped") for one in records[:1]]
    assert not record_ends(stepped)
    for lines in (1, 10):
        narrow = stepped[0].select(np.arange(LINES.size) < lines)
        assert record_ends([*records, narrow])[ALL_RECORDS] == record_ends(records)[ALL_RECORDS]
    model = Model((*records[1:], *stepped), tuple(JOINT), threads=1).with_witnesses()
    (_, extended), *_ = CATALOGUE["coarse_resolution"].extensions(model)
    assert [one.ends is None for one in extended.receptances] == [False] * (len(records) - 1) + [True]


def test_decayed_response_has_no_early_end() -> None:
    lines = np.arange(100, 2500) / 0.5
    one = Observation(
        assembly=make_assembly(0.09), frequency_hz=lines, receptance=make_assembly(0.09).receptance(lines)
    )
    assert not record_ends([one])


def test_noise_of_one_record_is_rarely_an_early_end(records: list[Observation]) -> None:
    lines = np.arange(64, 800) / 0.16
    assembly = make_assembly(0.09)
    receptance = assembly.receptance(lines)
    ends = []
    for seed in range(100):
        rng = np.random.default_rng([7, seed])
        noise = 0.02 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        ends.append(
            record_ends([Observation(assembly=assembly, frequency_hz=lines, receptance=receptance * np.exp(noise))])
        )
    print(f"{sum(map(bool, ends))} of {len(ends)} have an early end by chance")
    assert sum(map(bool, ends)) <= 25
    # A record that rings up to an early end shows it by itself.
    assert record_ends(records[-1:])[ALL_RECORDS] == pytest.approx(END_AT, abs=4e-4)


def test_invalid_ends_are_errors() -> None:
    given = {
        "assembly": make_assembly(0.09),
        "frequency_hz": LINES,
        "receptance": make_assembly(0.09).receptance(LINES),
    }
    with pytest.raises(ValueError, match="ends"):
        Observation(**given, ends=-1.0)
    with pytest.raises(ValueError, match="stepped sine"):
        Observation(**given, ends=0.1, force=1.0)
