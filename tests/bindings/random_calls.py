"""Random calls of the extension: ``python tests/bindings/random_calls.py [--calls N] [--seed N] [--jobs N]``.

Every call takes arguments that work and damages one to three of them: a number in an array, its shape, type, layout or
length, a scalar, or an object of another kind. The answer must be C-contiguous arrays or an ordinary exception with a
text. A panic, any other exception, a text about internals or a call of more than ten minutes is a failure; it is
printed with the number of the call, which reproduces it (``--first N --calls 1``).

Each function has an entry of its name in `calls`, such as "Model.receptance", and perhaps others with further words,
"Model.receptance with slips". `exported` lists the functions of the extension, so that a test finds one without entry.
"""

from __future__ import annotations

import argparse
import inspect
import os
import resource
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from receptance import ReceptanceError, _core

ALLOWED = (ValueError, TypeError, OverflowError, ReceptanceError)
LONGEST_S = 600.0
MEMORY = 6 * 2**30
STEEL = [200e9, 7800.0, 0.29]
ODD = [0.0, -0.0, 1.0, 2.0, 0.5, -1.0, 5e-324, 1e-300, 1e300, -1e300, 1.7e308, np.nan, np.inf, -np.inf, 1e15, 2.0**53]
ODD_SCALARS = [-1, 0, 1, 2, 7, 2**31, 2**40, 2**70, 0.5, 1e300, np.nan, np.inf, True, None, "one", b"x", (), [1.0], {}]
ANSWERS = ("<f8", "<c16", "<i8")
TYPES = ["f8", "f4", "c16", "c8", "i8", "i4", "u1", "?", "O", "S3", "U2", "M8[s]", ">f8", "f2"]

Call = tuple[Callable[..., Any], dict[str, Any]]


def exported() -> dict[str, set[str]]:
    """Return the functions of the extension by name, "joint_stiffness" or "Model.receptance", with their arguments."""
    found: dict[str, Any] = {}
    for name in _core.__all__:
        one = getattr(_core, name)
        if not inspect.isclass(one):
            found[name] = one
        elif not issubclass(one, Exception):
            if "__new__" in vars(one):
                found[name] = one
            methods = {own: method for own, method in vars(one).items() if own == "__len__" or own[0] != "_"}
            found |= {f"{name}.{own}": method for own, method in methods.items() if callable(method)}
    return {name: set(inspect.signature(one).parameters) - {"self"} for name, one in found.items()}


def halted(problem: Any, before: Any, **given: Any) -> Any:
    """Return the ends of a fit in a thread that ends its calls on a flag; None if the flag was set before the fit."""
    halt, answers = _core.Halt(), []
    if before:
        halt.set()

    def fit() -> None:
        halt.join()
        try:
            answers.append(problem.fit(**given))
        except BaseException as error:  # raised again in the thread of the caller
            answers.append(error)

    thread = threading.Thread(target=fit)
    thread.start()
    thread.join()
    (answer,) = answers
    if isinstance(answer, KeyboardInterrupt) and before:
        return None
    if isinstance(answer, BaseException):
        raise answer
    return answer


def tables() -> dict[str, Any]:
    """Two segments, a joint, a mass and a support."""
    return {
        "segments": np.array([
            [0, 1, 0.1, 0.02, 0.0, *STEEL, 0.01, 0, 0, 0, 0, 0],
            [2, 3, 0.05, 0.04, 0.01, *STEEL, 0.0, *STEEL, 0.02, 1],
        ]),
        "joints": np.array([[1, 2, 1e8, 1e5, 1e6, 1.0, 1e-3, 0.0, 0.01]]),
        "masses": np.array([[0, 0.01, 1e-6]]),
        "grounds": np.array([[3, 1e7, 1e4, 0, 0, 0, 0, 0.1]]),
    }  # fmt: skip


def overlap() -> Any:
    """A shank in a sleeve between the two segments."""
    shank = [0.02, 0.005, *STEEL, 0.01, *STEEL, 0.02, 1]
    sleeve = [0.04, 0.02, *STEEL, 0.0, 0, 0, 0, 0, 0]
    return np.array([[1, 2, 0.03, *shank, *sleeve, 1e8, 1e4, 10.0, 1e-3, 0.02, 0.0, 0]])


