"""The example of a machine with a catalogue of tools, to be changed by tests."""

from __future__ import annotations

from pathlib import Path

from receptance import campaign, examples

_FILES = {name: content.decode() for name, content in examples.EXAMPLES["machine"].files().items()}
TEXT = _FILES["campaign.toml"]
HOLDERS = _FILES["holders.csv"]
TOOLS = _FILES["tools.csv"]
TRUE_K_THETA = 4e4
"""Behind the natural frequencies of the file, in N m/rad."""


def load(folder: Path, *, text: str = TEXT, tools: str = TOOLS, holders: str = HOLDERS) -> campaign.Campaign:
    """Write the three files and return the campaign."""
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    (folder / "tools.csv").write_text(tools, encoding="utf-8")
    (folder / "holders.csv").write_text(holders, encoding="utf-8")
    return campaign.load(folder)
