"""Optional parts: the packages that they need, and the error when one of them is missing."""

from __future__ import annotations

import importlib.util

from receptance.errors import MissingExtraError

EXTRAS = {
    "sweep": ("xarray", "zarr", "pandas"),
    "hdf5": ("h5py",),
    "sampling": ("emcee",),
    "dask": ("distributed",),
}
"""Modules of each extra of the package, as in `pip install 'receptance[sweep]'`."""


def require(extra: str, purpose: str, *modules: str) -> None:
    """Raise a MissingExtraError if a package of an extra is not installed; nothing is imported.

    The extra is a key of `EXTRAS`, of which `modules` are needed, by default all. `purpose` is the beginning of the
    message, which names the missing packages and the command that installs them.

    Examples
    --------
    >>> from receptance._extras import require
    >>> require("hdf5", "an HDF5 file")
    """
    missing = [name for name in modules or EXTRAS[extra] if importlib.util.find_spec(name) is None]
    if missing:
        names = " and ".join(name.replace("_", "-") for name in missing)
        raise MissingExtraError(f"{purpose} needs {names}: pip install 'receptance[{extra}]'")
