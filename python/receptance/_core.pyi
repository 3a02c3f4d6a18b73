"""The compiled core: handles that are built and checked once, arrays in, arrays out.

Use `receptance.Assembly` and `receptance.Part` instead. Tables are C-contiguous float64, one row an element, nodes as
whole numbers:

segments (n, 23), or (n, 14) if all are circular cylinders: node a, node b (x larger), length, outer diameter, inner
    diameter, youngs_modulus, density, poisson_ratio, loss_factor, the same four of the core (density 0: none), shear
    model (0 Cowper, 1 Hutchinson), outer and inner diameter at node b (0: a cylinder), area, second moment of area of
    the stiffness, that of the rotary inertia, and torsion constant over those of the circle (0: a circle or ring), and
    a, b, c of the reciprocal shear coefficient a + b s + c s^2, s = nu / (1 + nu);
joints (n, 2 + p): node a, node b, then the p parameters of a `PointJoint` in the order of its fields;
masses (n, 3): node, mass, inertia;
grounds (n, 1 + p): node, then as a joint;
overlaps (n, 32): node where the shank goes on, node where the sleeve does (x larger), length, the shank's section as in
    a segment from the outer diameter to the shear model (11), the sleeve's, k_y, k_theta, c_y, c_theta, loss_factor and
    slope of the whole layer, number of points (0: a layer); bending only.

terminals (n, 4), by `Model.with_terminals`: node, and the constant part of y/F, theta/M and y/M;
modes (m, 7), with them: row of the terminal, natural frequency in rad/s, damping ratio, y, theta, y_imaginary,
    theta_imaginary;
slips (n, 7), by `Model.with_slips`: row of the joint, slip_y, slip_theta, exponent, level, reference_y,
    reference_theta.

For axial motion and torsion a node has one degree of freedom; then k_y, c_y, loss_factor and the first inertia column
act along it. Coordinates are rows of node and direction (0 y or force, 1 theta or moment); `points` are two of them,
response and excitation. Parameters are rows of table (0 segments, 1 joints, 2 masses, 3 grounds, 4 overlaps, 5
terminals, 6 modes, 7 slips), row and column.
"""

from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ByLine",
    "Ends",
    "GrossSlipError",
    "Halt",
    "JointReduction",
    "Lines",
    "Model",
    "ModelSweep",
    "Problem",
    "ReceptanceError",
    "Records",
    "ResonanceError",
    "SingularInterfaceError",
    "TiedModel",
    "instruction_set",
    "joint_stiffness",
    "modal_receptance",
]

class ReceptanceError(Exception): ...
class GrossSlipError(ReceptanceError): ...
class SingularInterfaceError(ReceptanceError): ...
class ResonanceError(ReceptanceError): ...

@final
class Halt:
    def __new__(cls) -> Halt: ...
    def join(self) -> None: ...
    def set(self) -> None: ...

def instruction_set() -> str: ...
def joint_stiffness(joint: NDArray[np.float64], lines: Lines) -> NDArray[np.complex128]: ...
def modal_receptance(lines: Lines, modes: NDArray[np.float64]) -> NDArray[np.complex128]: ...

@final
class Lines:
    def __new__(cls, angular_frequency: NDArray[Any], scale: float = 1.0) -> Lines: ...
    def __len__(self) -> int: ...

@final
class ByLine:
    def __new__(
        cls,
        beyond: NDArray[np.complex128] | None = None,
        force: NDArray[np.float64] | None = None,
    ) -> ByLine: ...

