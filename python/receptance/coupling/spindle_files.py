"""Files of spindles: tables of receptances with their covariance, and modes with that of their numbers."""

from __future__ import annotations

import io as memory
import os
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from receptance import io, units
from receptance._files import read_whole, write_whole
from receptance._text import shown
from receptance.coupling.spindle_modes import SpindleModes, mode_tolerances
from receptance.coupling.spindle_receptance import SpindleReceptance
from receptance.frf import FRF
from receptance.io.numpy_files import arrays_in
from receptance.model.terminals import ENTRIES, RESIDUALS, MeasuredPart, ModalPart, Mode

TABLE, MODES = ".npz", ".toml"
"""Suffixes of the files of tables and of modes."""
_FORMAT = "receptance spindle 1"
_FORMAT_OF_MODES = "receptance spindle modes 1"
_REQUIRED = ("frequency_hz", "matrix", "decay_rate")
_HEAD = (
    "# Modes of a spindle with the covariance of their numbers. A campaign reads them: [spindles.NAME], file = ...\n"
)
_KEYS = ("format", "band", "discrepancy", *RESIDUALS, "modes", "uncertainty")


def spindle_bytes(spindle: MeasuredPart | SpindleReceptance | SpindleModes, suffix: str) -> bytes:
    """Return the contents of a spindle's file; see `write_spindle`."""
    if isinstance(spindle, SpindleModes):
        if suffix.lower() != MODES:
            raise ValueError(f"modes of a spindle are stored as text, expected the suffix {MODES}, not {suffix!r}")
        return _modes_text(spindle).encode("utf-8")
    if suffix.lower() != TABLE:
        raise ValueError(f"the table of a spindle is stored as arrays, expected the suffix {TABLE}, not {suffix!r}")
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
    return content.getvalue()


