"""Plain NumPy and SciPy references that the Rust core is timed against."""

from .chain import BothEndsSeries, TipSeries
from .identification import Fit, LogResidual, identify
from .joint import Joint, Substructures, tip_receptance
from .joint_sweep import JointSweep
from .natural import natural_frequencies
from .riccati import TransferChain, chain_tip_receptance, tip_by_stiffness
from .segment import segment_receptance
from .series import Series

__all__ = [
    "BothEndsSeries",
    "Fit",
    "Joint",
    "JointSweep",
    "LogResidual",
    "Series",
    "Substructures",
    "TipSeries",
    "TransferChain",
    "chain_tip_receptance",
    "identify",
    "natural_frequencies",
    "segment_receptance",
    "tip_by_stiffness",
    "tip_receptance",
]
