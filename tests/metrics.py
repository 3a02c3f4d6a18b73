"""Size and structure of a checkout: `python tests/metrics.py [PATH]` prints them as a table.

`--walk` lists instead the Python files through which the start value of a `k_theta` passes on its way from a campaign
file to the core: those in which a local variable, or an entry of one, is the number, its text or its logarithm. The
checkout must have its compiled extension.

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
from collections.abc import Iterator
from pathlib import Path

RENDERERS = {"as_dict", "to_dict", "summary", "as_text", "as_html", "_repr_html_"}
"""Methods by which a class renders itself; `Result`, which does it for all, is not counted."""
OBSERVATION = {"assembly", "frequency_hz", "configuration", "conditions"}
"""Fields of a class of observations."""
KINDS = re.compile(
    r"^(Measured(FRF|Frequencies|Part)|\w*Joint|Part|ModalPart|PointMass|GroundSpring|Terminal|_JOINTS|_TERMINALS)$"
)
"""Classes of observations and elements: `isinstance` on them is a missing method."""


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


def imports(package: Path) -> dict[str, set[str]]:
    """Return the modules of a package that each of its modules imports, inside functions as well.

    Imports for annotations alone are left out, and those of a package by its own modules, whose `__init__` runs first.
    """
    found: dict[str, ast.Module] = {}
    for path, text in python_files(package):
        parts = (package.name, *path.relative_to(package).with_suffix("").parts)
        found[".".join(parts).removesuffix(".__init__")] = ast.parse(text)
    edges: dict[str, set[str]] = {}
    for module, tree in found.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                node.body = []
        named = {
            name if (name := f"{node.module}.{alias.name}") in found else str(node.module)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        named |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        edges[module] = {name for name in named & found.keys() if not f"{module}.".startswith(f"{name}.")}
    return edges


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
    groups = {frozenset(one for one in below[module] if module in below[one]) for module in edges}
    return sorted(sorted(group) for group in groups if group)


def extension(stub: Path) -> tuple[int, int, str]:
    """Return the functions and methods of the extension, and the largest number of arguments and whose it is."""
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    found: list[tuple[int, str]] = []
    bodies: list[tuple[str, list[ast.stmt]]] = [("", tree.body)]
    bodies += [(f"{node.name}.", node.body) for node in tree.body if isinstance(node, ast.ClassDef)]
    for owner, body in bodies:
        for node in body:
            if isinstance(node, ast.FunctionDef) and not any(_named(one, "property") for one in node.decorator_list):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                own = [argument for argument in arguments if argument.arg not in ("self", "cls")]
                found.append((len(own), owner + node.name))
    most, name = max(found)
    return len(found), most, name


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
    classes = dataclasses = observations = functions = numbers = anys = asked = registries = 0
    rendering: list[str] = []
    names: Counter[str] = Counter()
    for _, text in python_files(package):
        tree = ast.parse(text)
        for node in ast.walk(tree):
            functions += isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
            anys += isinstance(node, ast.Name) and node.id == "Any"
            registries += isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "UnitRegistry"
            if isinstance(node, ast.ClassDef):
                classes += 1
                names[node.name] += 1
                fields = {ast.unparse(one.target) for one in node.body if isinstance(one, ast.AnnAssign)}
                observations += fields >= OBSERVATION
                dataclasses += any("dataclass" in ast.unparse(one) for one in node.decorator_list)
                methods = {one.name for one in node.body if isinstance(one, ast.FunctionDef)}
                rendering += [node.name] if methods & RENDERERS and node.name != "Result" else []
        numbers += named_numbers(tree)
        asked += kinds_asked(tree)
    count, most, name = extension(package / "_core.pyi")
    return [
        *rows,
        ("classes", f"{classes} ({dataclasses} dataclasses)"),
        ("import circles", "; ".join(", ".join(group) for group in circles(imports(package))) or "0"),
        ("classes of observations", str(observations)),
        ("names of several classes", ", ".join(sorted(name for name, times in names.items() if times > 1))),
        ("functions and methods", f"{functions:,}"),
        ("functions of the extension", str(count)),
        ("their largest number of arguments", f"{most} ({name})"),
        ("unit registries", str(registries)),
        ("classes that render themselves", str(len(rendering))),
        ("named numeric constants", str(numbers)),
        ("uses of Any", str(anys)),
        ("isinstance on kinds of observations and elements", str(asked)),
    ]


_WALK = """
import math, sys, tempfile
from pathlib import Path
import numpy as np
from receptance import campaign, examples
START = 54321.0
NUMBERS = (START, math.log(START), math.log10(START))
seen = {}

def holds(value, depth=0):
    if isinstance(value, str):
        return len(value) < 100 and "54321" in value
    if isinstance(value, (int, float)):
        return any(abs(value - number) < 1e-9 * number for number in NUMBERS)
    if isinstance(value, np.ndarray):
        small = value.dtype.kind == "f" and value.size < 1000
        return small and any(np.isclose(value, number, 1e-9, 0).any() for number in NUMBERS)
    if depth < 1 and isinstance(value, dict):
        return len(value) < 50 and any(holds(one, 1) for one in value.values())
    return depth < 1 and isinstance(value, (list, tuple)) and len(value) < 50 and any(holds(one, 1) for one in value)

def trace(frame, event, argument):
    file = frame.f_code.co_filename
    if "/receptance/" not in file:
        return None
    if event == "return" and (any(map(holds, list(frame.f_locals.values()))) or holds(argument)):
        seen.setdefault(file.split("/receptance/", 1)[1], []).append(frame.f_code.co_qualname)
    return trace

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
    sys.settrace(trace)
    try:
        campaign.load(folder).identify()
    finally:
        sys.settrace(None)
for file, functions in seen.items():
    print(f"{file}: {', '.join(dict.fromkeys(functions))}")
"""


def walk(root: Path) -> list[str]:
    """Return a line for each file through which a start value passes, with the functions that hold it."""
    environment = {**os.environ, "PYTHONPATH": str(root / "python")}
    done = subprocess.run([sys.executable, "-c", _WALK], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout.splitlines()


def main() -> None:
    """Print the table of a checkout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", nargs="?", type=Path, default=Path(__file__).resolve().parents[1], metavar="PATH")
    parser.add_argument("--walk", action="store_true", help="list the files through which a start value passes")
    arguments = parser.parse_args()
    root = arguments.path.resolve()
    if not (root / "python" / "receptance").is_dir():
        sys.exit(f"{root} has no python/receptance, expected a checkout of the project")
    if arguments.walk:
        found = walk(root)
        print("\n".join(found), f"{len(found)} files", sep="\n")
        return
    rows = measure(root)
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


if __name__ == "__main__":
    main()
