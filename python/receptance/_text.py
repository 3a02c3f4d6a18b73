"""Text of files and users in messages: control characters, values, similar names."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from typing import Any

_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that move the cursor, or change columns, colours or writing direction, except line feeds."""
_LONGEST_LIST = 12
_LONGEST_TEXT = 60


def printable(text: str) -> str:
    r"""Return a text with control characters escaped, which would affect a terminal.

    Examples
    --------
    >>> from receptance._text import printable
    >>> print(printable("tip" + chr(27) + "[2J"))
    tip\x1b[2J
    >>> print(printable("left" + chr(9) + "right"))
    left\tright
    """
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], text)


def shown(value: Any) -> str:
    """Return a value as text for a message; long texts are shortened, tables and lists are summarised."""
    if isinstance(value, str):
        return f'"{value if len(value) <= _LONGEST_TEXT else value[: _LONGEST_TEXT - 3] + "..."}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return f"{value:g}" if isinstance(value, float) else str(value)


def nearest(word: str, names: Iterable[str]) -> str:
    """Return the name that is similar to a word, or an empty text without one."""
    folded = {choice.casefold(): choice for choice in names}
    small = str(word).casefold()
    for choice in folded:
        if len(choice) == len(small) > 1 and sum(a != b for a, b in zip(choice, small, strict=True)) == 1:
            return folded[choice]
    near = difflib.get_close_matches(small, folded, n=1, cutoff=0.6)
    return folded[near[0]] if near else ""


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return the question "did you mean" for a message, or an empty text without a similar name.

    Examples
    --------
    >>> from receptance._text import did_you_mean
    >>> did_you_mean("lenght", ["length", "outer_diameter"])
    ' (did you mean "length"?)'
    """
    near = nearest(word, names)
    return f' (did you mean "{near}"?)' if near else ""


def one_of(choices: Iterable[str]) -> str:
    """Return names as a list to append to "expected "."""
    names = [f'"{name}"' for name in choices]
    if not names:
        return "nothing: there is none"
    if len(names) == 1:
        return names[0]
    rest = f" and {len(names) - _LONGEST_LIST} more" if len(names) > _LONGEST_LIST else ""
    return f"one of {', '.join(names[:_LONGEST_LIST])}{rest}"


def first_of(texts: Sequence[str], separator: str = ", ", most: int = 4) -> str:
    """Return the first of many texts, and how many more there are.

    Examples
    --------
    >>> from receptance._text import first_of
    >>> first_of(["a", "b", "c"], most=2), first_of(["a", "b"], most=2)
    ('a, b, and 1 more', 'a, b')
    """
    rest = [f"and {len(texts) - most} more"] if len(texts) > most else []
    return separator.join([*texts[:most], *rest])


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in a sentence: "a, b and c"."""
    return " and ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + f" and {names[-1]}"


def instead_of(name: str, names: Iterable[str]) -> str:
    """Return the names that are expected in place of an unknown one, and the nearest of them.

    Examples
    --------
    >>> from receptance._text import instead_of
    >>> instead_of("stel", ["steel", "carbide"])
    ', expected one of "steel", "carbide" (did you mean "steel"?)'
    """
    choices = list(names)
    return f", expected {one_of(choices)}{did_you_mean(name, choices)}"
