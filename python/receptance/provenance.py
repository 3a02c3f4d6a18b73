"""Versions of the software that computed a result."""

from __future__ import annotations

import platform
from importlib import metadata

import numpy as np

__all__ = ["versions"]


def versions() -> dict[str, str]:
    """Return the versions of the package, Python, NumPy and SciPy, and the instruction set of the core.

    Returns
    -------
    dict of str to str
        "receptance", "python", "numpy", "scipy" and "instruction_set".

    Examples
    --------
    >>> from receptance.provenance import versions
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
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed as a package"
