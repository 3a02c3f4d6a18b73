"""What `demo` says about its packaged campaign: the joint without the cause, the cause, and the joint with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from importlib import resources
from typing import Any

from receptance import diagnosis
from receptance.campaign import load
from receptance.campaign.write import with_campaign_lines
from receptance.cli.running import input_errors
from receptance.diagnosis import Verdict
from receptance.diagnosis.presentation import metric_name, of_metric
from receptance.examples import EXAMPLES
from receptance.fit import Identification
from receptance.report.table import amount

EXAMPLE = "forgotten-sensor"


def diagnose(say: Callable[[str], None]) -> Verdict:
    """Return the verdict on the packaged campaign, which is read where it is installed."""
    folder = resources.files("receptance.examples") / EXAMPLES[EXAMPLE].folder
    with resources.as_file(folder) as files, input_errors():
        read = load(files, progress=say)
        verdict = read.diagnose()
        if not verdict.final:
            raise KeyboardInterrupt  # the story needs the whole diagnosis
        return with_campaign_lines(read, verdict)


def story(verdict: Verdict) -> Iterator[tuple[str, ...]]:
    """Yield the paragraphs: the joint without the cause, the cause, and the joint with it."""
    yield (
        "The data are those of a finite-element model that shares no code with this program. A sensor of 2 g sits on "
        "the tip, and the campaign does not state it. Overhangs of 40 and 55 mm are fitted, 70 mm is held out.",
    )
    yield ("1. Joint without the sensor:", *_joint(verdict.base_fit.identification))
    yield (f"   {_residuals(verdict.adequacy.misfit)}. {_prediction(verdict, after=False)}",)
    if verdict.extended is None or verdict.adequacy_after is None:
        yield (f"2. {verdict.verdict}: no cause was found.",)
        return
    names = " and ".join(cause.title for cause in verdict.causes)
    yield (f"2. The cause is {verdict.verdict}: {names}; {'; '.join(cause.sizes for cause in verdict.causes)}",)
    yield ("3. Joint with the cause:", *_joint(verdict.extended))
    yield (f"   {_residuals(verdict.adequacy_after.misfit)}. {_prediction(verdict, after=True)}",)


def _residuals(misfit: float) -> str:
    return f"Residuals {math.sqrt(misfit):.2g} times the noise"


def _joint(fit: Identification) -> Iterator[str]:
    units = {"joint.k_y": "N/m", "joint.k_theta": "N m/rad"}
    yield ", ".join(f"{name.removeprefix('joint.')} = {amount(fit.values[name], unit)}" for name, unit in units.items())


def _prediction(verdict: Verdict, *, after: bool) -> str:
    """Return the errors of the prediction of the held-out overhang."""
    texts = []
    for gain in verdict.gains[:2]:
        value = gain.held_out_after if after else gain.held_out_before
        texts.append(f"{metric_name(gain.metric)} {of_metric(gain.metric, value, 2)}")
    return f"Prediction of 70 mm: {'; '.join(texts)}."


def draw(verdict: Verdict) -> Any:
    """Return the figure of the held-out prediction before and after."""
    ((before, after),) = verdict.improvement.curves
    return diagnosis.figure.prediction_figure(before, after)
