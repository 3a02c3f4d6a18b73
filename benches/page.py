"""The page in Chromium: `python benches/page.py [--moves N] [--minutes M] [--json FILE] [--quick]`.

For one and for four records of 1,600 lines: time from the command `receptance open` to the first picture; time from a
key on a slider to the frame with the moved curves (median and 95 % of the moves) and the part of it until the browser
has the data; memory of the server before and after `--minutes` of moves. The campaigns are the packaged example
`forgotten-sensor` with its records resampled, and its first record again under another name. Nothing is asserted about
time: processors and load are printed with it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

# Server and browser are those of the tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from browser_page import Served, Tabs, browser, served
from receptance import examples

LINES = 1600
RECORDS = (1, 4)
_LIMIT_MS = 60_000
_WATCH = """() => {
  const source = Bokeh.documents[0].get_model_by_name('moving');
  window.frames_of_moves = []; window.keys = [];
  document.addEventListener('keydown', () => window.keys.push(performance.now()), true);
  for (const signal of [source.patching, source.properties.data.change]) signal.connect(() => {
    const data = performance.now();
    requestAnimationFrame(() => {
      const channel = new MessageChannel();  // its message comes after the frame is painted
      channel.port1.onmessage = () => window.frames_of_moves.push([data, performance.now()]);
      channel.port2.postMessage(0); }); }); }"""
_PAINTED = "() => window.Bokeh?.documents?.[0]?.is_idle"
"""Whether all that the page shows is drawn."""


def write_campaign(folder: Path, records: int) -> None:
    """Write a campaign with so many records of 1,600 lines."""
    examples.write("forgotten-sensor", folder)
    file = folder / "campaign.toml"
    head, *tables = re.split(r"(?m)^(?=\[measurements\.)", file.read_text(encoding="utf-8"))
    *tables, last = [*tables[:-1], *re.split(r"(?m)^(?=\[unknowns\])", tables[-1])]
    again = tables[0].replace("40 mm", "40 mm again", 1).replace("tool_40mm", "tool_40mm_again")
    file.write_text("".join([head, *[*tables, again][:records], last]), encoding="utf-8")
    for path in sorted(folder.glob("*.csv")):
        _resample(path, path)
    # Between the lines of the first: a copy would be noted as one.
    _resample(folder / "tool_40mm.csv", folder / "tool_40mm_again.csv", 0.5)


def _resample(source: Path, target: Path, shift: float = 0.0) -> None:
    """Write the table of a file with 1,600 lines, moved by a part of their distance."""
    head, _, body = source.read_text(encoding="utf-8").partition("\n\n")
    names, *rows = body.splitlines()
    values = np.array([[float(cell.replace(",", ".")) for cell in row.split(";")] for row in rows])
    lines = np.linspace(values[0, 0], values[-1, 0], LINES)
    lines += shift * (lines[1] - lines[0])
    columns = [lines, *(np.interp(lines, values[:, 0], column) for column in values.T[1:])]
    comma = "," in rows[0]
    texts = [";".join(f"{cell:.9g}" for cell in row) for row in np.transpose(columns)]
    text = "\n".join(texts).replace(".", ",") if comma else "\n".join(texts)
    target.write_text(f"{head}\n\n{names}\n{text}\n", encoding="utf-8")


def memory_mb(server: Served) -> float:
    """Return the memory of the server now."""
    status = Path(f"/proc/{server.process.pid}/status").read_text(encoding="utf-8")
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024.0  # type: ignore[index]


def _move(page: Any, number: int) -> tuple[float, float]:
    """Press a key on the slider; return the times in ms until the browser has the data, and until they are painted."""
    before = page.evaluate("() => { window.keys.length = 0; return window.frames_of_moves.length; }")
    page.keyboard.press("ArrowRight" if number % 20 < 10 else "ArrowLeft")
    page.wait_for_function(f"window.frames_of_moves.length > {before}", timeout=_LIMIT_MS, polling=5)
    key, (data, painted) = page.evaluate("() => [window.keys[0], window.frames_of_moves.at(-1)]")
    return data - key, painted - key


def measure(records: int, moves: int, minutes: float) -> dict[str, Any]:
    """Open a campaign, move a slider, and return the times and the memory."""
    with tempfile.TemporaryDirectory() as name, browser() as program:
        write_campaign(Path(name), records)
        begun = time.perf_counter()
        with served(Path(name)) as server:
            address = time.perf_counter() - begun
            tabs = Tabs(program)
            page = tabs.open(server.address)
            page.wait_for_function(_PAINTED, timeout=_LIMIT_MS)
            picture = time.perf_counter() - begun
            page.get_by_role("slider", name="joint.k_theta").wait_for()
            page.wait_for_timeout(1000)
            page.evaluate(_WATCH)
            page.get_by_role("slider", name="joint.k_theta").focus()
            for number in range(10):
                _move(page, number)
            early = memory_mb(server)
            times = [_move(page, number) for number in range(moves)]
            count, ends = moves, time.perf_counter() + 60.0 * minutes
            while time.perf_counter() < ends:
                _move(page, count)
                count += 1
            late = memory_mb(server)
            tabs.close()
    data, painted = ([pair[which] for pair in times] for which in (0, 1))
    return {
        "records": records,
        "lines": LINES,
        "moves": count,
        "address_s": address,
        "first_picture_s": picture,
        "data_median_ms": statistics.median(data),
        "painted_median_ms": statistics.median(painted),
        "painted_95_ms": float(np.quantile(painted, 0.95)),
        "painted_max_ms": max(painted),
        "memory_mb": early,
        "memory_after_mb": late,
    }


def main(arguments: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Measure, print, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moves", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=0.0, help="of further moves, for the memory")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="five moves of one record")
    options = parser.parse_args(arguments)
    rows = []
    for records in RECORDS[:1] if options.quick else RECORDS:
        row = measure(records, 5 if options.quick else options.moves, options.minutes)
        rows.append(row | {"processors": os.cpu_count(), "load": os.getloadavg()[0]})
        sys.stdout.write(
            f"{records} records of {LINES} lines: address after {row['address_s']:.1f} s, first picture after "
            f"{row['first_picture_s']:.1f} s; from key to frame {row['painted_median_ms']:.0f} ms in the median, "
            f"{row['painted_95_ms']:.0f} ms at 95 %, {row['painted_max_ms']:.0f} ms at most "
            f"({row['data_median_ms']:.0f} ms until the data are there); memory {row['memory_mb']:.0f} MB, "
            f"after {row['moves']} moves {row['memory_after_mb']:.0f} MB; "
            f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}\n"
        )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    return rows


if __name__ == "__main__":
    main()
