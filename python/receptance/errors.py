"""Exceptions and warnings of the library."""

from receptance._core import ReceptanceError, ResonanceError, SingularInterfaceError

__all__ = ["GrossSlipError", "ReceptanceError", "ReceptanceWarning", "ResonanceError", "SingularInterfaceError"]


class GrossSlipError(ReceptanceError):
    """A joint of which the whole interface slides under the given force: nothing describes what follows."""


class ReceptanceWarning(UserWarning):
    """What a person should know without the work being stopped."""
