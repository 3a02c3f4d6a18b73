"""The extension as a module: its stubs, its exceptions, what it loads, and how it lives with threads and forks."""

from __future__ import annotations

import ast
import inspect
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import receptance
from limits import LIMIT_S
from properties.test_invariance import rich
from receptance import (
    STEEL,
    Assembly,
    Part,
    PointJoint,
    ReceptanceError,
    ReceptanceWarning,
    ResonanceError,
    Section,
    Segment,
    SingularInterfaceError,
    SpreadJoint,
    _core,
)

STUB = Path(receptance.__file__).with_name("_core.pyi")
MANY_LINES = np.linspace(1.0, 1e4, 20_000)


def test_stubs_match_names_and_parameters_of_the_extension() -> None:
    tree = ast.parse(STUB.read_text(encoding="utf-8"))
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    classes = {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    public = {name for name in dir(_core) if not name.startswith("_")}
    assert public == set(functions) | classes
    for name, node in functions.items():
        stub = [argument.arg for argument in [*node.args.posonlyargs, *node.args.args]]
        assert list(inspect.signature(getattr(_core, name)).parameters) == stub, name
        assert getattr(_core, name).__doc__, name


def test_every_public_name_is_documented() -> None:
    for name in receptance.__all__:
        assert getattr(receptance, name).__doc__, name
    assert len(set(receptance.__all__)) == len(receptance.__all__)


def test_exceptions_have_one_base_and_survive_pickling() -> None:
    assert issubclass(SingularInterfaceError, ReceptanceError)
    assert issubclass(ResonanceError, ReceptanceError)
    assert issubclass(ReceptanceError, Exception)
    assert not issubclass(ReceptanceError, ValueError)
    assert issubclass(ReceptanceWarning, UserWarning)
    for kind in (ReceptanceError, SingularInterfaceError, ResonanceError, ReceptanceWarning):
        again = pickle.loads(pickle.dumps(kind("joint 0: singular")))
        assert type(again) is kind
        assert str(again) == "joint 0: singular"


def test_instruction_set_has_a_name() -> None:
    assert _core.instruction_set() == _core.instruction_set()
    assert _core.instruction_set()


def third_party(command: str) -> set[str]:
    """Return the top-level modules that are neither built in nor the standard library's, after a command."""
    script = (
        f"import sys\nbefore = set(sys.modules)\n{command}\n"
        "loaded = {name.split('.')[0] for name in set(sys.modules) - before}\n"
        "print(*sorted(name for name in loaded if name not in sys.stdlib_module_names))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=LIMIT_S)
    return set(done.stdout.split())


def test_import_loads_numpy_and_scipy_only() -> None:
    found = {name for name in third_party("import receptance") if not name.startswith("_distutils")}
    assert "receptance" in found
    assert found <= {"receptance", "lazy_loader", "numpy", "scipy"}, found


def test_subpackages_are_available_after_import() -> None:
    """Each is loaded when it is first used, and not before; what command line and page share is no library."""
    folder = Path(receptance.__file__).parent
    packages = {path.parent.name for path in folder.glob("*/__init__.py")} - {"cli", "session", "draft"}
    script = f"import receptance; print(*[getattr(receptance, name).__name__ for name in {sorted(packages)}])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=LIMIT_S)
    assert set(done.stdout.split()) == {f"receptance.{name}" for name in packages}
    assert packages - {"model"} <= set(dir(receptance))  # whose names are those of receptance itself
    with pytest.raises(AttributeError, match="campaigns"):
        receptance.campaigns  # type: ignore[attr-defined]  # noqa: B018


def test_import_is_silent_and_sets_no_handler() -> None:
    script = "import logging, receptance; print(len(logging.getLogger().handlers))"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=True, timeout=LIMIT_S
    )
    assert done.stdout.strip() == "0"
    assert done.stderr == ""


def test_other_threads_run_during_a_call() -> None:
    """A counter goes on while the core computes, in one long call, so the call does not hold the interpreter.

    A busy machine need not run the counter during every call.
    """
    assembly = rich()
    lines = np.linspace(1.0, 1e4, 60_000)
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-4)

    ticker = threading.Thread(target=tick)
    ticker.start()
    flat = assembly.flat()
    rows, _ = assembly._weights(flat, assembly.parameters[:20])
    w = 2 * np.pi * lines + 0j
    ends = np.array([[0.0, 0.0], [float(flat.count - 1), 0.0]])
    within = 0
    for _ in range(1000):
        ticks.clear()
        before = time.perf_counter()
        flat.model.receptance(_core.Lines(w), ends, ends, rows, 1)
        after = time.perf_counter()
        within = sum(before + 1e-3 < at < after - 1e-3 for at in tuple(ticks))
        if within >= 5:
            break
    done.set()
    ticker.join()
    assert within >= 5, f"{within} ticks in {after - before:.3f} s"


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize("threads", [1, 2])
def test_exception_in_signal_handler_ends_a_call(threads: int) -> None:
    """200,000 fits over 20,000 lines take hours; a raising handler ends them."""

    class AlarmError(Exception):
        pass

    def ring(*_: object) -> None:
        raise AlarmError

    bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    own = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5, name="joint"), Part([bar], name="rest")])
    f = np.linspace(100.0, 6000.0, 20_000)
    rng = np.random.default_rng(1)
    exact = own.receptance(f)
    measured = exact * (1.0 + 0.01 * rng.standard_normal(f.size))
    bounds = np.array([[5.0, 2.0], [11.0, 8.0]])
    problem = _core.Problem(np.array([True, True]), bounds, np.zeros((0, 3)), threads)
    variables = np.array([0.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    joint = np.array([1e8, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem.add_joint_receptance(own.reduced_to_joint("joint", f), joint, variables, measured, np.ones(f.size))
    starts = rng.uniform([6.0, 3.0], [10.0, 7.0], (200_000, 2))
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        began = time.perf_counter()
        with pytest.raises(AlarmError):
            problem.fit(starts, np.array([True, True]), np.full(200_000, 500), 1e-12)
        assert time.perf_counter() - began < LIMIT_S
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    # Later calls are not affected.
    assert np.array_equal(own.receptance(f), exact)


def test_limit_with_overflowing_square_is_an_error() -> None:
    """1e-320 Hz did not return: the search for a frequency below all modes never got below it."""
    shank = Section(outer_diameter=0.012, material=STEEL)
    sleeve = Section(outer_diameter=0.035, inner_diameter=0.012, material=STEEL)
    tool = Part([Segment(length=0.01, outer_diameter=0.012, material=STEEL)], name="tool")
    holder = Part([Segment(length=0.02, outer_diameter=0.04, material=STEEL)], name="holder")
    joint = SpreadJoint(length=0.05, k_y=2e8, k_theta=2e4, shank=shank, sleeve=sleeve, name="joint")
    own = Assembly([tool, joint, holder])
    with pytest.raises(ValueError, match="expected a finite number of at least 1e-100 rad/s"):
        own.natural_frequencies(1e-320)
    assert own.natural_frequencies(1e-6).size == 0


def test_calls_from_several_threads_agree() -> None:
    assembly = rich()
    names = assembly.parameters[:5]
    expected = assembly.derivatives(MANY_LINES, names, threads=1)
    modes = assembly.natural_frequencies(2e4)

    def work(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        h, slope = assembly.derivatives(MANY_LINES, names, threads=1 + number % 3)
        return h, slope, assembly.natural_frequencies(2e4)

    with ThreadPoolExecutor(6) as pool:
        for h, slope, found in pool.map(work, range(18)):
            np.testing.assert_array_equal(h, expected[0])
            np.testing.assert_array_equal(slope, expected[1])
            np.testing.assert_array_equal(found, modes)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.parametrize("threads", [0, 1, 2])
def test_a_forked_child_computes(threads: int) -> None:
    """After a call that started threads, which the child does not have."""
    script = f"""
import os, signal, sys
import numpy as np
from receptance import STEEL, Assembly, Part, Segment
bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
f = np.linspace(1.0, 1e4, 20_000)
expected = bar.receptance(f, threads=2)
bar.receptance(f, threads={threads})
children = []
for _ in range(3):
    child = os.fork()
    if child == 0:
        signal.alarm({LIMIT_S:.0f})
        same = np.array_equal(bar.receptance(f, threads={threads}), expected)
        os._exit(0 if same else 1)
    children.append(child)
codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
assert np.array_equal(bar.receptance(f, threads=2), expected)
sys.exit(0 if codes == [0, 0, 0] else str(codes))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr


def _first_mode(assembly: Assembly) -> float:
    return float(assembly.natural_frequencies(1e4)[0])


def test_assemblies_pickle_to_other_processes() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(pickle.dumps, (rich(),))
    assert pickle.loads(pickle.dumps(rich())) == rich()
    assert _first_mode(pickle.loads(pickle.dumps(rich()))) == _first_mode(rich())


def test_thread_count_is_limited_by_the_work() -> None:
    assembly = rich()
    few = np.linspace(10.0, 1e3, 20)
    np.testing.assert_array_equal(assembly.receptance(few, threads=10_000), assembly.receptance(few, threads=1))


@pytest.mark.parametrize("threads", [-1, 1.5, "many", True, None])
def test_threads_must_be_a_count(threads: object) -> None:
    lines = [100.0, 200.0]
    if threads is None:
        assert rich().receptance(lines, threads=None).shape == (2,)
        return
    with pytest.raises(ValueError, match="threads is"):
        rich().receptance(lines, threads=threads)  # type: ignore[arg-type]