LINES = np.linspace(1e3, 1e4, 11)
POINTS = np.array([[0.0, 0.0], [3.0, 1.0]])
TIP = np.zeros((2, 2))
RATES = np.array([[1.0, 0.0, 2.0], [1.0, 0.0, 3.0], [0.0, 0.0, 2.0]])
MEASURED = np.full(11, 1e-7 - 1e-8j)
TWO = np.array([7.0, 5.0])
VALUES = np.array([[1e8, 1e5], [1e7, 1e4], [1e9, 1e6]])


def problem(**changes: Any) -> Any:
    """A problem with one receptance of two unknown stiffnesses."""
    given = {
        "logarithmic": np.ones(2, np.bool_), "bounds": np.array([[5.0, 3.0], [10.0, 8.0]]),
        "priors": np.array([[1.0, 2.0, 10.0]]), "threads": 1, "smoothing": None,
    } | changes  # fmt: skip
    return _core.Problem(*given.values())


def ties() -> dict[str, Any]:
    """The stiffnesses of the joint: multiples of one unknown and of both."""
    addresses = np.zeros((2, 8))
    addresses[:, :4] = [[0.0, 1.0, -1.0, 0.0], [1.0, 1.0, 0.0, 1e-3]]
    return {
        "rates": np.array([[1.0, 0.0, 2.0, 0.0, 1.0], [1.0, 0.0, 3.0, 1.0, 1.0]]),
        "present": np.array([1e8, 1e5]),
        "addresses": addresses,
        "factors": np.empty((0, 2)),
    }


