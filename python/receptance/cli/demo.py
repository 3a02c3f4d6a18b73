"""The command `demo`: a forgotten sensor, found in the packaged example `forgotten-sensor`."""

from __future__ import annotations

from pathlib import Path

from receptance import cli
from receptance.cli.running import Targets, takes_targets, with_progress
from receptance.report.terminal import print_sentences, print_title

FIGURE = Path("receptance-demo.png")
REPORT = Path("receptance-demo.html")


@takes_targets(plot=FIGURE, report=REPORT)
def demo(targets: Targets) -> None:
    """Find the cause of a wrong prediction: a hammer test with a forgotten sensor.

    Writes receptance-demo.png and receptance-demo.html into the current folder.
    """
    targets.require_new()
    verdict = with_progress(cli.story.diagnose)
    targets.write(verdict.to_dict, lambda: cli.story.draw(verdict), html=verdict.to_html)
    console = targets.console()
    print_title(console, "Hammer test of a 12 mm carbide blank in a holder, at three overhangs")
    print_sentences(console, [" ".join(texts) for texts in cli.story.story(verdict)])
    targets.print_names(console)
    print_sentences(
        console,
        [
            f"Same campaign in a folder: receptance example {cli.story.EXAMPLE} DIR. Own data: receptance new DIR "
            "FILES. Published frequencies: receptance example er32.",
        ],
    )
