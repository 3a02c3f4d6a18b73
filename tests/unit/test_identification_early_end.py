"""Records that end while the structure still rings: the operator, its derivatives, how the end is seen, the cause."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, MeasuredFRF, Part, PointJoint, Segment, Unknown
from receptance.diagnosis import diagnose
from receptance.diagnosis.measurement_causes import truncation_time
from receptance.identification import Tolerance
from receptance.identification.early_end import EarlyEnd
from receptance.identification.factors import END
from receptance.identification.mapping import Parameters
from receptance.identification.task import Task, place_of

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


def assembled(overhang: float) -> Assembly:
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
    # What is before zero comes last.
    times[times > 0.5 * long] -= long
    kept = (times > -0.01) & (times < end)
    waves = np.exp(-2j * np.pi * LINES[:, None] * times[kept])
    return (waves @ signal[kept]) * (long / size) / (2j * np.pi * LINES) ** 2


def measured(overhang: float, seed: int) -> MeasuredFRF:
    rng = np.random.default_rng(seed)
    noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    return MeasuredFRF(
        assembly=assembled(overhang),
        frequency_hz=LINES,
        receptance=cut_off(assembled(overhang)) * np.exp(noise),
        standard_deviation=0.01,
        label=f"{overhang}",
    )


@pytest.fixture(scope="module")
def records() -> list[MeasuredFRF]:
    return [measured(overhang, i) for i, overhang in enumerate((0.06, 0.075, 0.09))]


def test_a_record_that_is_cut_off_is_what_the_operator_says() -> None:
    assembly = assembled(0.09)
    operator = EarlyEnd(LINES, 1.2 * END_AT)
    found = operator.seen(assembly.receptance(operator.lines_hz), END_AT)
    reference = cut_off(assembly)
    # It matters, and both agree on it; a late end changes nothing.
    assert np.max(np.abs(np.log(assembly.receptance(LINES) / reference))) > 0.1
    np.testing.assert_allclose(np.log(found / reference), 0.0, atol=5e-3)
    late = EarlyEnd(LINES, 0.5)
    np.testing.assert_allclose(
        late.seen(assembly.receptance(late.lines_hz), 0.45), assembly.receptance(LINES), rtol=2e-3
    )


def test_derivatives_of_what_a_cut_off_record_shows() -> None:
    one = MeasuredFRF(
        assembly=assembled(0.09),
        frequency_hz=LINES,
        receptance=assembled(0.09).receptance(LINES),
        standard_deviation=0.01,
        ends=END_AT,
    )
    unknowns = [
        *JOINT,
        Unknown(address=END, lower=0.06, upper=0.08, start=END_AT, scale="linear"),
        Unknown(address="observation.log_gain", lower=-1.0, upper=1.0, start=0.1, scale="linear"),
    ]
    parameters = Parameters(unknowns, (), [place_of(one, 0)])
    problem = Task((one,), parameters, ("standard deviations",)).problem()
    x = problem.variables.start
    slopes = problem.jacobian(x).copy()
    for column, step in enumerate((1e-5, 1e-5, 1e-5, 1e-5, 1e-8, 1e-5)):
        e = np.zeros(x.size)
        e[column] = step
        difference = (problem.value(x + e) - problem.value(x - e)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, column], difference, atol=1e-5 * np.abs(slopes[:, column]).max())


def test_the_end_is_seen_and_named(records: list[MeasuredFRF]) -> None:
    end = truncation_time(records)
    assert end == pytest.approx(END_AT, abs=1.5e-3)
    tolerance = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)
    verdict = diagnose(
        records, JOINT, tolerances=[tolerance], causes=["coarse_resolution", "exponential_window"], most=1
    )
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["coarse_resolution"])
    (parameter,) = verdict.causes[0].parameters.values()
    assert parameter[0] == pytest.approx(END_AT, abs=2e-4)
    found, _ = verdict.predict_natural_frequencies(assembled(0.08), 5000.0)
    np.testing.assert_allclose(found, assembled(0.08).natural_frequencies(5000.0), rtol=2e-3)


def test_a_response_that_dies_away_has_no_early_end() -> None:
    lines = np.arange(100, 2500) / 0.5
    one = MeasuredFRF(assembly=assembled(0.09), frequency_hz=lines, receptance=assembled(0.09).receptance(lines))
    assert truncation_time([one]) is None


def test_bad_ends_are_told() -> None:
    given = {"assembly": assembled(0.09), "frequency_hz": LINES, "receptance": assembled(0.09).receptance(LINES)}
    with pytest.raises(ValueError, match="ends"):
        MeasuredFRF(**given, ends=-1.0)
    with pytest.raises(ValueError, match="stepped sine"):
        MeasuredFRF(**given, ends=0.1, force=1.0)
