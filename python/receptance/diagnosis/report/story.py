"""A verdict in plain sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.wording import deviation_factor, gained, sizes, vetoes
from receptance.identification.observations import MeasuredFRF

if TYPE_CHECKING:
    from collections.abc import Sequence

    from receptance.diagnosis import Verdict
    from receptance.diagnosis.by_mode import ModeResidual

__all__ = ["story"]


def story(verdict: Verdict, before: Sequence[ModeResidual], after: Sequence[ModeResidual]) -> list[str]:
    """Return the sentences on data, model, causes, modes and gain."""
    observed = verdict.selection.base.model.observations
    receptances = [one for one in observed if isinstance(one, MeasuredFRF)]
    lines = sum(one.frequency_hz.size for one in receptances)
    frequencies = sum(one.frequency_hz.size for one in observed if not isinstance(one, MeasuredFRF))
    data = [f"{len(receptances)} receptances with {lines} lines"] if receptances else []
    data += [f"{frequencies} natural frequencies"] if frequencies else []
    count = len(verdict.selection.base.model.configurations)
    sentences = [
        f"Measured were {' and '.join(data)} of {count} configuration{'s' if count != 1 else ''}; the model was fitted "
        "to all of them together, with dimensions and materials free within their tolerances."
    ]
    worst = verdict.adequacy.worst[0] if verdict.adequacy.worst else None
    sentence = f"It leaves {verdict.adequacy.misfit:.2f} times what noise and floor explain"
    if worst is not None and not verdict.adequacy.passed:
        sentence += f", most of it in {worst}"
    if verdict.adequacy.passed:
        found = verdict.verdict in ("named", "suspected", "ambiguous")
        sentence += (
            ", which would pass; yet a cause explains more of it than chance does" if found else ": that is adequate"
        )
    if verdict.verdict == "undecided":
        sentence = "The data have too few degrees of freedom to test the model"
    sentences.append(f"{sentence}.")
    sentences += _on_causes(verdict)
    sentences += [f"{text}." for text in vetoes(verdict)]
    sentences += _on_modes(before, after)
    if verdict.gain is not None:
        sentences.append(f"On held-out data: {gained(verdict.gain)}.")
    if verdict.bias is not None:
        sentences.append(f"Held-out data with the model as given: {verdict.bias}.")
    return sentences


def _on_causes(verdict: Verdict) -> list[str]:
    after = verdict.adequacy_after
    left = f" With it {after.misfit:.2f} times what noise and floor explain is left." if after is not None else ""
    if verdict.verdict == "ambiguous":
        alike = ", ".join(verdict.ambiguous_between)
        return [f"These data cannot distinguish: {alike}. Each of them explains the misfit of the model.{left}"]
    if (other := verdict.alternative) is not None:
        return [
            f"A cause of the catalogue explains the data nearly as well, but {other.meaning} {other.variant} "
            f"({sizes(other)}) is preferred. It is not a known cause, so no cause is named: {other.remedy}."
        ]
    if verdict.verdict == "unexplained":
        tried = len(verdict.candidates)
        return [
            f"None of {tried} {'known causes' if verdict.final else 'causes tried so far'} explains it. A cause that "
            "is not in the catalogue, or several, may act.",
            *_nearest(verdict),
        ]
    names = " and ".join(one.id for one in verdict.causes)
    if verdict.verdict == "suspected":
        return [f"{names} would explain it, but the evidence is too weak to name it.{left}"]
    if verdict.verdict == "named":
        return [f"The cause is {names}: {'; '.join(one.meaning for one in verdict.causes)}.{left}"]
    return ["No cause of the catalogue would explain more than chance does."]


def _nearest(verdict: Verdict) -> list[str]:
    """Describe the nearest cause if none explains the data, and the misfit of the model."""
    sentences = []
    if verdict.candidates:
        best = verdict.candidates[0]
        sentence = (
            f"By evidence {best.id} comes nearest ({best.meaning}): it would leave {best.misfit:.3g} times what noise "
            "and floor explain"
        )
        if verdict.gain is not None and best.held_out is not None:
            sentence += (
                f", and change held-out data ({verdict.gain.metric}) from {verdict.gain.held_out_before:.3g} to "
                f"{best.held_out:.3g}"
            )
        sentences.append(f"{sentence}.")
    times = deviation_factor(verdict)
    if times is not None:
        sentences.append(f"The model would be adequate if all standard deviations were {times:.2g} times as large.")
    return sentences


def _on_modes(before: Sequence[ModeResidual], after: Sequence[ModeResidual]) -> list[str]:
    first = np.array([one.frequency_percent for one in before])
    last = np.array([one.frequency_percent for one in after])
    if not np.isfinite(first).any():
        return []
    worst = before[int(np.nanargmax(np.abs(first)))]
    sentence = (
        f"Natural frequencies of the fitted model are off by {_rms(first):.2g} % rms, most in {worst.label}, mode "
        f"{worst.mode} ({worst.frequency_percent:+.2g} %)"
    )
    return [sentence + (f"; those of the extended one by {_rms(last):.2g} % rms." if np.isfinite(last).any() else ".")]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
