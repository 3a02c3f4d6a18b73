"""Size and structure of a checkout: `python tests/metrics.py [PATH]` prints them as a table.

`--walk` lists instead the Python files through which two values pass on their way from the files of a campaign to the
core, while a campaign is loaded and identified: the start value of a `k_theta`, and one line of an FRF in a CSV file. A
file counts if a local variable in it, or an entry of one, is the value, its text or its logarithm. It is entered again
if it is called from another file after it has held the value and another file has held it since. The checkout must have
its compiled extension.

Python is counted from the syntax tree, Rust from the text, without building anything, so that any commit can be
compared with any other: `git worktree add ../old COMMIT && python tests/metrics.py ../old`.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeGuard

RENDERERS = {"as_dict", "to_dict", "summary", "as_text", "as_html", "_repr_html_"}
"""Methods by which a class renders itself; `Result`, which does it for all, is not counted."""
OBSERVATION = {"assembly", "frequency_hz", "configuration", "conditions"}
"""Fields of a class of observations."""
KINDS = re.compile(
    r"^(Measured(FRF|Frequencies|Part)|\w*Joint|Part|ModalPart|PointMass|GroundSpring|Terminal|_JOINTS|_TERMINALS)$"
)
"""Classes of observations and elements: `isinstance` on them is a missing method."""
VAGUE = ("one", "found", "own", "known", "given")
"""Names of local variables that do not say what they hold."""
Trees = dict[str, ast.Module]
"""Syntax trees of a package by name of the module."""


def python_files(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield the Python files below a folder and their text."""
    for path in sorted(folder.rglob("*.py")):
        yield path, path.read_text(encoding="utf-8")


def size(folder: Path, pattern: str) -> tuple[int, int]:
    """Return the number of files below a folder and of their lines."""
    files = [path for path in folder.rglob(pattern) if "target" not in path.relative_to(folder).parts]
    return len(files), sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def named_numbers(tree: ast.Module) -> int:
    """Return the number of constants of a module that are named in capitals and are a number, or a tuple of them."""
    count = 0
    for node in tree.body:
        if isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets, value = [node.target], node.value
        else:
            continue
        names = [name for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        if all(re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name.id) for name in names) and _is_number(value):
            count += len(names)
    return count


def _is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, (int, float, complex)) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    return isinstance(node, ast.Tuple) and bool(node.elts) and all(map(_is_number, node.elts))


def kinds_asked(tree: ast.Module) -> int:
    """Return the number of `isinstance` calls on the kind of an observation or of an element."""
    count = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            names = [part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)]
            names += [part.attr for part in ast.walk(node.args[1]) if isinstance(part, ast.Attribute)]
            count += any(KINDS.match(name) for name in names)
    return count


def modules(package: Path) -> Trees:
    """Return the syntax trees of a package by name of the module; a package has that of its `__init__`."""
    trees: Trees = {}
    for path, text in python_files(package):
        parts = (package.name, *path.relative_to(package).with_suffix("").parts)
        trees[".".join(parts).removesuffix(".__init__")] = ast.parse(text)
    return trees


