"""Exceptions and warnings of the library."""

from receptance._core import ReceptanceError, ResonanceError, SingularInterfaceError

__all__ = ["ReceptanceError", "ReceptanceWarning", "ResonanceError", "SingularInterfaceError"]


class ReceptanceWarning(UserWarning):
    """What a person should know without the work being stopped."""
