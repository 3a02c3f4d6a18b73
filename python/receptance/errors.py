"""Exceptions and warnings of the library, and the check for packages of optional parts."""

import importlib.util
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from receptance._core import GrossSlipError, ReceptanceError, ResonanceError, SingularInterfaceError

__all__ = [
    "GrossSlipError",
    "MissingExtraError",
    "ReceptanceError",
    "ReceptanceWarning",
    "ResonanceError",
    "SingularInterfaceError",
    "collected_warnings",
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


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect the texts of the warnings of the library, in place of showing them; the list is full at the end.

    Examples
    --------
    >>> from receptance.errors import collected_warnings, warn_user
    >>> with collected_warnings() as notes:
    ...     warn_user("a low coherence")
    >>> notes
    ['a low coherence']
    """
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ReceptanceWarning)
        yield notes
    notes += [str(warning.message) for warning in caught if issubclass(warning.category, ReceptanceWarning)]


EXTRAS = {
    "sweep": ("xarray", "zarr", "pandas"),
    "hdf5": ("h5py",),
    "sampling": ("emcee",),
    "dask": ("distributed",),
    "sections": ("sectionproperties", "shapely"),
    "drawing": ("ezdxf",),
    "app": ("bokeh", "tomlkit", "tornado"),
}
"""Modules of each extra of the package, as in `pip install 'receptance[sweep]'`."""


def require(extra: str, purpose: str, *modules: str) -> None:
    """Raise a MissingExtraError if a package of an extra is not installed; nothing is imported.

    The extra is a key of `EXTRAS`, of which `modules` are needed, by default all. `purpose` is the beginning of the
    message, which names the missing packages and the command that installs them.

    Examples
    --------
    >>> from receptance.errors import require
    >>> require("hdf5", "an HDF5 file")
    """
    missing = [name for name in modules or EXTRAS[extra] if importlib.util.find_spec(name) is None]
    if missing:
        names = " and ".join(name.replace("_", "-") for name in missing)
        raise MissingExtraError(f"{purpose} needs {names}: pip install 'receptance[{extra}]'")
