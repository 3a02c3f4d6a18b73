"""Exceptions and warnings of the library."""

import sys
import warnings

from receptance._core import GrossSlipError, ReceptanceError, ResonanceError, SingularInterfaceError

__all__ = [
    "GrossSlipError",
    "MissingExtraError",
    "ReceptanceError",
    "ReceptanceWarning",
    "ResonanceError",
    "SingularInterfaceError",
    "warn_user",
]


class MissingExtraError(ReceptanceError, ImportError):
    """A package of an optional part is not installed; the message names the command that installs it."""


class ReceptanceWarning(UserWarning):
    """Note for the user on data or results that are usable but doubtful."""


def warn_user(text: str) -> None:
    """Issue a ReceptanceWarning at the first frame outside of the library."""
    level, frame = 1, sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] == "receptance":
        level, frame = level + 1, frame.f_back  # type: ignore[assignment]
    warnings.warn(text, ReceptanceWarning, stacklevel=level + 1)
