"""Files of a catalogue: the figure and the receptance of each tool."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from receptance import catalogue, report
from receptance._files import write_whole
from receptance.catalogue.prediction import ToolPrediction
from receptance.io import write


def write_files(
    predictions: Iterable[ToolPrediction], names: Mapping[str, str], figures: Path | None, frfs: Path | None
) -> Iterator[ToolPrediction]:
    """Write the figure and the FRF of each tool into folders under their file names, and yield the predictions."""
    for prediction in predictions:
        name = names[prediction.row.name]
        if figures is not None:
            write_whole(
                {figures / f"{name}.png": report.figure.as_image(catalogue.figure.draw_tool(prediction), "png")}
            )
        if frfs is not None:
            write(frfs / f"{name}.csv", prediction.as_frf())
        yield prediction
