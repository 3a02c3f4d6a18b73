"""What a result needs to be made again."""

from __future__ import annotations

import platform
from importlib import metadata

import numpy as np

__all__ = ["versions"]


def versions() -> dict[str, str]:
    """Versions of the package and of what its numbers come from."""
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
