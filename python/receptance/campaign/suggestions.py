"""Near misses of names, for messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["did_you_mean", "one_of"]

_MOST = 12


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a question that follows a message, or nothing where no known word is near.

    Examples
    --------
    >>> from receptance.campaign.suggestions import did_you_mean
    >>> did_you_mean("lenght", ["length", "outer_diameter"])
    ' (did you mean "length"?)'
    """
    choices = list(known)
    folded = {choice.casefold(): choice for choice in choices}
    small = str(word).casefold()
    for choice in folded:
        if len(choice) == len(small) > 1 and sum(a != b for a, b in zip(choice, small, strict=True)) == 1:
            return f' (did you mean "{folded[choice]}"?)'
    near = difflib.get_close_matches(small, folded, n=1, cutoff=0.6)
    return f' (did you mean "{folded[near[0]]}"?)' if near else ""


def one_of(known: Iterable[str]) -> str:
    """Return what was expected where it is one of some names."""
    names = [f'"{name}"' for name in known]
    if not names:
        return "nothing: there is none"
    if len(names) == 1:
        return names[0]
    rest = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
    return f"one of {', '.join(names[:_MOST])}{rest}"
