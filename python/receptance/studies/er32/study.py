"""The study from the tables to the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from receptance import _checks
from receptance.provenance import versions
from receptance.studies.er32.bias import ChanceModel, LongToolBias, find_bias, propagate
from receptance.studies.er32.chance import Cause, Simulation, rank_causes, simulate_chance
from receptance.studies.er32.determination import (
    Consistency,
    Disagreement,
    check_inference,
    find_disagreements,
    overhang_scatter,
)
from receptance.studies.er32.holder import HolderModel, load_holder
from receptance.studies.er32.joints import IdentifiedJoint, Resolution, identify_joints
from receptance.studies.er32.tables import Published, load
from receptance.studies.er32.transfer import SetVerdict, TransferRow, judge_sets, predict_transfers, rms
from receptance.studies.er32.trends import Trends, find_trends

__all__ = ["ER32Settings", "ER32Study", "run"]


@dataclass(frozen=True, kw_only=True)
class ER32Settings:
    """What the study takes as given.

    Parameters
    ----------
    resolution : Resolution
        How finely the frequencies are printed. The paper does not state its frequency resolution; its tables look
        rounded to 1 Hz, and to 10 Hz from 10 kHz on.
    chance : ChanceModel
        What chance means for the bias of the long tools.
    starts : int
        Starts of every identification.
    draws : int
        Draws of the simulation of chance.
    seed : int
        Of the starts and of the simulation.
    betrayal : float
        A mode betrays a parameter set when its error is this many times the rms error of the transfers.
    """

    resolution: Resolution = field(default_factory=Resolution)
    chance: ChanceModel = field(default_factory=ChanceModel)
    starts: int = 4
    draws: int = 300
    seed: int = 0
    betrayal: float = 3.0

    def __post_init__(self) -> None:
        for name in ("fine_hz", "coarse_hz", "change_hz"):
            _checks.positive("resolution", name, getattr(self.resolution, name), unit="Hz")
        for name in self.chance.__dataclass_fields__:
            _checks.not_negative("chance", name, getattr(self.chance, name))
        _checks.positive("settings", "betrayal", self.betrayal)
        for name, least in (("starts", 1), ("draws", 1), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ValueError(f"{name} is {value!r}, expected a whole number of at least {least}")


@dataclass(frozen=True)
class ER32Study:
    """Everything that the study found."""

    settings: ER32Settings
    published: Published
    model: HolderModel
    versions: dict[str, str]
    consistency: Consistency
    identified: tuple[IdentifiedJoint, ...]
    published_predictions: tuple[TransferRow, ...]
    transfers: tuple[TransferRow, ...]
    parameter_sets: tuple[SetVerdict, ...]
    trends: Trends
    bias: LongToolBias
    simulation: Simulation
    causes: tuple[Cause, ...]
    disagreements: tuple[Disagreement, ...]
    overhang_scatter_mm: float

    @property
    def published_predictions_rms_percent(self) -> float:
        """Our model with the paper's stiffnesses against the paper's predictions."""
        return rms([row.against_published_percent for row in self.published_predictions])

    @property
    def transfer_rms_percent(self) -> float:
        """Our predictions against the measurements."""
        return rms([row.error_percent for row in self.transfers])

    @property
    def published_transfer_rms_percent(self) -> float:
        """The paper's predictions against the measurements."""
        return rms([row.published_error_percent for row in self.transfers])


def run(settings: ER32Settings | None = None, *, progress: Callable[[str], None] | None = None) -> ER32Study:
    """Do the study of the ER32 collet holder (Matthias et al. 2016).

    Parameters
    ----------
    settings : ER32Settings, optional
        What is taken as given.
    progress : callable, optional
        Is told in words what is being done.

    Returns
    -------
    ER32Study
        All results; `receptance.studies.er32.as_dict` turns them into what JSON holds.

    Raises
    ------
    ValueError, TypeError
        Settings without meaning.
    """
    chosen = settings or ER32Settings()
    say = progress or (lambda _: None)
    published, model = load(), load_holder()
    torque = published.recommended_torque_nm
    say("checking the inferred holder")
    consistency = check_inference(model, published)
    say("identifying the joints")
    joints = identify_joints(model, published, chosen.resolution, starts=chosen.starts, seed=chosen.seed)
    say("predicting other overhangs")
    theirs = predict_transfers(model, published, {s.diameter_mm: (s.k_y, s.k_theta) for s in published.machine})
    ours = {j.diameter_mm: (j.k_y, j.k_theta) for j in joints if j.torque_nm == torque}
    transfers = predict_transfers(model, published, ours)
    threshold = chosen.betrayal * rms([row.error_percent for row in transfers])
    sets = judge_sets(model, published, threshold)
    trends = find_trends(joints, torque)
    say("asking what chance would give")
    longest = {long.diameter_mm: long.overhang_mm for long in published.long_tools}
    first = {
        row.diameter_mm: row.predicted_hz
        for row in transfers
        if row.mode == 1 and row.overhang_mm == longest[row.diameter_mm]
    }
    slopes = propagate(model, published, joints, torque)
    bias = find_bias(published, first, slopes, chosen.chance, chosen.resolution, consistency, torque)
    simulation = simulate_chance(
        model,
        published,
        joints,
        bias,
        chosen.chance,
        chosen.resolution,
        torque_nm=torque,
        draws=chosen.draws,
        seed=chosen.seed,
    )
    return ER32Study(
        settings=chosen,
        published=published,
        model=model,
        versions=versions(),
        consistency=consistency,
        identified=joints,
        published_predictions=theirs,
        transfers=transfers,
        parameter_sets=sets,
        trends=trends,
        bias=bias,
        simulation=simulation,
        causes=rank_causes(model, published, joints, bias, slopes, chosen.chance, torque_nm=torque),
        disagreements=find_disagreements(model, published, joints),
        overhang_scatter_mm=overhang_scatter(published),
    )
