"""Notes of results, by the source that they are about."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

__all__ = ["grouped"]

_MOST_SOURCES = 3
"""Sources of notes, such as measurements, whose notes are printed; `to_dict` has all of them."""


def grouped(notes: Sequence[str]) -> Iterator[str]:
    """Yield notes; those of one source, which stands before a colon, together under its name."""
    sources: dict[str, list[str]] = {}
    for note in notes:
        source, colon, text = note.partition(": ")
        if colon:
            sources.setdefault(source, []).append(text)
    several = [source for source, texts in sources.items() if len(texts) > 1]
    shown = set(several[:_MOST_SOURCES])
    begun: set[str] = set()
    for note in notes:
        source, colon, _ = note.partition(": ")
        if not colon or source not in several:
            yield note
        elif source in shown and source not in begun:
            begun.add(source)
            yield f"{source}:"
            yield from (f"  {text}" for text in sources[source])
    rest = len(several) - len(shown)
    if rest:
        yield f"notes of {rest} more are in the JSON"