@cache
def calls() -> dict[str, Call]:
    """Return the calls by name: a function and arguments that work."""
    model = _core.Model(0, **tables())
    lines = _core.Lines(LINES)
    reduction = model.reduced_to_joint(0, lines, TIP, 1)
    end = np.array([[3.0, 1e-9, 1e-7, 1e-8]])
    modes = np.array([[0.0, 4e3, 0.02, 0.3, 1.0, 0.0, 0.0]])
    slips = np.array([[0.0, 100.0, 10.0, 1.0, 0.0, 0.0, 0.0]])
    tied = model.tied(**ties())
    sweep = tied.sweep(lines, TIP)
    joint = np.ascontiguousarray(tables()["joints"][0, 2:])
    variables = np.array([0.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    fit = {
        "starts": np.array([[7.0, 5.0], [8.0, 6.0]]), "free": np.ones(2, np.bool_), "evaluations": np.array([20, 20]),
        "tolerance": 1e-8, "least": 1e-9, "of_all": False,
    }  # fmt: skip

    def filled(**more: Any) -> Any:
        found = problem(**{name: value for name, value in more.items() if name in ("bounds", "priors", "threads")})
        added = {
            "model": reduction,
            "joint": joint,
            "variables": variables,
            "measured": MEASURED,
            "weights": np.ones(11),
        }
        found.add_joint_receptance(**{name: more.get(name, value) for name, value in added.items()})
        return found

    def of_function(function: Any, x: Any = TWO) -> Any:
        found = problem()
        found.add_function(function)
        found.normal_matrix(x)
        return found.fit(**fit)

    def both() -> Any:
        found = problem()
        found.add_receptance(tied, lines, TIP, _core.Records(**records))
        found.add_receptance(tied, lines, TIP, _core.Records(**records, end=0.01))
        found.add_frequencies(tied, **frequencies)
        return found

    added = {"joint": joint, "variables": variables, "measured": MEASURED, "weights": np.ones(11)}
    records = {"measured": MEASURED[None], "weights": np.ones((1, 11))}
    frequencies = {
        "modes": np.array([0.0, 1.0]), "measured": np.array([5e3, 2e4]), "weights": np.ones(2),
        "damping_ratio": np.array([0.01, np.nan]), "damping_weights": np.ones(2),
    }  # fmt: skip
    receptance = {"lines": LINES, "excitations": POINTS, "responses": TIP, "parameters": RATES, "threads": 1}
    tip = {"lines": LINES, "excitations": TIP[:1], "responses": TIP[:1], "parameters": RATES, "threads": 1}
    ended = model.with_terminals(end, modes)
    slipping = model.with_slips(slips)
    beyond, force = np.tile(MEASURED, 3), np.ones(11)

    def of_lines(method: Callable[..., Any]) -> Callable[..., Any]:
        def call(lines: Any, **others: Any) -> Any:
            return method(lines=_core.Lines(lines), **others)

        return call

    def by_line(method: Callable[..., Any]) -> Callable[..., Any]:
        def call(lines: Any, beyond: Any = None, force: Any = None, **others: Any) -> Any:
            return method(lines=_core.Lines(lines), by_line=_core.ByLine(beyond, force), **others)

        return call

    def in_problem(name: str, **given: Any) -> Any:
        changed = problem()
        getattr(changed, name)(**given)
        return changed.normal_matrix(TWO)

    found: dict[str, Call] = {
        "Lines": (_core.Lines, {"angular_frequency": LINES - 10j, "scale": 1.0}),
        "Lines.__len__": (lambda **given: len(_core.Lines(**given)), {"angular_frequency": LINES, "scale": 1.0}),
        "ByLine": (_core.ByLine, {"beyond": np.tile(MEASURED, 3), "force": np.ones(11)}),
        "Model": (_core.Model, {"motion": 0, **tables()}),
        "Model with overlap": (
            _core.Model, {"motion": 0, **tables(), "joints": np.empty((0, 9)), "overlaps": overlap()}
        ),
        "Model.with_terminals": (model.with_terminals, {"terminals": end, "modes": modes}),
        "Model.with_slips": (model.with_slips, {"slips": slips}),
        "Model.receptance": (of_lines(model.receptance), receptance),
        "Model.receptance with terminals": (by_line(ended.receptance), {**tip, "beyond": beyond}),
        "Model.receptance with slips": (by_line(slipping.receptance), {**tip, "force": force}),
        "Model.receptance with handles": (model.receptance, {**receptance, "lines": lines, "by_line": None}),
        "Model.natural_frequencies": (model.natural_frequencies, {"upper": 1e5, "most": 20, "parameters": RATES}),
        "Model.complex_frequencies": (
            model.complex_frequencies,
            {"undamped": model.natural_frequencies(1e5, 20, RATES)[0], "parameters": RATES},
        ),
        "Model.poles": (model.poles, {"starts": LINES + 1j, "radii": (1e3, 1e5), "angles": (-0.5, 1.1)}),
        "Model.reduced_to_joint": (
            of_lines(model.reduced_to_joint), {"lines": LINES, "joint": 0, "points": TIP, "threads": 1}
        ),
        "Model.reduced_to_joint with handles": (
            model.reduced_to_joint,
            {"lines": lines, "joint": 0, "points": TIP, "threads": 1, "by_line": None, "planes": True},
        ),
        "Model.reduced_to_joint with terminals": (
            by_line(ended.reduced_to_joint), {"lines": LINES, "joint": 0, "points": TIP, "threads": 1, "beyond": beyond}
        ),
        "JointReduction.planes": (
            of_lines(lambda **given: model.reduced_to_joint(**given).planes()),
            {"lines": LINES, "joint": 0, "points": TIP, "threads": 1, "planes": True},
        ),
        "JointReduction.__len__": (
            of_lines(lambda **given: len(model.reduced_to_joint(**given))),
            {"lines": LINES, "joint": 0, "points": TIP, "threads": 1},
        ),
        "JointReduction.fill": (
            reduction.fill, {"joints": np.tile(joint, (3, 1)), "out": np.empty((3, 11)), "threads": 1}
        ),
        "JointReduction.misfit": (
            reduction.misfit,
            {
                "joints": np.tile(joint, (3, 1)), "measured": MEASURED, "weights": np.ones(11), "logarithmic": True,
                "threads": 1,
            },
        ),
        "Problem": (
            problem,
            {
                "logarithmic": np.ones(2, np.bool_), "bounds": np.array([[5.0, 3.0], [10.0, 8.0]]),
                "priors": np.ones((1, 3)), "threads": 1, "smoothing": 1.5,
            },
        ),
        "Problem.add_joint_receptance": (
            lambda **given: in_problem("add_joint_receptance", **given), {"model": reduction, **added}
        ),
        "Problem.normal_matrix": (lambda x, **more: filled(**more).normal_matrix(x), {"x": TWO, **added}),
        "Problem.rows": (lambda x, free: filled().rows(x, free), {"x": TWO, "free": np.array([True, False])}),
        "Problem.fit": (lambda **given: filled().fit(**given), fit),
        "Halt": (_core.Halt, {}),
        "Halt.join": (lambda **given: halted(filled(), before=False, **given), fit),
        "Halt.set": (lambda **given: halted(filled(), before=True, **given), fit),
        "Problem.add_function": (of_function, {"function": lambda x: (x, np.eye(2)), "x": TWO}),
        "Problem.add_function of given rows": (
            lambda residual, jacobian: of_function(lambda x: (residual, jacobian)),
            {"residual": np.ones(3), "jacobian": np.ones((3, 2))},
        ),
        "Problem.thinned": (lambda lines: filled().thinned(lines), {"lines": 5}),
        "modal_receptance": (
            of_lines(_core.modal_receptance), {"lines": LINES, "modes": np.ascontiguousarray(modes[:, 1:])}
        ),
        "joint_stiffness": (
            of_lines(_core.joint_stiffness), {"joint": tables()["joints"][0, 2:].copy(), "lines": LINES}
        ),
        "Model.tied": (model.tied, ties()),
        "TiedModel.sweep": (of_lines(tied.sweep), {"lines": LINES, "points": TIP}),
        "TiedModel.sweep with handles": (tied.sweep, {"lines": lines, "points": TIP, "by_line": None}),
        "TiedModel.sweep with terminals": (
            by_line(ended.tied(**ties()).sweep), {"lines": LINES, "points": TIP, "beyond": beyond}
        ),
        "ModelSweep.__len__": (
            of_lines(lambda **given: len(tied.sweep(**given))), {"lines": LINES, "points": TIP}
        ),
        "ModelSweep.fill": (sweep.fill, {"values": VALUES, "out": np.empty((3, 11), np.complex128), "threads": 1}),
        "ModelSweep.misfit": (
            sweep.misfit,
            {"values": VALUES, "measured": MEASURED, "weights": np.ones(11), "logarithmic": False, "threads": 1},
        ),
        "Records": (_core.Records, {**records, "percent": False, "end": 0.01}),
        "Records.evaluated": (
            of_lines(lambda lines, end: _core.Records(**records, end=end).evaluated(lines)),
            {"lines": LINES, "end": 0.01},
        ),
        "Problem.add_receptance of given records": (
            of_lines(
                lambda lines, points, **given: problem().add_receptance(tied, lines, points, _core.Records(**given))
            ),
            {"lines": LINES, "points": TIP, **records, "percent": False, "end": 0.01},
        ),
        "Problem.add_receptance": (
            lambda **given: in_problem("add_receptance", **given),
            {"model": tied, "lines": lines, "points": TIP, "records": _core.Records(**records), "by_line": None},
        ),
        "Problem.add_frequencies": (
            lambda **given: in_problem("add_frequencies", **given), {"model": tied, **frequencies}
        ),
        "Problem.add_linear": (
            lambda **given: in_problem("add_linear", **given), {"matrix": np.ones((3, 2)), "centre": np.ones(2)}
        ),
        "Problem.reason": (lambda x: both().reason(x), {"x": TWO}),
        "Problem.fit of both": (lambda **given: both().fit(**given), fit),
        "instruction_set": (lambda: _core.instruction_set(), {}),
    }  # fmt: skip
    return found


def damaged(value: Any, rng: np.random.Generator) -> Any:
    """Return an argument with at most one random error."""
    if not isinstance(value, np.ndarray) or not value.ndim or rng.random() < 0.03:
        return ODD_SCALARS[rng.integers(len(ODD_SCALARS))]
    how = rng.integers(8)
    if how <= 3:
        changed = value.copy()
        place = tuple(rng.integers(size) for size in changed.shape) if changed.size else ()
        odd = ODD[rng.integers(len(ODD))] if rng.random() < 0.7 else float(np.exp(rng.normal(scale=30.0)))
        if changed.size:
            with np.errstate(all="ignore"):
                changed[place] = np.array(odd).astype(changed.dtype)
        return changed
    if how == 4:
        return np.ascontiguousarray(value[: rng.integers(len(value) + 1)])
    if how == 5:
        return np.zeros(tuple(rng.integers(0, 15, size=rng.integers(0, 4))), dtype=value.dtype)
    if how == 6:
        kind = TYPES[rng.integers(len(TYPES))]
        return np.zeros(value.shape, dtype=kind)
    layouts = (value.T, np.asfortranarray(value), np.repeat(value, 2, axis=0)[::2], value[::-1], value[None])
    return layouts[rng.integers(len(layouts))]


def wrong(answer: Any) -> str:
    """Return the deviation of result arrays from their declared type or layout."""
    if type(answer).__module__ == _core.__name__:
        names = [name for name, one in vars(type(answer)).items() if name[0] != "_" and not callable(one)]
        answer = tuple(getattr(answer, name) for name in names)
    for array in answer if isinstance(answer, tuple) else (answer,):
        if isinstance(array, np.ndarray) and not (array.flags.c_contiguous and array.dtype.str in ANSWERS):
            return f"an array of {array.dtype} with strides {array.strides}"
    return ""


def one_call(seed: int, number: int) -> tuple[str, str, float]:
    """Return the function, the outcome ("answered", "refused" or a failure) and the seconds of one call."""
    rng = np.random.default_rng([seed, number])
    known = calls()
    name = list(known)[rng.integers(len(known))]
    function, good = known[name]
    arguments = {key: value.copy() if isinstance(value, np.ndarray) else value for key, value in good.items()}
    for _ in range(rng.integers(1, 4) if arguments else 0):
        key = list(arguments)[rng.integers(len(arguments))]
        arguments[key] = damaged(arguments[key], rng)
    if arguments.get("threads") in (7, 2**31, 2**40):
        arguments["threads"] = 2
    began = time.perf_counter()
    try:
        outcome = wrong(function(**arguments)) or "answered"
    except ALLOWED as error:
        text = str(error)
        outcome = "refused" if text and "panick" not in text and "internal" not in text else f"text {text!r}"
    except BaseException as error:  # a panic is no Exception
        outcome = f"{type(error).__name__}: {error}"
    took = time.perf_counter() - began
    if took > LONGEST_S:
        outcome = f"took {took:.0f} s"
    return name, outcome, took


def run(seed: int, first: int, count: int) -> tuple[Counter[tuple[str, str]], list[str], float]:
    """Make calls; return counts of function and outcome, descriptions of the failures, and the longest time."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))
    counts: Counter[tuple[str, str]] = Counter()
    failures, longest = [], 0.0
    try:
        for number in range(first, first + count):
            name, outcome, took = one_call(seed, number)
            longest = max(longest, took)
            if outcome not in ("answered", "refused"):
                failures.append(f"call {number} of seed {seed}, {name}: {outcome[:300]}")
                outcome = "failed"
            counts[name, outcome] += 1
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    return counts, failures, longest


def main() -> int:
    """Make the calls in several processes and print what came of them; 1 where any failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=1_000_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    ends = np.linspace(given.first, given.first + given.calls, 20 * given.jobs + 1).astype(int)
    counts: Counter[tuple[str, str]] = Counter()
    failures: list[str] = []
    longest = 0.0
    began = time.perf_counter()
    with ProcessPoolExecutor(given.jobs) as pool:
        parts = [pool.submit(run, given.seed, int(a), int(b - a)) for a, b in pairwise(ends)]
        for done, part in enumerate(parts, 1):
            own, failed, slowest = part.result()
            counts += own
            failures += failed
            longest = max(longest, slowest)
            print(f"\r{100 * done // len(parts)} %", end="", file=sys.stderr, flush=True)
    print(
        f"\rseed {given.seed}, {given.calls} calls from number {given.first}, {time.perf_counter() - began:.0f} s, ",
        end="",
    )
    print(f"{given.jobs} processes; the longest call took {longest:.2f} s")
    for name in calls():
        row = [counts[name, outcome] for outcome in ("answered", "refused", "failed")]
        print(f"  {name:<40} {row[0]:>8} answered {row[1]:>8} refused {row[2]:>4} failed")
    print("\n".join(failures[:20]))
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
