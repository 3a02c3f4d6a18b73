"""Notes of results, grouped by source."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

__all__ = ["grouped"]

_MOST_SOURCES = 3
"""Number of sources, such as measurements, whose notes are printed; `to_dict` contains all notes."""


def grouped(notes: Sequence[str]) -> Iterator[str]:
    """Yield notes; several notes of one source, the text before a colon, follow the name of the source."""
    sources: dict[str, list[str]] = {}
    for note in notes:
        source, colon, text = note.partition(": ")
        if colon:
            sources.setdefault(source, []).append(text)
    several = [source for source, texts in sources.items() if len(texts) > 1]
    shown = set(several[:_MOST_SOURCES])
    started: set[str] = set()
    for note in notes:
        source, colon, _ = note.partition(": ")
        if not colon or source not in several:
            yield note
        elif source in shown and source not in started:
            started.add(source)
            yield f"{source}:"
            yield from (f"  {text}" for text in sources[source])
    rest = len(several) - len(shown)
    if rest:
        yield f"the notes of {rest} more sources are in the JSON"
