"""The compiled core: arrays in, arrays out. Use `receptance.Assembly` and `receptance.Part` instead.

Tables are C-contiguous float64, one row an element, nodes as whole numbers:
segments (n, 14): node a, node b (x larger), length, outer diameter, inner diameter, youngs_modulus, density,
    poisson_ratio, loss_factor, the same four of the core (density 0: none), shear model (0 Cowper, 1 Hutchinson);
joints (n, 9): node a, node b, k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss_factor;
masses (n, 3): node, mass, inertia; grounds (n, 8): node, then as a joint.
overlaps (n, 31), optional: node where the shank goes on, node where the sleeve does (x larger), length, the shank's
    section as in a segment from the outer diameter to the shear model (11), the sleeve's, k_y, k_theta, c_y, c_theta,
    loss_factor of the whole layer, number of points (0: a layer). Motion 0 only.
For motion 1 (axial) and 2 (torsion) a node has one degree of freedom; then k_y, c_y, loss_factor and the first
inertia column act along it.
excitations, responses (n, 2): node, direction (0 y or force, 1 theta or moment).
angular_frequency (n): real or complex; where there is a `scale`, what the lines are multiplied with to be in rad/s.
added (n_freq * n_joints * 2), optional: complex stiffness in y and theta besides that of the columns.
Whole models: receptances are (lines, measured, weights, points (2, 2), ties), frequencies (modes from 0 on, measured,
    weights, ties), in rad/s; ties are ((segments, joints, masses, grounds, overlaps), rates, addresses, factors,
    powers): rates (k, 5) table, row, column, address, and the rate that its value is added at; addresses (m, 2 + 2 p)
    the unknown's number i, a, E, S of v = a u_i exp(E u) + S u, or -1 of v = a exp(E u) + S u; factors (n, 2) which one
    of the measurement, address; powers (n, 4) table, row, column and power of the frequency. Priors (k, 3): variable x,
    scale, offset of scale x - offset.
Sweeps: joints (m, 7) are columns of a joint from k_y on, values (m, p) are of addresses; out (m, n_freq) is complex for
    receptances and real for their magnitudes.
parameters (n, 3): table (0 segments, 1 joints, 2 masses, 3 grounds, 4 overlaps, 5 beyond terminals), row, column.
terminals (k,), optional: nodes at which the structure goes on; beyond (n_freq * k * 3): the receptance of what is
    beyond each, y over force, theta over moment and y over moment; as a parameter these are the columns 0 to 2.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ReceptanceError",
    "ResonanceError",
    "SingularInterfaceError",
    "fit_joint",
    "fit_models",
    "instruction_set",
    "joint_normal_matrix",
    "joint_residual",
    "log_determinant",
    "models_normal_matrix",
    "models_rows",
    "natural_frequencies",
    "receptance",
    "reduce_joint",
    "sweep_joint",
    "sweep_joint_misfit",
    "sweep_models",
    "sweep_models_misfit",
]

_Lines = NDArray[np.float64] | NDArray[np.complex128]

class ReceptanceError(Exception): ...
class SingularInterfaceError(ReceptanceError): ...
class ResonanceError(ReceptanceError): ...

def receptance(
    angular_frequency: _Lines,
    motion: int,
    segments: NDArray[np.float64],
    joints: NDArray[np.float64],
    masses: NDArray[np.float64],
    grounds: NDArray[np.float64],
    excitations: NDArray[np.float64],
    responses: NDArray[np.float64],
    parameters: NDArray[np.float64],
    threads: int,
    overlaps: NDArray[np.float64] | None = None,
    scale: float = 1.0,
    added: NDArray[np.complex128] | None = None,
    terminals: NDArray[np.float64] | None = None,
    beyond: NDArray[np.complex128] | None = None,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]: ...
def log_determinant(
    angular_frequency: _Lines,
    motion: int,
    segments: NDArray[np.float64],
    joints: NDArray[np.float64],
    masses: NDArray[np.float64],
    grounds: NDArray[np.float64],
    overlaps: NDArray[np.float64] | None = None,
    added: NDArray[np.complex128] | None = None,
) -> NDArray[np.complex128]: ...
def natural_frequencies(
    upper: float,
    most: int,
    motion: int,
    segments: NDArray[np.float64],
    joints: NDArray[np.float64],
    masses: NDArray[np.float64],
    grounds: NDArray[np.float64],
    parameters: NDArray[np.float64],
    overlaps: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def reduce_joint(
    angular_frequency: _Lines,
    segments: NDArray[np.float64],
    joints: NDArray[np.float64],
    masses: NDArray[np.float64],
    grounds: NDArray[np.float64],
    joint: int,
    response: NDArray[np.float64],
    excitation: NDArray[np.float64],
    threads: int,
    overlaps: NDArray[np.float64] | None = None,
    scale: float = 1.0,
    terminals: NDArray[np.float64] | None = None,
    beyond: NDArray[np.complex128] | None = None,
) -> NDArray[np.float64]: ...
def joint_normal_matrix(
    reduction: NDArray[np.float64],
    angular_frequency: _Lines,
    measured: NDArray[np.complex128],
    weights: NDArray[np.float64],
    reference: NDArray[np.float64],
    joint: NDArray[np.float64],
    columns: NDArray[np.float64],
    slopes: NDArray[np.float64],
    threads: int,
) -> NDArray[np.float64]: ...
def joint_residual(
    reduction: NDArray[np.float64],
    angular_frequency: _Lines,
    measured: NDArray[np.complex128],
    weights: NDArray[np.float64],
    reference: NDArray[np.float64],
    joint: NDArray[np.float64],
    threads: int,
) -> NDArray[np.float64]: ...
def fit_joint(
    reductions: list[NDArray[np.float64]],
    angular_frequency: list[_Lines],
    measured: list[NDArray[np.complex128]],
    weights: list[NDArray[np.float64]],
    references: NDArray[np.float64],
    joints: NDArray[np.float64],
    variables: NDArray[np.float64],
    logarithmic: NDArray[np.bool_],
    bounds: NDArray[np.float64],
    starts: NDArray[np.float64],
    tolerance: float,
    evaluations: int,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]: ...
def models_normal_matrix(
    receptances: list[tuple[Any, ...]],
    frequencies: list[tuple[Any, ...]],
    priors: NDArray[np.float64],
    logarithmic: NDArray[np.bool_],
    bounds: NDArray[np.float64],
    variables: NDArray[np.float64],
    threads: int,
) -> NDArray[np.float64]: ...
def models_rows(
    receptances: list[tuple[Any, ...]],
    frequencies: list[tuple[Any, ...]],
    logarithmic: NDArray[np.bool_],
    bounds: NDArray[np.float64],
    free: NDArray[np.bool_],
    variables: NDArray[np.float64],
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None: ...
def fit_models(
    receptances: list[tuple[Any, ...]],
    frequencies: list[tuple[Any, ...]],
    priors: NDArray[np.float64],
    logarithmic: NDArray[np.bool_],
    bounds: NDArray[np.float64],
    free: NDArray[np.bool_],
    starts: NDArray[np.float64],
    tolerance: float,
    evaluations: int,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]: ...
def sweep_joint(
    reduction: NDArray[np.float64],
    angular_frequency: _Lines,
    reference: NDArray[np.float64],
    joints: NDArray[np.float64],
    out: NDArray[np.float64] | NDArray[np.complex128],
    threads: int,
) -> None: ...
def sweep_joint_misfit(
    reduction: NDArray[np.float64],
    angular_frequency: _Lines,
    reference: NDArray[np.float64],
    joints: NDArray[np.float64],
    measured: NDArray[np.complex128],
    weights: NDArray[np.float64],
    logarithmic: bool,
    threads: int,
) -> NDArray[np.float64]: ...
def sweep_models(
    ties: tuple[Any, ...],
    points: NDArray[np.float64],
    angular_frequency: _Lines,
    values: NDArray[np.float64],
    out: NDArray[np.float64] | NDArray[np.complex128],
    threads: int,
) -> None: ...
def sweep_models_misfit(
    ties: tuple[Any, ...],
    points: NDArray[np.float64],
    angular_frequency: _Lines,
    values: NDArray[np.float64],
    measured: NDArray[np.complex128],
    weights: NDArray[np.float64],
    logarithmic: bool,
    threads: int,
) -> NDArray[np.float64]: ...
def instruction_set() -> str: ...
