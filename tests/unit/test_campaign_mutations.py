"""Campaign files with random damage: a message without a crash, and no unusable campaign."""

from __future__ import annotations

import os
import tomllib
import warnings
from pathlib import Path

import numpy as np

from campaign_text import TEXT
from properties.damaged_campaigns import damaged_contents, dumped
from receptance import campaign, examples
from receptance.campaign import CampaignError
from receptance.errors import ReceptanceError, ReceptanceWarning

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20241121"))
CASES = 160


def answer(file: Path, use: bool) -> str:
    """Return the error message for a campaign file; empty if it is valid."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            found = campaign.load(file)
            for assembly in found.assemblies.values():
                assembly.parameters  # noqa: B018
            if use:
                found.identify()
        except (CampaignError, ReceptanceError) as error:
            return str(error)
    return ""


def test_damaged_campaigns(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    sources = [*3 * [tomllib.loads(TEXT)], tomllib.loads(examples.EXAMPLES["er32"].campaign)]
    file = tmp_path / "campaign.toml"
    answers = []
    for case in range(CASES):
        text = dumped(damaged_contents(sources[case % 4], rng))
        file.write_text(text, encoding="utf-8")
        try:
            answers.append(answer(file, use=case % 2 == 0))
        except Exception as error:
            raise AssertionError(f"seed {SEED}, case {case}: {error!r}\n{text}") from error
    refused = [output for output in answers if output]
    print(f"seed {SEED}: {len(refused)} of {CASES} refused")
    assert CASES // 2 < len(refused) < CASES
    assert all("expected" in output or "key" in output or "missing" in output or ": " in output for output in refused)
