"""Names of the columns of tables: quantity, part, unit and entry, in the words of several languages."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

from receptance.io.description import QUALITY
from receptance.io.errors import FileFormatError
from receptance.units import FORM_NAMES, Form, Unit, UnitError, form_name, frf_kind, parse_unit

QUALITY_NAMES = {field: field.replace("_", " ") for field in QUALITY}
"""Names of the columns of further fields of an FRF."""
PARTS = {
    "real": ("real", "re", "realteil", "reel", "reelle", "reale"),
    "imaginary": (
        *("imaginary", "imag", "im", "imaginarteil", "imaginaerteil", "imaginaire"),
        *("immaginario", "immaginaria", "imaginario", "imaginaria"),
    ),
    "magnitude": (
        *("magnitude", "mag", "amplitude", "ampl", "amp", "abs", "betrag", "module", "modulo", "amplitud"),
        "ampiezza",
    ),
    "phase": ("phase", "angle", "arg", "phasenwinkel", "fase", "angulo", "angolo"),
}
"""Roles of the columns of an FRF, with the words for them in names of columns, without accents."""
_ANGULAR = ("angular frequency", "omega", "ω", "kreisfrequenz", "pulsation", "pulsazione", "pulsacion")
AXES = {
    "frequency": (
        *("frequency", "frequencies", "freq", "f", "frequenz", "frequence", "frequenza", "frecuencia"),
        *_ANGULAR,
    ),
    "time": ("time", "t", "zeit", "temps", "tempo", "tiempo"),
}
"""Roles of the first column, with the words for them."""
LONGEST_NAME = 1000
"""Most characters of the name of a column with its unit."""
_UNITS = {"frequency": "Hz", "time": "s", "phase": "deg"}
"""Usual units of columns whose quantity follows from their name."""
_COHERENCE = ("coherence", "coh", "koharenz", "kohaerenz", "coherencia", "coerenza", "gamma2", "γ²")
_FORMS = "|".join(FORM_NAMES)
_ESTIMATE = "frf|h[12v]?"
"""Names of an FRF that do not state its form: the letter of the transfer function, and its estimators."""
_PART = "|".join(word for words in PARTS.values() for word in words)
_FRF = re.compile(
    rf"(?:(?P<form>{_FORMS}|{_ESTIMATE})\s+)?(?:part(?:ie|e)\s+)?(?P<part>{_PART})\.?(?:\s+part)?"
    rf"(?:\s+(?P<after>{_FORMS}|frf))?(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_FRF_OF_ENTRY = re.compile(
    rf"(?P<entry>\S.*?)\s+(?:(?P<form>{_FORMS})\s+)?(?P<part>{_PART})\.?(?:\s+part)?", re.IGNORECASE
)
"""The points and directions before the part, as in `Point 1 +X Real` and `H1(1:+Z;2:-Z) Imag`."""
_ENTRY_OF = re.compile(
    rf"(?P<form>{_FORMS}|{_ESTIMATE})(?:\s+(?P<named>.+)|\s*\(\s*(?P<inside>[^()]+?)\s*\))", re.IGNORECASE
)
_PART_OF = re.compile(rf"(?P<part>{_PART})\.?\s*[({{]\s*(?P<form>{_FORMS}|{_ESTIMATE})\s*[)}}]", re.IGNORECASE)
"""A part as a function, as in `Re(H1)`; the parentheses hold no unit."""
_MAGNITUDE = re.compile(rf"\|\s*(?P<form>{_FORMS}|{_ESTIMATE})\s*\|", re.IGNORECASE)
"""A magnitude as in `|H|`."""
_COMPLEX = re.compile(rf"(?P<form>{_FORMS}|{_ESTIMATE})(?:\s+(?P<entry>.+))?", re.IGNORECASE)
"""The name of a column of complex numbers, such as `H1` or `mobility tip`."""
_QUALITY = re.compile(
    rf"(?P<name>{'|'.join(map(re.escape, _COHERENCE))}|{'|'.join(QUALITY_NAMES.values())})\.?(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_QUALITY_OF_ENTRY = re.compile(
    rf"(?P<entry>\S.*?)\s+(?P<name>{'|'.join(map(re.escape, _COHERENCE))})\.?", re.IGNORECASE
)
_BRACKETS = re.compile(r"(?P<name>.*)\[(?P<unit>[^\[\]]*)\]", re.DOTALL)
_SLASH = re.compile(r"(?P<name>[^/_]*)[/_](?P<unit>.+)", re.DOTALL)
"""A unit behind a slash (DIN 1313) or an underscore, as in `Frequenz / Hz` and `freq_Hz`."""
_FREQUENCY_UNITS = ("Hz", "kHz", "rad/s")
"""Units that name a column of frequencies."""
_NO_UNIT = ("", "-", "–", "—")
"""Units of numbers without a dimension, or of an unknown one."""
_LEVEL = re.compile(
    r"dB\s*(?P<bracket>\()?\s*(?:ref|rel|re|//)(?![a-z])[\s.:]*(?P<reference>.*[^\s)].*)", re.IGNORECASE | re.DOTALL
)


@dataclass(frozen=True)
class TableColumn:
    """Meaning of a column, from its name."""

    name: str
    """Name without the unit."""
    unit: str | None
    role: str
    """frequency, time, real, imaginary, magnitude, phase, coherence, a field of QUALITY, or channel."""
    form: Form | None = None
    entry: str = ""
    """Response and excitation, if there are several."""


def parse_column(text: str) -> TableColumn:
    """Return the meaning of a column name such as `accelerance real [m/s^2/N]` or `tip (g)`.

    Examples
    --------
    >>> from receptance.io.column_names import parse_column
    >>> parse_column("Inertance imag 2/1 [m/s^2/N]")
    TableColumn(name='Inertance imag 2/1', unit='m/s^2/N', role='imaginary', form='accelerance', entry='2/1')
    """
    text = text.strip()
    if (match := _BRACKETS.fullmatch(text)) and match["name"].strip():
        return named_column(match["name"], match["unit"])
    if match := _SLASH.fullmatch(text):
        column = named_column(match["name"], match["unit"])
        # Other slashes and underscores belong to the name, such as those of the entry `2/1`.
        if _has_unit_of_role(column):
            return column
    opened = None if _PART_OF.fullmatch(text) else _last_bracket(text)
    if opened and text[:opened].strip():
        return named_column(text[:opened], text[opened + 1 : -1])
    for space in re.finditer(r"\s+", text):
        column = named_column(text[: space.start()], text[space.end() :])
        if _has_unit_of_role(column):
            return column
    if text in _FREQUENCY_UNITS:
        return TableColumn(text, text, "frequency")
    column = named_column(text, None)
    return column if column.role != "channel" else replace(named_column(text.replace("_", " "), None), name=text)


def named_column(name: str, unit: str | None) -> TableColumn:
    """Return the meaning of a name without its unit."""
    name = unicodedata.normalize("NFC", name.strip())
    unit = None if unit is None or unit.strip() in _NO_UNIT else unit.strip()
    plain = _without_accents(name)

    def entry(match: re.Match[str]) -> str:
        return name[match.start("entry") : match.end("entry")] if match["entry"] else ""

    for role, words in AXES.items():
        if plain.lower().removesuffix(".") in words:
            return TableColumn(name, unit, role)
    if quality := _QUALITY.fullmatch(plain) or _QUALITY_OF_ENTRY.fullmatch(plain):
        field = quality["name"].lower().replace(" ", "_")
        return TableColumn(name, unit, field if field in QUALITY else "coherence", entry=entry(quality))
    if frf := _FRF.fullmatch(plain):
        word = frf["form"] or frf["after"] or ""
        return TableColumn(name, unit, _role(frf["part"]), _form(word), entry(frf))
    if part := _PART_OF.fullmatch(plain):
        return TableColumn(name, unit, _role(part["part"]), _form(part["form"]))
    if named := _FRF_OF_ENTRY.fullmatch(plain):
        of = _ENTRY_OF.fullmatch(named["entry"])
        form = _form(named["form"] or (of["form"] if of else ""))
        start, end = named.span("entry")
        if of:
            inside = "named" if of["named"] else "inside"
            start, end = start + of.start(inside), start + of.end(inside)
        return TableColumn(name, unit, _role(named["part"]), form, name[start:end])
    if magnitude := _MAGNITUDE.fullmatch(plain):
        return TableColumn(name, unit, "magnitude", _form(magnitude["form"]))
    return TableColumn(name, unit, "channel")


def _last_bracket(text: str) -> int | None:
    """Return the place of the parenthesis that the last character of a text closes, None without one."""
    depth = 0
    for place in range(len(text) - 1, -1, -1):
        depth += {")": 1, "(": -1}.get(text[place], 0)
        if depth == 0:
            return place if text[place] == "(" else None
    return None


def _without_accents(name: str) -> str:
    """Return a name of composed letters with as many letters without accents."""
    return "".join(unicodedata.normalize("NFD", letter)[0] for letter in name)


def usual_unit(column: TableColumn) -> str | None:
    """Return the usual unit of a column whose quantity follows from its name, else None."""
    return "rad/s" if _without_accents(column.name).lower() in _ANGULAR else _UNITS.get(column.role)


def with_one_axis(columns: Sequence[TableColumn]) -> list[TableColumn]:
    """Return columns of which only the first axis is one: a later f or t is a channel, as force or temperature."""
    first = next((index for index, column in enumerate(columns) if column.role in AXES), len(columns))
    return [
        replace(column, role="channel") if column.role in AXES and index > first else column
        for index, column in enumerate(columns)
    ]


def with_complex_parts(
    columns: Sequence[TableColumn], are_complex: Sequence[bool], line: int | None = None
) -> list[TableColumn]:
    """Return columns with two, of the real and the imaginary part, for each FRF of complex numbers.

    Complex numbers in another column, or in a table without a frequency, raise a FileFormatError with the line.
    """
    has_frequency = any(column.role == "frequency" for column in columns)
    several = sum(are_complex) > 1
    parts: list[TableColumn] = []
    for column, is_complex in zip(columns, are_complex, strict=True):
        if not is_complex:
            parts.append(column)
            continue
        if column.role != "channel" or not has_frequency:
            raise FileFormatError(
                f"column {column.name!r} has complex numbers, expected real ones; an FRF of complex numbers is beside "
                "a frequency and named by its quantity, such as accelerance [m/s^2/N]",
                line=line,
            )
        match = _COMPLEX.fullmatch(column.name.replace("_", " "))
        form = _form(match["form"]) if match else None
        entry = (match["entry"] or "" if match else column.name) if several else ""
        real = replace(column, role="real", form=form, entry=entry)
        parts += [real, replace(real, role="imaginary")]
    return parts


def level_reference(unit: str) -> str | None:
    """Return the reference of a level in dB, None for other units; a level without a reference raises a UnitError.

    Examples
    --------
    >>> from receptance.io.column_names import level_reference
    >>> level_reference("dB re 1 m/s^2/N"), level_reference("dB (rel. 1 g/N)"), level_reference("m/N")
    ('1 m/s^2/N', '1 g/N', None)
    """
    if not unit.lower().startswith("db"):
        return None
    match = _LEVEL.fullmatch(unit)
    if match is None:
        raise UnitError(
            f"the unit {unit!r} is a level in dB, whose reference is unknown; state it, as in 'dB re 1 m/s^2/N', or "
            "export linear values"
        )
    return match["reference"].strip().removesuffix(")" if match["bracket"] else "").strip()


def column_unit(unit: str) -> Unit:
    """Return the unit of a column; of a level in dB that of its reference."""
    if len(unit) > LONGEST_NAME:
        raise UnitError(f"the unit has {len(unit)} characters, expected a short one")
    return parse_unit(level_reference(unit) or unit)


def is_unit(text: str) -> bool:
    """Return whether a text is the unit of a column."""
    try:
        column_unit(text)
    except UnitError:
        return False
    return True


def _role(word: str) -> str:
    return next(role for role, words in PARTS.items() if word.lower() in words)


def _form(word: str) -> Form | None:
    return form_name(word) if word.lower() in FORM_NAMES else None


def _has_unit_of_role(column: TableColumn) -> bool:
    """Return whether the unit is one of the quantity that the column has by its name."""
    try:
        unit = column_unit(column.unit or "")
    except UnitError:
        return False
    if column.role in ("real", "imaginary", "magnitude"):
        return frf_kind(unit) is not None
    usual = {_UNITS.get(column.role), "rad/s" if column.role == "frequency" else None} - {None}
    return any(unit.dimension == parse_unit(str(expected)).dimension for expected in usual)