def exported_lazily(package: Path) -> dict[str, str]:
    """Return the module of each name that a package exports through its `__init__.pyi`, by its dotted name."""
    homes: dict[str, str] = {}
    for stub in package.rglob("__init__.pyi"):
        owner = ".".join((package.name, *stub.parent.relative_to(package).parts))
        for node in ast.walk(ast.parse(stub.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                home = f"{owner}.{node.module}" if node.level else node.module
                homes |= {f"{owner}.{alias.asname or alias.name}": home for alias in node.names}
    return homes


def imports(trees: Trees, homes: Mapping[str, str], *, types: bool) -> dict[str, set[str]]:
    """Return the modules of a package that each of its modules imports, inside functions as well.

    Those for annotations alone count if `types` is set. The import of a package by its own modules does not count,
    because its `__init__` runs first. A name that a package exports lazily counts as an import of the module in `homes`
    that defines it.
    """
    edges: dict[str, set[str]] = {}
    for module, tree in trees.items():
        nodes = list(ast.walk(tree))
        if not types:
            blocks = [statement for node in nodes if _is_for_types(node) for statement in node.body]
            left_out = {id(part) for statement in blocks for part in ast.walk(statement)}
            nodes = [node for node in nodes if id(node) not in left_out]
        names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        for node in nodes:
            if isinstance(node, ast.ImportFrom) and node.module:
                names |= {_home(node.module, alias.name, trees, homes) for alias in node.names}
        edges[module] = {name for name in names & trees.keys() if not f"{module}.".startswith(f"{name}.")}
    return edges


def _home(module: str, name: str, trees: Trees, homes: Mapping[str, str]) -> str:
    """Return the module that `from module import name` needs."""
    dotted = f"{module}.{name}"
    if dotted in trees:
        return dotted
    return _home(homes[dotted], name, trees, homes) if dotted in homes else module


def _is_for_types(node: ast.AST) -> TypeGuard[ast.If]:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def circles(edges: dict[str, set[str]]) -> list[list[str]]:
    """Return the groups of modules of which each imports all others, directly or not."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            new = edges[waiting.pop()] - seen
            seen |= new
            waiting += new
        return seen

    below = {module: reached(module) for module in edges}
    groups = {frozenset(other for other in below[module] if module in below[other]) for module in edges}
    return sorted(sorted(group) for group in groups if group)


def imports_in_functions(tree: ast.Module) -> list[str]:
    """Return the source of the import statements inside functions."""
    functions = [node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    inside = {id(node): node for function in functions for node in ast.walk(function)}
    return [ast.unparse(node) for node in inside.values() if isinstance(node, (ast.Import, ast.ImportFrom))]


def bound_names(tree: ast.Module) -> Counter[str]:
    """Return how often each name is bound by an assignment, a loop, a comprehension, `with ... as` or `:=`.

    Parameters and the fields of classes do not count.
    """
    fields = {id(node.target) for owner in ast.walk(tree) if isinstance(owner, ast.ClassDef) for node in _fields(owner)}
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return Counter(node.id for node in names if id(node) not in fields)


def _fields(owner: ast.ClassDef) -> list[ast.AnnAssign]:
    return [node for node in owner.body if isinstance(node, ast.AnnAssign)]


def predictors(tree: ast.Module) -> list[str]:
    """Return the classes that predict from the posterior of a fit themselves, and not through another predictor.

    Such a class uses the fitted `parameters` and has the covariance or the information of the fit: as a field, as an
    attribute of a fit, or by a call of `information_root`. Results that a user gets only report it.
    """
    names: list[str] = []
    for owner in ast.walk(tree):
        if not isinstance(owner, ast.ClassDef) or any(ast.unparse(base).endswith("Result") for base in owner.bases):
            continue
        expressions = [ast.unparse(node) for node in ast.walk(owner) if isinstance(node, (ast.Name, ast.Attribute))]
        fields = {ast.unparse(node.target) for node in _fields(owner)}
        calls = {_function(node) for node in ast.walk(owner) if isinstance(node, ast.Call)}
        of_fit = any(re.search(r"\b(fit|found|identified)\.(covariance|curvature_root)$", text) for text in expressions)
        posterior = "covariance" in fields or "information_root" in calls or of_fit
        if posterior and any(text.split(".")[-1] == "parameters" for text in expressions):
            names.append(owner.name)
    return names


def ranks_hypothetical(tree: ast.Module) -> bool:
    """Return whether a module computes what a hypothetical measurement, a `Candidate`, would tell.

    It does if it names the class and calls a fit or the derivatives of residuals.
    """
    names = {ast.unparse(node).split(".")[-1] for node in ast.walk(tree) if isinstance(node, (ast.Name, ast.Attribute))}
    calls = {_function(node) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return "Candidate" in names and bool(calls & {"fit", "fit_one", "refit", "jacobian"})


def fits_of_a_mode(tree: ast.Module) -> list[str]:
    """Return the functions that solve a least-squares problem with its few columns written out in the code.

    The columns are a `stack([...], axis=1)` or a `vander`, and they, or a variable computed from them, are an argument
    of `lstsq` or `qr`; a `polyfit` of degree 2 counts as well. In this package these are the fits of a peak or of a
    decay by the formula of one mode.
    """
    names: list[str] = []
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        columns: set[str] = set()
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and any(map(_is_columns, ast.walk(node.value))):
                columns |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        solved = [
            part
            for node in ast.walk(function)
            if isinstance(node, ast.Call) and _function(node) in ("lstsq", "qr")
            for part in ast.walk(node.args[0])
        ]
        parabolas = [node for node in ast.walk(function) if isinstance(node, ast.Call) and _is_parabola(node)]
        if parabolas or any(
            _is_columns(part) or (isinstance(part, ast.Name) and part.id in columns) for part in solved
        ):
            names.append(function.name)
    return names


def _is_parabola(call: ast.Call) -> bool:
    return _function(call) == "polyfit" and len(call.args) > 2 and ast.unparse(call.args[2]) == "2"


def _is_columns(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call) or not node.args:
        return False
    axes = [keyword.value for keyword in node.keywords if keyword.arg == "axis"]
    by_column = any(isinstance(axis, ast.Constant) and axis.value == 1 for axis in axes)
    listed = isinstance(node.args[0], (ast.List, ast.Tuple))
    return _function(node) == "vander" or (_function(node) == "stack" and listed and by_column)


def _function(call: ast.Call) -> str:
    """Return the last part of the name of the function that is called."""
    return ast.unparse(call.func).split(".")[-1]


def extension(stub: Path) -> tuple[int, int, str]:
    """Return the functions and methods of the extension, and the largest number of arguments and whose it is."""
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    sizes: list[tuple[int, str]] = []
    bodies: list[tuple[str, list[ast.stmt]]] = [("", tree.body)]
    bodies += [(f"{node.name}.", node.body) for node in tree.body if isinstance(node, ast.ClassDef)]
    for owner, body in bodies:
        for node in body:
            if isinstance(node, ast.FunctionDef) and not any(_named(item, "property") for item in node.decorator_list):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                passed = [argument for argument in arguments if argument.arg not in ("self", "cls")]
                sizes.append((len(passed), owner + node.name))
    most, name = max(sizes)
    return len(sizes), most, name


def _named(node: ast.expr, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def measure(root: Path) -> list[tuple[str, str]]:
    """Return name and value of each number."""
    package = root / "python" / "receptance"
    rows: list[tuple[str, str]] = []
    sizes = {"python/receptance": (package, "*.py"), "rust": (root / "rust", "*.rs"), "tests": (root / "tests", "*.py")}
    for name, (folder, pattern) in sizes.items():
        files, lines = size(folder, pattern)
        rows += [(f"{name}: files", f"{files:,}"), (f"{name}: lines", f"{lines:,}")]
    classes = dataclasses = observations = functions = numbers = anys = asked = registries = for_types = 0
    rendering: list[str] = []
    names: Counter[str] = Counter()
    bound: Counter[str] = Counter()
    inside: list[str] = []
    of_posterior: list[str] = []
    of_hypotheses: list[str] = []
    of_modes: list[str] = []
    trees, homes = modules(package), exported_lazily(package)
    for module, tree in trees.items():
        for node in ast.walk(tree):
            functions += isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
            anys += isinstance(node, ast.Name) and node.id == "Any"
            registries += isinstance(node, ast.Call) and _function(node) == "UnitRegistry"
            if isinstance(node, ast.ClassDef):
                classes += 1
                names[node.name] += 1
                observations += {ast.unparse(declared.target) for declared in _fields(node)} >= OBSERVATION
                dataclasses += any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)
                methods = {method.name for method in node.body if isinstance(method, ast.FunctionDef)}
                rendering += [node.name] if methods & RENDERERS and node.name != "Result" else []
        numbers += named_numbers(tree)
        asked += kinds_asked(tree)
        for_types += any(map(_is_for_types, ast.walk(tree)))
        inside += imports_in_functions(tree)
        bound += bound_names(tree)
        short = module.removeprefix(f"{package.name}.")
        of_posterior += [f"{short} {name}" for name in predictors(tree)]
        of_hypotheses += [short] if ranks_hypothetical(tree) else []
        fits = fits_of_a_mode(tree)
        of_modes += [f"{short} ({', '.join(fits)})"] if fits else []
    of_package = sum(f" {package.name}" in statement.split(" import ")[0] for statement in inside)
    count, most, name = extension(package / "_core.pyi")
    circle_rows = [
        (title, "; ".join(", ".join(group) for group in circles(imports(trees, homes, types=types))) or "0")
        for title, types in (("import circles", False), ("import circles, types included", True))
    ]
    return [
        *rows,
        ("classes", f"{classes} ({dataclasses} dataclasses)"),
        *circle_rows,
        ("files with TYPE_CHECKING", str(for_types)),
        ("imports inside functions", f"{len(inside)} ({of_package} of the package)"),
        ("classes of observations", str(observations)),
        ("classes of predictors", _listed(of_posterior)),
        ("engines for hypothetical measurements", _listed(of_hypotheses)),
        ("fits of one mode", _listed(of_modes)),
        ("names of several classes", ", ".join(sorted(name for name, times in names.items() if times > 1))),
        (f"local names {', '.join(VAGUE)}", ", ".join(str(bound[name]) for name in VAGUE)),
        ("functions and methods", f"{functions:,}"),
        ("functions of the extension", str(count)),
        ("their largest number of arguments", f"{most} ({name})"),
        ("unit registries", str(registries)),
        ("classes that render themselves", str(len(rendering))),
        ("named numeric constants", str(numbers)),
        ("uses of Any", str(anys)),
        ("isinstance on kinds of observations and elements", str(asked)),
    ]


def _listed(names: list[str]) -> str:
    return f"{len(names)}: {', '.join(names)}" if names else "0"


_TRACE = """
import cmath, math, os, sys, tempfile
from collections import Counter
from pathlib import Path
import numpy as np
import receptance
from receptance import campaign, examples

PACKAGE = os.path.dirname(receptance.__file__) + os.sep
WHOLE, PART = 1, 2  # the value in the text of a whole file; the value alone or in an array, a list, a line of text

def file_of(frame):
    path = frame.f_code.co_filename
    return path.removeprefix(PACKAGE) if path.startswith(PACKAGE) else None

def caller_of(frame):
    caller = frame.f_back
    while caller is not None and file_of(caller) is None:
        caller = caller.f_back
    return None if caller is None else file_of(caller)

def follow(task, texts, numbers):
    # Run a task and print the files that hold one of the texts or numbers, in the order in which they get it.
    real = [number for number in numbers if not isinstance(number, complex)]
    functions, kinds, again, open_frames, last = {}, Counter(), {}, {}, None

    def kind(value, depth=0):
        if isinstance(value, (str, bytes)):
            text = value if isinstance(value, str) else value.decode("latin-1")
            return any(part in text for part in texts) * (WHOLE if "\\n" in text.strip() else PART)
        if isinstance(value, (int, float, complex)):
            return PART * any(abs(value - number) < 1e-9 * abs(number) for number in numbers)
        if isinstance(value, np.ndarray):
            wanted = {"f": real, "c": numbers}.get(value.dtype.kind, [])
            return PART * any((np.abs(value - number) < 1e-9 * abs(number)).any() for number in wanted)
        if depth == 2 or not isinstance(value, (dict, list, tuple)):
            return 0
        entries = value.values() if isinstance(value, dict) else value
        return max((kind(entry, depth + 1) for entry in entries), default=0)

    def trace(frame, event, argument):
        nonlocal last
        file = file_of(frame)
        if file is None:
            return None
        frame.f_trace_lines = False
        if event == "call":
            caller = caller_of(frame)
            back = file in functions and last != file and caller != file
            open_frames[id(frame)] = [caller if back else None, 0]
        elif event != "return":
            return trace
        values = [*frame.f_locals.values(), argument]
        back, before = open_frames[id(frame)]
        held = max(map(kind, values))
        if held and not before:
            again.setdefault(file, []).extend([back] * (back is not None))
            functions.setdefault(file, {})[frame.f_code.co_qualname] = None
            last = file
        kinds[file] = max(kinds[file], held)
        open_frames[id(frame)][1] = held
        if event == "return":
            del open_frames[id(frame)]
        return trace

    sys.settrace(trace)
    try:
        task()
    finally:
        sys.settrace(None)
    for file, names in functions.items():
        remarks = ["whole text"] * (kinds[file] == WHOLE)
        if again[file]:
            remarks.append(f"entered again: {len(again[file])}, from {', '.join(dict.fromkeys(again[file]))}")
        print(f"{file}: {', '.join(names)}" + f" ({'; '.join(remarks)})" * bool(remarks))
    whole = sum(kinds[file] == WHOLE for file in functions)
    total = sum(map(len, again.values()))
    print(f"{len(functions)} files, {whole} of them with the text of the whole file only; entered again: {total}")
"""
_START_VALUE = """
text = '''
[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
[parts.tool]
segments = [{ length = "60 mm", outer_diameter = "12 mm", material = "steel" }]
[parts.holder]
segments = [{ length = "120 mm", outer_diameter = "45 mm", material = "steel" }]
[joints.joint]
k_y = "3e8 N/m"
[assemblies.one]
chain = ["tool", "joint", "holder"]
[measurements.one]
kind = "natural frequencies"
assembly = "one"
frequencies = ["2600 Hz", "9300 Hz", "13000 Hz"]
standard_deviation = "1 %"
[unknowns]
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad", start = "54321 N m/rad" }
[settings]
starts = 1
profiles = false
'''
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "campaign.toml").write_text(text)
    numbers = [54321.0, math.log(54321.0), math.log10(54321.0)]
    follow(lambda: campaign.load(folder).identify(), ["54321"], numbers)
"""
_LINE = """
with tempfile.TemporaryDirectory() as folder:
    examples.write("free-free", folder)
    rows = (Path(folder) / "short.csv").read_text().splitlines()
    frequency, *parts = rows[len(rows) // 2].split(",")[:3]
    accelerance = complex(*map(float, parts))
    numbers = []
    for value in (accelerance, -accelerance / (2.0 * math.pi * float(frequency)) ** 2):
        logarithm = cmath.log(value)
        numbers += [value, value.real, value.imag, logarithm, logarithm.real, logarithm.real / math.log(10.0)]
    follow(lambda: campaign.load(folder).identify(), parts, numbers)
"""
WALKS = {"start value of k_theta": _TRACE + _START_VALUE, "line of an FRF": _TRACE + _LINE}
"""Programs that follow a value, by its name."""


def walk(root: Path, program: str) -> str:
    """Return a line for each file through which a value passes, with the functions that hold it, and their number."""
    environment = {**os.environ, "PYTHONPATH": str(root / "python")}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout.rstrip()


def main() -> None:
    """Print the table of a checkout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", nargs="?", type=Path, default=Path(__file__).resolve().parents[1], metavar="PATH")
    parser.add_argument("--walk", action="store_true", help="list the files that two values pass")
    arguments = parser.parse_args()
    root = arguments.path.resolve()
    if not (root / "python" / "receptance").is_dir():
        sys.exit(f"{root} has no python/receptance, expected a checkout of the project")
    if arguments.walk:
        print("\n\n".join(f"{title}\n{walk(root, task)}" for title, task in WALKS.items()))
        return
    rows = measure(root)
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


if __name__ == "__main__":
    main()
