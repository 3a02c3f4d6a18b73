"""Files of spindles: tables of receptances with their covariance."""

from __future__ import annotations

import io as memory
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from receptance import io
from receptance._files import read_whole, write_whole
from receptance.coupling.spindle_receptance import SpindleReceptance
from receptance.frf import FRF
from receptance.io.numpy_files import arrays_in
from receptance.model.terminals import ENTRIES, MeasuredPart

_FORMAT = "receptance spindle 1"
_REQUIRED = ("frequency_hz", "matrix", "decay_rate")


def write_spindle(path: str | os.PathLike[str], spindle: MeasuredPart | SpindleReceptance) -> None:
    """Write a spindle to a file of arrays (.npz), completely or not at all.

    Parameters
    ----------
    path : path
        Path with the suffix .npz.
    spindle : MeasuredPart or SpindleReceptance
        The spindle; of a `SpindleReceptance` the usable lines. Residuals are added to the table.

    Raises
    ------
    ValueError
        Another suffix, or no usable line.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from receptance import MeasuredPart
    >>> from receptance.coupling import read_spindle, write_spindle
    >>> lines = np.linspace(100.0, 1000.0, 10)
    >>> spindle = MeasuredPart(frequency_hz=lines, matrix=np.ones((10, 1, 1)) * np.diag([2e-8, 1e-6]), name="spindle")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_spindle(Path(folder) / "spindle.npz", spindle)
    ...     read_spindle(Path(folder) / "spindle.npz") == spindle
    True
    """
    target = Path(path)
    if target.suffix.lower() != ".npz":
        raise ValueError(f"cannot write {target}: a spindle is stored as arrays, expected the suffix .npz")
    part = spindle if isinstance(spindle, MeasuredPart) else spindle.part()
    y, theta, both = part.residual_y, part.residual_theta, part.residual_ytheta
    arrays: dict[str, Any] = {
        "format": np.array(_FORMAT),
        "frequency_hz": part.frequency_hz,
        "matrix": part.matrix + np.array([[y, both], [both, theta]]),
        "decay_rate": np.array(part.decay_rate),
    }
    if part.covariance is not None:
        arrays["covariance"] = part.covariance
    content = memory.BytesIO()
    np.savez_compressed(content, **arrays)
    write_whole({target: content.getvalue()})


def read_spindle(path: str | os.PathLike[str], *, name: str = "spindle") -> MeasuredPart:
    """Read a spindle from a file of `write_spindle`, or from an FRF matrix in any format of `receptance.io`.

    Parameters
    ----------
    path : path
        File. An FRF matrix has the responses y and theta and the excitations force and moment, in that order; the
        errors of its entries are taken as independent.
    name : str, optional
        First word of the addresses of its parameters.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        The file contains no spindle; the message names the file.
    """
    source = Path(path)
    try:
        # Other files of arrays hold an FRF.
        arrays = arrays_in(read_whole(source)) if source.suffix.lower() == ".npz" else {}
        if arrays.get("format") == _FORMAT:
            missing = [array for array in _REQUIRED if array not in arrays]
            if missing:
                raise ValueError(f"the array {missing[0]!r} of the spindle is missing; write the file again")
            if arrays["decay_rate"].shape:
                raise ValueError(f"decay_rate has shape {arrays['decay_rate'].shape}, expected one number")
            return MeasuredPart(
                frequency_hz=arrays["frequency_hz"],
                matrix=arrays["matrix"],
                decay_rate=float(arrays["decay_rate"]),
                covariance=arrays.get("covariance"),
                name=name,
                source=str(source),
            )
        content = io.read(source)
        if not isinstance(content, FRF):
            raise ValueError(f"the file contains a {type(content).__name__}, expected an FRF matrix over y and theta")
        return replace(spindle_of(content, name=name), source=str(source))
    except (ValueError, TypeError, KeyError) as error:
        message = str(error)
        raise ValueError(message if source.name in message else f"{source}: {message}") from error


def spindle_of(frf: FRF, *, name: str = "") -> MeasuredPart:
    """Return the spindle of an FRF with the responses y and theta and the excitations force and moment in this order.

    Lines outside the usable band are omitted. The errors of the entries are taken as independent.

    Raises
    ------
    ValueError
        Other responses or excitations.
    """
    directions = tuple(tuple(point.direction for point in side) for side in (frf.responses, frf.excitations))
    if directions != (("y", "theta"), ("y", "theta")):
        raise ValueError(
            f"spindle{f' {name!r}' if name else ''}: the FRF has the responses {', '.join(directions[0])} and the "
            f"excitations {', '.join(directions[1])}, expected y, theta and y, theta: a full receptance matrix"
        )
    usable = frf.to("receptance").masked()
    covariance = None
    if usable.log_variance is not None:
        variance = np.asarray(usable.log_variance) * np.abs(usable.values) ** 2
        covariance = np.zeros((len(usable.frequency_hz), 3, 3), dtype=np.complex128)
        for column, (i, j) in enumerate(ENTRIES):
            covariance[:, column, column] = 0.5 * (variance[:, i, j] + variance[:, j, i])
    return MeasuredPart(
        frequency_hz=usable.frequency_hz,
        matrix=0.5 * (usable.values + usable.values.transpose(0, 2, 1)),
        decay_rate=usable.decay_rate,
        covariance=covariance,
        name=name,
    )
