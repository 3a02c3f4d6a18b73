"""The command `demo`: a forgotten sensor, found in the packaged example `forgotten-sensor`."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from receptance.cli.running import Targets, input_errors, takes_targets, with_progress
from receptance.report.terminal import print_sentences, print_title

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.figure import Figure

    from receptance.diagnosis import Verdict
    from receptance.fit import Identification

EXAMPLE = "forgotten-sensor"
FIGURE = Path("receptance-demo.png")
REPORT = Path("receptance-demo.html")


@takes_targets(plot=FIGURE, report=REPORT)
def demo(targets: Targets) -> None:
    """Find the cause of a wrong prediction: a hammer test with a forgotten sensor.

    Writes receptance-demo.png and receptance-demo.html into the current folder.
    """
    targets.require_new()
    found = with_progress(_diagnose)
    targets.write(found.to_dict, lambda: _draw(found), report=found.to_html)
    console = targets.console()
    print_title(console, "Hammer test of a 12 mm carbide blank in a holder, at three overhangs")
    print_sentences(console, [" ".join(texts) for texts in _story(found)])
    targets.print_names(console)
    print_sentences(
        console,
        [
            f"Same campaign in a folder: receptance example {EXAMPLE} DIR. Own data: receptance new DIR FILES. "
            "Published frequencies: receptance example er32.",
        ],
    )


def _diagnose(say: Callable[[str], None]) -> Verdict:
    """Return the verdict on the packaged campaign, which is read where it is installed."""
    from receptance import campaign
    from receptance.campaign.write import with_campaign_lines
    from receptance.examples import EXAMPLES

    folder = resources.files("receptance.examples") / EXAMPLES[EXAMPLE].folder
    with resources.as_file(folder) as files, input_errors():
        read = campaign.load(files, progress=say)
        found = read.diagnose()
        if not found.final:
            raise KeyboardInterrupt  # the story needs the whole diagnosis
        return with_campaign_lines(read, found)


def _story(found: Verdict) -> Iterator[tuple[str, ...]]:
    """Yield the paragraphs: the joint without the cause, the cause, and the joint with it."""
    yield (
        "The data are those of a finite-element model that shares no code with this program. A sensor of 2 g sits on "
        "the tip, and the campaign does not state it. Overhangs of 40 and 55 mm are fitted, 70 mm is held out.",
    )
    yield ("1. Joint without the sensor:", *_joint(found.base))
    yield (f"   {_residuals(found.adequacy.misfit)}. {_prediction(found, after=False)}",)
    if found.extended is None or found.adequacy_after is None:
        yield (f"2. {found.verdict}: no cause was found.",)
        return
    names = " and ".join(one.title for one in found.causes)
    yield (f"2. The cause is {found.verdict}: {names}; {'; '.join(one.sizes for one in found.causes)}",)
    yield ("3. Joint with the cause:", *_joint(found.extended))
    yield (f"   {_residuals(found.adequacy_after.misfit)}. {_prediction(found, after=True)}",)


def _residuals(misfit: float) -> str:
    return f"Residuals {math.sqrt(misfit):.2g} times the noise"


def _joint(fit: Identification) -> Iterator[str]:
    from receptance.report.table import amount

    units = {"joint.k_y": "N/m", "joint.k_theta": "N m/rad"}
    yield ", ".join(f"{name.removeprefix('joint.')} = {amount(fit.values[name], unit)}" for name, unit in units.items())


def _prediction(found: Verdict, *, after: bool) -> str:
    """Return the errors of the prediction of the held-out overhang."""
    from receptance.diagnosis.presentation import metric_name, of_metric

    texts = []
    for gain in found.gains[:2]:
        value = gain.held_out_after if after else gain.held_out_before
        texts.append(f"{metric_name(gain.metric)} {of_metric(gain.metric, value, 2)}")
    return f"Prediction of 70 mm: {'; '.join(texts)}."


def _draw(found: Verdict) -> Figure:
    from receptance.diagnosis.figure import prediction_figure
    from receptance.diagnosis.held_out_curves import held_out_curves

    ((before, after),) = held_out_curves(found)
    return prediction_figure(before, after)
