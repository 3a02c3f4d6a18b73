"""Exceptions and warnings of the library."""

from receptance._core import GrossSlipError, ReceptanceError, ResonanceError, SingularInterfaceError

__all__ = ["GrossSlipError", "ReceptanceError", "ReceptanceWarning", "ResonanceError", "SingularInterfaceError"]


class ReceptanceWarning(UserWarning):
    """Note for the user on data or results that are usable but doubtful."""
