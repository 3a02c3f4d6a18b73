"""One version everywhere, no import without a dependency, and an sdist that holds all it is built from."""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import importlib.resources
import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import pytest

import receptance
from metrics import circles, imports

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "python" / "receptance"
# Where the name to install is not the name to import.
DISTRIBUTION_OF: dict[str, str] = {"google_crc32c": "google-crc32c", "tomli_w": "tomli-w"}


def _toml(path: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


def _requirements(extra: str | None = None) -> set[str]:
    """Return the names of the packages that are installed with this one, or that one of its extras adds."""
    found = set()
    for line in importlib.metadata.requires("receptance") or []:
        requirement, _, marker = line.partition(";")
        named = re.search(r"""extra\s*==\s*["'](.+?)["']""", marker)
        if (named and named.group(1)) == extra:
            found.add(re.split(r"[\s<>=!~\[(]", requirement.strip(), maxsplit=1)[0].lower())
    return found


def test_there_is_one_version() -> None:
    version = _toml("Cargo.toml")["workspace"]["package"]["version"]
    assert importlib.metadata.version("receptance") == receptance.__version__ == version
    for crate in ("core", "python"):
        assert _toml(f"rust/{crate}/Cargo.toml")["package"]["version"] == {"workspace": True}
    assert "version" in _toml("pyproject.toml")["project"]["dynamic"]


def test_changelog_begins_with_unreleased_changes() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## \[(.+?)\]", text, re.MULTILINE)
    assert headings[0] == "Unreleased"
    released = [tuple(int(part) for part in heading.split(".")) for heading in headings[1:]]
    assert released == sorted(released, reverse=True)


def test_python_versions_agree() -> None:
    """Required Python version, version of the stable interface of the extension, and checked versions."""
    project = _toml("pyproject.toml")
    assert project["project"]["requires-python"] == ">=3.11"
    assert "abi3-py311" in _toml("Cargo.toml")["workspace"]["dependencies"]["pyo3"]["features"]
    metadata = importlib.metadata.metadata("receptance")
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["License-Expression"] == project["project"]["license"] == "MIT"
    assert sys.version_info >= (3, 11)


def test_the_command_is_installed() -> None:
    (script,) = importlib.metadata.entry_points(group="console_scripts", name="receptance")
    assert callable(script.load())


def test_types_are_shipped() -> None:
    package = importlib.resources.files("receptance")
    for name in ("py.typed", "_core.pyi"):
        assert package.joinpath(name).is_file()


@functools.cache
def _imports() -> dict[str, set[str]]:
    """Return the packages from outside that the library imports, and where."""
    found: dict[str, set[str]] = {}
    for path in sorted(LIBRARY.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names = [node.module]
            for name in names:
                top = name.partition(".")[0]
                if top != "receptance" and top not in sys.stdlib_module_names:
                    found.setdefault(top, set()).add(path.relative_to(LIBRARY).as_posix())
    return found


def test_imported_packages_are_dependencies() -> None:
    """`pip install .` installs the requirements of every module, the command line and the figures."""
    needed = {DISTRIBUTION_OF.get(name, name).lower(): places for name, places in _imports().items()}
    missing = {name: sorted(places) for name, places in needed.items() if name not in _requirements()}
    # Packages of an extra are imported in one place, whose error says how to install them.
    assert missing == {"distributed": ["sweep/run.py"], "emcee": ["identification/sampling.py"]}
    extras = _toml("pyproject.toml")["project"]["optional-dependencies"]
    for extra, package in (("dask", "dask[distributed]"), ("sampling", "emcee")):
        assert all(any(line.startswith(package) for line in extras[name]) for name in (extra, "test"))
    assert {"numpy", "scipy"} <= needed.keys()


def test_dependencies_are_imported() -> None:
    unused = _requirements() - {DISTRIBUTION_OF.get(name, name).lower() for name in _imports()}
    assert not unused, f"dependencies that no module imports: {sorted(unused)}"


def test_the_extra_for_tests_brings_the_tools() -> None:
    assert {"pytest", "pytest-benchmark", "hypothesis", "mpmath", "mypy", "ruff", "maturin"} <= _requirements("test")


def test_sdist_contains_all_build_inputs(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "maturin", "sdist", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.fail(f"maturin sdist: {done.stderr}")
    (archive,) = tmp_path.glob("receptance-*.tar.gz")
    with tarfile.open(archive) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    expected = {"pyproject.toml", "Cargo.toml", "Cargo.lock", "README.md", "LICENSE"}
    for folder, kinds in (("rust", (".rs", ".toml")), ("python", (".py", ".pyi", ".typed", ".csv", ".toml", ".json"))):
        files = (path for path in (ROOT / folder).rglob("*") if path.suffix in kinds or path.name == "py.typed")
        expected |= {path.relative_to(ROOT).as_posix() for path in files}
    missing = {name for name in expected - names if not name.startswith("rust/core/benches/")}
    assert not missing
    assert not {name for name in names if name.endswith((".so", ".pyc")) or name.startswith("target/")}


def test_no_modules_import_each_other() -> None:
    """`lint-imports` checks the layers of packages; this checks the modules within each as well."""
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"d"}}) == [["b", "c"], ["d"]]
    edges = imports(LIBRARY)
    assert "receptance.diagnosis.judgement" in edges["receptance.diagnosis.verdict"]  # inside a function
    assert circles(edges) == []
