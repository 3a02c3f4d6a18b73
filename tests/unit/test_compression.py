"""Receptances compressed to blocks of lines: what is kept exactly, and how much information is lost."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis.fitting import Fit, evaluate
from receptance.diagnosis.model import Model
from receptance.fit.compression import Compression

LINES = np.linspace(300.0, 6000.0, 1200)
BLOCKS = 120
TRUE = {"joint.k_y": 5e8, "joint.k_theta": 9e4, "joint.c_y": 300.0, "joint.c_theta": 1.0}


def assembled(**changes: float) -> Assembly:
    tool = Part([Segment(length=0.07, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    values = {name.removeprefix("joint."): value for name, value in TRUE.items()} | changes
    return Assembly([tool, PointJoint(**values, name="joint"), holder])


def observed(curve: NDArray[np.complex128], deviation: float = 0.01) -> Observation:
    return Observation(assembly=assembled(), frequency_hz=LINES, receptance=curve, standard_deviation=deviation)


def residual(curve: NDArray[np.complex128], model: NDArray[np.complex128], deviation: float) -> NDArray[np.float64]:
    """Return the residual that the package defines: of the logarithm, in standard deviations."""
    ratio = np.log(np.abs(curve / model)), np.angle(curve / model)
    return np.concatenate(ratio) / deviation


def scattered(seed: int, deviation: float = 0.01) -> NDArray[np.complex128]:
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size)
    return np.asarray(assembled().receptance(LINES) * np.exp(deviation * noise))


@pytest.mark.parametrize("turn", [0.0, 3.0])
def test_the_increase_of_the_sum_of_squares_is_that_of_all_lines(turn: float) -> None:
    """At the curve of the compression the sum is exact; a change of level and phase adds what it adds on all lines."""
    curve = scattered(11) * np.exp(1j * turn)
    model = assembled().receptance(LINES)
    before = residual(curve, model, 0.01)
    compression = Compression.about([observed(curve)], [before], ["short"], BLOCKS)
    ((lines, values, deviations),) = (block for block in compression.blocks if block is not None)
    assert lines.size < 2 * BLOCKS

    def sums(change: complex) -> tuple[float, float]:
        other = model * np.exp(change)
        on_blocks = np.square(np.abs(np.log(values / other[lines])) / deviations)
        return float(np.sum(np.square(residual(curve, other, 0.01)))), float(np.sum(on_blocks)) + compression.scatter

    at_all, at_blocks = sums(0.0)
    assert at_blocks == pytest.approx(at_all, rel=1e-9)
    for change in (0.03, 0.02j, -0.2 + 0.1j):
        of_all, of_blocks = sums(change)
        assert of_blocks - at_blocks == pytest.approx(of_all - at_all, rel=0.01)


def test_records_of_one_configuration_on_the_same_lines_share_their_blocks() -> None:
    pair = [observed(scattered(12)), observed(0.5j * scattered(13))]
    model = assembled().receptance(LINES)
    parts = [residual(np.asarray(each.receptance), model, 0.01) for each in pair]
    blocks = Compression.about(pair, parts, ["short", "short"], BLOCKS).blocks
    assert blocks[0] is not None
    assert blocks[1] is not None
    np.testing.assert_array_equal(blocks[0][0], blocks[1][0])


def test_records_with_few_lines_and_natural_frequencies_are_not_compressed() -> None:
    few = observed(scattered(14)).select(np.arange(0, LINES.size, 10))
    frequencies = Observation(
        assembly=assembled(), frequency_hz=np.array([900.0, 2500.0]), standard_deviation=np.array([1.0, 3.0])
    )
    model = np.asarray(few.assembly.receptance(few.frequency_hz.real))
    parts = [residual(np.asarray(few.receptance), model, 0.01), np.zeros(2)]
    compression = Compression.about([few, frequencies], parts, ["short", "short"], BLOCKS)
    assert compression.blocks == (None, None)
    assert compression.of([few, frequencies]) == (few, frequencies)
    assert compression.scatter == 0.0


def test_blocks_keep_95_percent_of_the_information_on_the_joint() -> None:
    """The worst direction of all four parameters, at the joint and away from it."""
    unknowns = tuple(Unknown(address=name, lower=value / 100.0, upper=value * 100.0) for name, value in TRUE.items())
    model = Model((observed(scattered(15)),), unknowns, (), seed=0, threads=1)
    for factor in (1.0, 1.1):
        fit: Fit = evaluate(model, {name: factor * value for name, value in TRUE.items()})
        of_all = fit.problem.jacobian(fit.x)
        of_blocks = fit.compressed_problem.jacobian(fit.x)
        assert len(of_blocks) < 0.3 * len(of_all)
        root = np.linalg.cholesky(of_all.T @ of_all)
        shares = np.linalg.eigvalsh(np.linalg.solve(root, np.linalg.solve(root, of_blocks.T @ of_blocks).T))
        print(f"shares of the information {shares}")
        assert shares.min() > 0.95
        assert shares.max() < 1.0 + 1e-9
