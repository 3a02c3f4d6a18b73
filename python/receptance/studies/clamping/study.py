"""The seed's clamping studies, as virtual studies where the paper gives figures and as fits where it gives tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from receptance.provenance import versions
from receptance.studies.clamping.claims import CLAIMS, Claim
from receptance.studies.clamping.damping import DampingStudy, study_damping
from receptance.studies.clamping.insertion import InsertionStudy, study_insertion
from receptance.studies.clamping.material import MaterialStudy, study_material
from receptance.studies.clamping.trends import FittedLaw, TorqueVerdict, fit_diameter, fit_torque
from receptance.studies.er32.holder import load_holder
from receptance.studies.er32.joints import Resolution, identify_joints
from receptance.studies.er32.tables import load
from receptance.studies.er32.trends import Trends, find_trends
from receptance.studies.table3.machine import Measuring, VirtualMachine

__all__ = ["ClampingSettings", "ClampingStudy", "run"]


@dataclass(frozen=True, kw_only=True)
class ClampingSettings:
    """What the studies take as given.

    Parameters
    ----------
    measuring : Measuring
        Noise of the simulated tests.
    resolution : Resolution
        How finely the published frequencies are printed.
    ratios : tuple of float
        k2 / k1 of the springs in series at the full insertion; the first, where k1 is as good as rigid, is a control.
    seed : int
        Of errors and noise.
    """

    measuring: Measuring = field(default_factory=Measuring)
    resolution: Resolution = field(default_factory=Resolution)
    ratios: tuple[float, ...] = (0.001, 1.0, 5.0, 25.0)
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.ratios or any(not ratio > 0.0 for ratio in self.ratios):
            raise ValueError(f"ratios is {self.ratios!r}, expected numbers above zero")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}, expected zero or more")
        if not (self.resolution.fine_hz > 0.0 and self.resolution.coarse_hz > 0.0):
            raise ValueError(f"resolution is {self.resolution!r}, expected steps above zero")


@dataclass(frozen=True, kw_only=True)
class ClampingStudy:
    """Everything that was found. `insertion`, `material` and `damping` are virtual; torque and diameter are published.

    Attributes
    ----------
    claims : tuple of Claim
        What the paper claims in figures or words, quoted.
    insertion : InsertionStudy
        Two springs in series.
    material : MaterialStudy
        High-speed steel against carbide.
    damping : DampingStudy
        With and without damping at the interface.
    trends : Trends
        As in the ER32 study: what the resolution alone leaves open.
    torque : tuple of TorqueVerdict
        By tool.
    diameter : tuple of FittedLaw
        Of k_y and k_theta.
    """

    settings: ClampingSettings
    claims: tuple[Claim, ...]
    insertion: InsertionStudy
    material: MaterialStudy
    damping: DampingStudy
    trends: Trends
    torque: tuple[TorqueVerdict, ...]
    diameter: tuple[FittedLaw, ...]
    versions: dict[str, str]


def run(settings: ClampingSettings | None = None, *, progress: Callable[[str], None] | None = None) -> ClampingStudy:
    """Do the clamping studies.

    Parameters
    ----------
    settings : ClampingSettings, optional
        What is taken as given.
    progress : callable, optional
        Is told in words what is being done.

    Raises
    ------
    ValueError
        Settings without meaning.
    """
    chosen = settings or ClampingSettings()
    say = progress or (lambda _: None)
    published, holder = load(), load_holder()
    noise = chosen.measuring.noise
    insertion = study_insertion(holder, published, ratios=chosen.ratios, noise=noise, seed=chosen.seed, say=say)
    material = study_material(holder, published, say=say)
    damping = study_damping(VirtualMachine.load(chosen.measuring), say=say)
    say("identifying the published joints")
    joints = identify_joints(holder, published, chosen.resolution, starts=1, seed=chosen.seed)
    trends = find_trends(joints, published.recommended_torque_nm)
    return ClampingStudy(
        settings=chosen,
        claims=CLAIMS,
        insertion=insertion,
        material=material,
        damping=damping,
        trends=trends,
        torque=fit_torque(holder, published, joints, trends, chosen.resolution, say=say),
        diameter=fit_diameter(holder, published, joints, chosen.resolution, say=say),
        versions=versions(),
    )