def write_spindle(path: str | os.PathLike[str], spindle: MeasuredPart | SpindleReceptance | SpindleModes) -> None:
    """Write a spindle to a file, completely or not at all: a table as arrays (.npz), modes as text (.toml).

    Parameters
    ----------
    path : path
        Path with the suffix of the kind.
    spindle : MeasuredPart, SpindleReceptance or SpindleModes
        The spindle; of a `SpindleReceptance` the usable lines. Residuals are added to the table.

    Raises
    ------
    ValueError
        Another suffix, no usable line, or numbers of modes that the data do not determine.
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
    try:
        content = spindle_bytes(spindle, target.suffix)
    except ValueError as error:
        raise ValueError(f"cannot write {target}: {error}") from error
    write_whole({target: content})


def read_spindle(path: str | os.PathLike[str], *, name: str = "spindle") -> MeasuredPart | SpindleModes:
    """Read a spindle from a file of `write_spindle`, or from an FRF matrix in any format of `receptance.io`.

    Parameters
    ----------
    path : path
        File. An FRF matrix has the responses y and theta and the excitations force and moment, in that order; the
        errors of its entries are taken as independent.
    name : str, optional
        First word of the addresses of its parameters.

    Returns
    -------
    MeasuredPart or SpindleModes
        The table, or the modes with their covariance; every number is the one that was written.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        The file contains no spindle; the message names the file.
    """
    source = Path(path)
    try:
        if source.suffix.lower() == MODES:
            return _modes_of(read_whole(source), name)
        # Other files of arrays hold an FRF.
        arrays = arrays_in(read_whole(source)) if source.suffix.lower() == TABLE else {}
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


def _modes_text(spindle: SpindleModes) -> str:
    """Return the text of modes: numbers as in a campaign, with all digits."""
    part, covariance = spindle.part, np.asarray(spindle.covariance)
    lost = [address for address, row in zip(part.addresses, covariance, strict=True) if not np.isfinite(row).all()]
    if lost:
        raise ValueError(f"the data do not determine {', '.join(lost[:3])}: fit fewer modes")

    def numbers(element: ModalPart | Mode, names: tuple[str, ...]) -> dict[str, Any]:
        return {name: element.quantities[name].text(getattr(element, name)) for name in names}

    table: dict[str, Any] = {"format": _FORMAT_OF_MODES}
    if part.band_hz is not None:
        table["band"] = [units.FREQUENCY_OR_ZERO.text(edge) for edge in part.band_hz]
    table |= {"discrepancy": part.discrepancy, **numbers(part, RESIDUALS)}
    table["modes"] = [numbers(mode, Mode.columns_of) for mode in part.modes]
    # A row of the covariance is a line of the file.
    rows = "".join(f"    [{', '.join(map(repr, row))}],\n" for row in covariance.tolist())
    order = (
        f"# In the order {', '.join(Mode.columns_of)} of each mode, then the residuals; SI units, frequencies in Hz."
    )
    return f"{_HEAD}{tomli_w.dumps(table)}\n[uncertainty]\n{order}\ncovariance = [\n{rows}]\n"


def _modes_of(content: bytes, name: str) -> SpindleModes:
    """Return the modes in a text; a ValueError names the key with a mistake."""
    try:
        table = tomllib.loads(content.decode("utf-8-sig"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"is not TOML: {error}") from None
    if table.get("format") != _FORMAT_OF_MODES:
        raise ValueError(
            f"has the format {shown(table.get('format'))}, expected {_FORMAT_OF_MODES!r}: the modes of a spindle that "
            "`receptance spindle --modes` wrote"
        )
    if unknown := table.keys() - {*_KEYS}:
        raise ValueError(f"has the key {sorted(unknown)[0]!r}, expected {', '.join(_KEYS)}")
    rows = table.get("modes")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"modes is {shown(rows)}, expected [[modes]], one or more")
    modes = tuple(
        Mode(**_numbers(Mode, Mode.columns_of, row, f"modes[{index}]", needed=True)) for index, row in enumerate(rows)
    )
    own = {key: table[key] for key in ("discrepancy", *RESIDUALS) if key in table}
    band = table.get("band")
    if band is not None:
        if not isinstance(band, list) or len(band) != 2:
            raise ValueError(f"band is {shown(band)}, expected its lowest and its highest frequency")
        band = tuple(_read(f"band[{index}]", units.FREQUENCY_OR_ZERO, edge) for index, edge in enumerate(band))
    given = _numbers(ModalPart, ("discrepancy", *RESIDUALS), own, "")
    part = ModalPart(modes=modes, band_hz=band, name=name, **given)
    uncertainty = table.get("uncertainty")
    covariance = uncertainty.get("covariance") if isinstance(uncertainty, dict) else None
    if covariance is None:
        raise ValueError("has no covariance, expected it under [uncertainty]; write hand-made modes as [modal_parts]")
    matrix = _matrix(covariance)
    mode_tolerances(part, matrix)  # checks shape and definiteness
    return SpindleModes(part=part, covariance=matrix)


def _numbers(
    kind: type[Mode] | type[ModalPart], names: tuple[str, ...], row: Mapping[str, Any], where: str, needed: bool = False
) -> dict[str, float]:
    """Return the numbers of a row by name."""
    at = f"{where}." if where else ""
    if unknown := row.keys() - {*names}:
        raise ValueError(f"{at}{sorted(unknown)[0]} is not a known key, expected {', '.join(names)}")
    if needed and (missing := [name for name in names if name not in row]):
        raise ValueError(f"{at}{missing[0]} is missing")
    return {name: _read(f"{at}{name}", kind.declared[name], value) for name, value in row.items()}


def _read(where: str, of: Any, written: Any) -> float:
    """Return a number of a quantity or a declared field; the message of an error begins with its place."""
    try:
        return units.parse(written, of if isinstance(of, units.Quantity) else of.quantity)
    except ValueError as error:
        raise ValueError(f"{where} {error}") from None


def _matrix(written: Any) -> NDArray[np.float64]:
    rows = written if isinstance(written, list) else []
    numbers = all(isinstance(row, list) and all(type(value) in (int, float) for value in row) for row in rows)
    if not rows or not numbers or any(len(row) != len(rows) for row in rows):
        raise ValueError("uncertainty.covariance is no square matrix of numbers, expected a list of equally long rows")
    try:
        return np.array(rows, dtype=np.float64)
    except OverflowError:
        raise ValueError("uncertainty.covariance has a whole number beyond the range of numbers") from None


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
