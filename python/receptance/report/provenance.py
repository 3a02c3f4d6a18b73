"""Source of a result: the campaign, and the versions of the software that computed it."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np


def versions() -> dict[str, str]:
    """Return the versions of the package, Python, NumPy and SciPy, and the instruction set of the core.

    Returns
    -------
    dict of str to str
        "receptance", "python", "numpy", "scipy" and "instruction_set".

    Examples
    --------
    >>> from receptance.report import versions
    >>> sorted(versions())
    ['instruction_set', 'numpy', 'python', 'receptance', 'scipy']
    """
    from receptance import _core

    return {
        "receptance": _version("receptance"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": _version("scipy"),
        "instruction_set": _core.instruction_set(),
    }


def _version(package: str) -> str:
    from importlib import metadata  # slow to import

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed as a package"


_versions_once = cache(versions)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Source of a result.

    Attributes
    ----------
    title, description, file : str
        Title, description and file name of the campaign; empty without a campaign.
    settings : dict
        Settings of the campaign that the result depends on; empty without a campaign.
    seed : int or None
        Seed of all random numbers; None if none were drawn.
    versions : dict of str to str
        Versions of the software.
    """

    title: str = ""
    description: str = field(default="", repr=False)
    file: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=_versions_once, repr=False)

    def sentence(self) -> str:
        """Return seed and versions as a line of text."""
        seed = "" if self.seed is None else f"seed {self.seed}; "
        return seed + ", ".join(f"{name} {value}" for name, value in self.versions.items())