@final
class Model:
    def __new__(
        cls,
        motion: int,
        segments: NDArray[np.float64],
        joints: NDArray[np.float64],
        masses: NDArray[np.float64],
        grounds: NDArray[np.float64],
        overlaps: NDArray[np.float64] | None = None,
    ) -> Model: ...
    def with_terminals(self, terminals: NDArray[np.float64], modes: NDArray[np.float64]) -> Model: ...
    def with_slips(self, slips: NDArray[np.float64]) -> Model: ...
    def receptance(
        self,
        lines: Lines,
        excitations: NDArray[np.float64],
        responses: NDArray[np.float64],
        parameters: NDArray[np.float64],
        threads: int,
        by_line: ByLine | None = None,
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]: ...
    def natural_frequencies(
        self, upper: float | None, most: int, parameters: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def complex_frequencies(
        self, undamped: NDArray[np.float64], parameters: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]: ...
    def poles(
        self, starts: NDArray[np.complex128], radii: tuple[float, float], angles: tuple[float, float]
    ) -> tuple[NDArray[np.complex128], int]: ...
    def reduced_to_joint(
        self,
        joint: int,
        lines: Lines,
        points: NDArray[np.float64],
        threads: int,
        by_line: ByLine | None = None,
        planes: bool = False,
    ) -> JointReduction: ...
    def tied(
        self,
        rates: NDArray[np.float64],
        present: NDArray[np.float64],
        addresses: NDArray[np.float64],
        factors: NDArray[np.float64] | None = None,
    ) -> TiedModel: ...

@final
class JointReduction:
    def __len__(self) -> int: ...
    def planes(self) -> NDArray[np.float64] | None: ...
    def fill(
        self, joints: NDArray[np.float64], out: NDArray[np.float64] | NDArray[np.complex128], threads: int
    ) -> None: ...
    def misfit(
        self,
        joints: NDArray[np.float64],
        measured: NDArray[np.complex128],
        weights: NDArray[np.float64],
        logarithmic: bool,
        threads: int,
    ) -> NDArray[np.float64]: ...

@final
class TiedModel:
    def sweep(self, lines: Lines, points: NDArray[np.float64], by_line: ByLine | None = None) -> ModelSweep: ...

@final
class ModelSweep:
    def __len__(self) -> int: ...
    def fill(
        self, values: NDArray[np.float64], out: NDArray[np.float64] | NDArray[np.complex128], threads: int
    ) -> None: ...
    def misfit(
        self,
        values: NDArray[np.float64],
        measured: NDArray[np.complex128],
        weights: NDArray[np.float64],
        logarithmic: bool,
        threads: int,
    ) -> NDArray[np.float64]: ...

@final
class Records:
    def __new__(
        cls,
        measured: NDArray[np.complex128],
        weights: NDArray[np.float64],
        percent: bool = False,
        end: float | None = None,
    ) -> Records: ...
    def evaluated(self, lines: Lines) -> NDArray[np.complex128]: ...

@final
class Problem:
    def __new__(
        cls,
        logarithmic: NDArray[np.bool_],
        bounds: NDArray[np.float64],
        priors: NDArray[np.float64],
        threads: int,
        smoothing: float | None = None,
    ) -> Problem: ...
    @property
    def lines(self) -> int: ...
    def add_receptance(
        self,
        model: TiedModel,
        lines: Lines,
        points: NDArray[np.float64],
        records: Records,
        by_line: ByLine | None = None,
    ) -> None: ...
    def add_frequencies(
        self,
        model: TiedModel,
        modes: NDArray[np.float64],
        measured: NDArray[np.float64],
        weights: NDArray[np.float64],
        damping_ratio: NDArray[np.float64] | None = None,
        damping_weights: NDArray[np.float64] | None = None,
    ) -> None: ...
    def add_joint_receptance(
        self,
        model: JointReduction,
        joint: NDArray[np.float64],
        variables: NDArray[np.float64],
        measured: NDArray[np.complex128],
        weights: NDArray[np.float64],
    ) -> None: ...
    def add_linear(self, matrix: NDArray[np.float64], centre: NDArray[np.float64]) -> None: ...
    def add_function(
        self,
        function: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]] | None],
    ) -> None: ...
    def reason(self, x: NDArray[np.float64]) -> tuple[int, str] | None: ...
    def thinned(self, lines: int) -> Problem: ...
    def normal_matrix(self, x: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def rows(
        self, x: NDArray[np.float64], free: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None: ...
    def fit(
        self,
        starts: NDArray[np.float64],
        free: NDArray[np.bool_],
        evaluations: NDArray[np.int64],
        tolerance: float,
        least: float = 0.0,
        of_all: bool = False,
    ) -> Ends: ...

@final
class Ends:
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def cost(self) -> NDArray[np.float64]: ...
    @property
    def first(self) -> NDArray[np.float64]: ...
    @property
    def evaluations(self) -> NDArray[np.int64]: ...
    @property
    def status(self) -> NDArray[np.int64]: ...
    @property
    def normal(self) -> NDArray[np.float64]: ...
