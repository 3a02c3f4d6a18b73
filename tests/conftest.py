"""Common to all tests: the seed, reproducible hypothesis settings, and a report of the accuracy."""

from __future__ import annotations

import functools
import gc
import importlib.util
import json
import os
import signal
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

# Before NumPy comes in: the finite elements factorise small matrices, on which BLAS threads wait for each other
# (ten times slower where another process works as well).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

SEED_VARIABLE = "RECEPTANCE_TEST_SEED"
_SUMMARIES = pytest.StashKey[dict[str, tuple[str, object]]]()

settings.register_profile(
    "repeatable",
    max_examples=15,  # always the same ones; the other profile draws 100 new ones
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile(
    "explore", deadline=None, database=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("explore" if SEED_VARIABLE in os.environ else "repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for a file with the measured accuracy."""
    parser.addoption(
        "--accuracy-report", metavar="FILE", default=None, help="write the accuracy that the tests measured as JSON"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make room for the summaries, and let Ctrl-C interrupt also where the shell ignores it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    config.stash[_SUMMARIES] = {}


def pytest_report_header(config: pytest.Config) -> str:
    """State the seed of every randomised test."""
    seed = os.environ.get(SEED_VARIABLE)
    if seed is None:
        return f"seeds: fixed in the tests, hypothesis derandomised ({SEED_VARIABLE} changes both)"
    return f"seeds: {SEED_VARIABLE}={seed}, hypothesis random (a failure says how to repeat it)"


def pytest_collection_finish() -> None:
    """Exclude imported and collected objects from garbage collection, which took a tenth of the time of all tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """Skip tests of optional parts in an environment without their packages, which the message names."""
    try:
        return (yield)
    except ImportError as error:
        if not _without_extras():
            raise  # nothing is missing, so the message is wrong
        pytest.skip(str(error))


@functools.cache
def _without_extras() -> list[str]:
    """Return the modules of optional parts that are not installed."""
    from receptance.errors import EXTRAS

    return [name for modules in EXTRAS.values() for name in modules if importlib.util.find_spec(name) is None]


@pytest.fixture(autouse=True)
def _no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the width of a terminal, which pytest-xdist sets in its workers."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture(scope="session")
def summarise(pytestconfig: pytest.Config) -> Callable[[str, str, object], None]:
    """Return a function (name, text, plain values) that adds to the end of pytest's output and to the JSON file."""
    summaries = pytestconfig.stash[_SUMMARIES]

    def add(name: str, text: str, values: object) -> None:
        summaries[name] = (text, values)

    return add


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand what a worker of pytest-xdist measured to the process that prints."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["summaries"] = json.dumps(session.config.stash[_SUMMARIES])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep the tests of a file in one process: they share fits and studies that take longer than the tests."""
    from xdist.scheduler import LoadFileScheduling

    # By the number of their tests, files with a few long ones would come last, when the other process has ended.
    if config.option.markexpr == "slow":
        config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Collect the measurements of a pytest-xdist worker; a crashed worker has none."""
    found = getattr(node, "workeroutput", {}).get("summaries", "{}")
    node.config.stash[_SUMMARIES].update(json.loads(found))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print what was measured."""
    for name, (text, _) in config.stash[_SUMMARIES].items():
        terminalreporter.section(name)
        terminalreporter.write_line(text)
    path = config.getoption("--accuracy-report")
    if path and config.stash[_SUMMARIES]:
        values = {name: found for name, (_, found) in config.stash[_SUMMARIES].items()}
        Path(path).write_text(json.dumps(values, indent=2), encoding="utf-8")


@pytest.fixture
def given_threads(monkeypatch: pytest.MonkeyPatch) -> set[object]:
    """The numbers of threads that calls of the library are given; None where a call has the default."""
    from receptance import _checks

    given: set[object] = set()
    count = _checks.thread_count

    def recorded(threads: int | None) -> int:
        given.add(threads)
        return count(threads)

    monkeypatch.setattr(_checks, "thread_count", recorded)
    return given


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test in an empty folder."""
    monkeypatch.chdir(tmp_path)
