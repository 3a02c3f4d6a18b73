"""The options that say how a measurement file is read, if it does not state everything.

Each is a keyword argument of `receptance.io.read`, an option of the commands that read files, and a key of campaigns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Annotated, Any, TypedDict, cast, get_type_hints

from receptance.units import Form


@dataclass(frozen=True)
class Option:
    """Declaration of an option of reading."""

    text: str
    """Meaning, for the help of commands and the reference of campaigns."""
    value: str = ""
    """Name of the value in the help; none for an option that is true or false."""
    option: str = ""
    """Name of the option of commands, if it is not that of the keyword."""
    frf_key: str | None = ""
    records_key: str | None = ""
    """Key of FRFs and of time records in a campaign; by default that of the keyword, None without one."""


class ReadingOptions(TypedDict, total=False):
    """Options of reading by the name of their keyword argument."""

    format: Annotated[
        str | None,
        Option(
            "format of the file, if its contents and its ending do not determine it: uff, csv, npz, mat, hdf5, cutpro, "
            "dataphysics, lvm or npy",
            "FORMAT",
            "from",
        ),
    ]
    quantity: Annotated[
        Form | None,
        Option(
            "quantity of FRFs, if the file does not state it: receptance, mobility or accelerance",
            "NAME",
            records_key=None,
        ),
    ]
    unit: Annotated[
        str | Mapping[str, str] | None,
        Option(
            "unit of FRFs, such as m/s^2/N, or of each channel of time records, if the file does not state it",
            "UNIT|CHANNEL=UNIT",
            records_key="units",
        ),
    ]
    variables: Annotated[
        Mapping[str, str] | None,
        Option(
            "names of the variables in a MAT, HDF5 or NPZ file of another program: of frequency_hz, values and "
            "coherence, or of time_s and each channel",
            "ROLE=NAME",
            "variable",
        ),
    ]
    columns: Annotated[
        Sequence[str] | None,
        Option(
            "header with units of a table, if it has none or one with other names: 'frequency [Hz],real [g/N],"
            "imag [g/N],coherence', or 'time [s],hammer [N],tip [g]'",
            "NAMES",
        ),
    ]
    coherence: Annotated[
        str | PathLike[str] | None, Option("another file with the coherence of the FRF", "FILE", records_key=None)
    ]
    coherence_variables: Annotated[
        Mapping[str, str] | None,
        Option("names of the variables in that file", "ROLE=NAME", "coherence-variable", records_key=None),
    ]
    coherence_columns: Annotated[
        Sequence[str] | None,
        Option("header of that file, 'frequency [Hz],coherence'", "NAMES", records_key=None),
    ]
    ignore_coherence: Annotated[bool, Option("whether the coherence in the file is ignored", records_key=None)]
    conjugate: Annotated[
        bool,
        Option("whether FRFs are replaced by their complex conjugate: written for exp(-i w t)", records_key=None),
    ]
    reverse: Annotated[bool, Option("whether the sign of FRFs is changed: a sensor or a hammer of reversed direction")]
    sample_rate_hz: Annotated[
        float | None,
        Option(
            "samples per second of time records, if the file does not state it",
            "HZ",
            "sample-rate",
            frf_key=None,
            records_key="sample_rate",
        ),
    ]


REPEATED = {"unit", "variables", "coherence_variables"}
"""Options that are given once for each channel or variable."""
LISTED = {"columns", "coherence_columns"}
"""Options whose values are separated by commas."""


def reading_options() -> dict[str, tuple[Any, Option]]:
    """Return the type and the declaration of each option by the name of its keyword argument."""
    hints = get_type_hints(ReadingOptions, include_extras=True)
    return {name: (hint.__origin__, hint.__metadata__[0]) for name, hint in hints.items()}


def campaign_keys(*, records: bool) -> dict[str, str]:
    """Return the keys of an FRF, or of time records, in a campaign by the names of the keyword arguments."""
    keys = {name: option.records_key if records else option.frf_key for name, (_, option) in reading_options().items()}
    return {name: key or name for name, key in keys.items() if key is not None}


def named_values(texts: Sequence[str], expected: str) -> dict[str, str]:
    """Return names and values, separated by the last =, because names may contain one and units do not.

    The message of a ValueError begins with "is".
    """
    values: dict[str, str] = {}
    for text in texts:
        key, sign, value = text.rpartition("=")
        if not sign or not key or not value:
            raise ValueError(f"is {text!r}, expected {expected}")
        if key in values:
            raise ValueError(f"is given twice for {key!r}, expected one")
        values[key] = value
    return values


def channel_units(texts: Sequence[str]) -> str | dict[str, str]:
    """Return the unit of FRFs, or those of channels from CHANNEL=UNIT; an error is that of `named_values`.

    Examples
    --------
    >>> from receptance._reading import channel_units
    >>> channel_units(["g/N"]), channel_units(["hammer=N", "tip=g"])
    ('g/N', {'hammer': 'N', 'tip': 'g'})
    """
    if len(texts) == 1 and "=" not in texts[0]:
        return texts[0]
    return named_values(texts, "one unit, or CHANNEL=UNIT for each channel")


def options_of_texts(values: Mapping[str, Any]) -> ReadingOptions:
    """Return the keywords of `read_all` from options as texts, without those that are not stated."""
    stated = {name: value for name, value in values.items() if value is not None and value is not False and value != []}
    for name in REPEATED & stated.keys():
        try:
            stated[name] = channel_units(stated[name]) if name == "unit" else named_values(stated[name], "ROLE=NAME")
        except ValueError as error:
            raise ValueError(f"--{reading_options()[name][1].option or name} {error}") from None
    for name in LISTED & stated.keys():
        stated[name] = stated[name].split(",")
    return cast(ReadingOptions, stated)
