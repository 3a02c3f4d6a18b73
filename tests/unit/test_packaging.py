"""One version everywhere, no import without a dependency, and an sdist that holds all it is built from."""

from __future__ import annotations

import ast
import functools
import importlib
import importlib.metadata
import importlib.resources
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import pytest

import receptance
from metrics import circles, exported_lazily, imports, modules
from receptance.errors import EXTRAS

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "python" / "receptance"
# Where the name to install is not the name to import.
DISTRIBUTION_OF: dict[str, str] = {
    "lazy_loader": "lazy-loader",
    "tomli_w": "tomli-w",
}


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
            if inner := re.match(r"receptance\[(.+?)\]", requirement):
                found |= set().union(*(_requirements(one.strip()) for one in inner[1].split(",")))
    return found - {"receptance"}


def test_there_is_one_version() -> None:
    version = _toml("Cargo.toml")["workspace"]["package"]["version"]
    assert importlib.metadata.version("receptance") == receptance.__version__ == version
    for crate in ("core", "python"):
        assert _toml(f"rust/{crate}/Cargo.toml")["package"]["version"] == {"workspace": True}
    assert "version" in _toml("pyproject.toml")["project"]["dynamic"]


def test_the_citation_has_the_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.+)$", text, re.MULTILINE)[1] == receptance.__version__  # type: ignore[index]
    assert re.search(r"^license: (.+)$", text, re.MULTILINE)[1] == _toml("pyproject.toml")["project"]["license"]  # type: ignore[index]


def test_a_release_is_published_after_everything_else() -> None:
    yaml = pytest.importorskip("yaml", reason="the workflow is a YAML file; PyYAML comes with the extra `dask`")
    jobs = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))["jobs"]
    assert set(jobs["publish"]["needs"]) == jobs.keys() - {"publish"}
    assert jobs["publish"]["if"] == "startsWith(github.ref, 'refs/tags/')"
    allowed = {name for name, job in jobs.items() if "id-token" in job.get("permissions", {})}
    assert allowed == {"publish"}
    assert not re.search(r"secrets\.", (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))


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
    optional = set().union(*EXTRAS.values())
    needed = {DISTRIBUTION_OF.get(name, name).lower() for name in _imports().keys() - optional}
    assert needed == _requirements(), "imported, and the dependencies"
    assert {"numpy", "scipy"} <= needed


def test_packages_of_extras_are_listed_in_both_places() -> None:
    """`receptance.errors` names the extra in errors, pyproject.toml its packages."""
    extras = _toml("pyproject.toml")["project"]["optional-dependencies"]
    assert extras.keys() - {"all", "docs", "test"} == EXTRAS.keys()
    for extra, names in EXTRAS.items():
        own = {"dask" if name == "distributed" else DISTRIBUTION_OF.get(name, name) for name in names}
        if extra == "dask":
            own |= {DISTRIBUTION_OF.get(name, name) for name in EXTRAS["sweep"]}
        assert _requirements(extra) == own
        assert _requirements(extra) <= _requirements("all") <= _requirements("test")


def test_optional_packages_are_checked_where_they_are_imported() -> None:
    """A module that imports a package of an extra, the one that starts it, or its package has `require`."""
    started_by = {"io/_worker.py": "io/mat_hdf5.py"}
    for extra, names in EXTRAS.items():
        for path in set().union(*(_imports()[name] for name in names if name in _imports())):
            module = LIBRARY / started_by.get(path, path)
            source = "".join(file.read_text(encoding="utf-8") for file in (module, module.parent / "__init__.py"))
            typed_only = path in ("campaign/comparison.py", "sweep/figure.py", "frf/frf.py")
            assert typed_only or f'require("{extra}"' in source, path


@pytest.mark.skipif(shutil.which("cargo") is None, reason="an sdist needs cargo, which a wheel does not")
def test_sdist_contains_all_build_inputs(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "maturin", "sdist", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.fail(f"maturin sdist: {done.stderr}")
    (archive,) = tmp_path.glob("receptance-*.tar.gz")
    with tarfile.open(archive) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    expected = {"pyproject.toml", "Cargo.toml", "Cargo.lock", "README.md", "LICENSE"}
    for folder, kinds in (
        ("rust", (".rs", ".toml")),
        ("python", (".py", ".pyi", ".typed", ".csv", ".dxf", ".toml", ".json", ".html", ".css", ".js")),
    ):
        files = (path for path in (ROOT / folder).rglob("*") if path.suffix in kinds or path.name == "py.typed")
        expected |= {path.relative_to(ROOT).as_posix() for path in files}
    missing = {name for name in expected - names if not name.startswith("rust/core/benches/")}
    assert not missing
    assert not {name for name in names if name.endswith((".so", ".pyc")) or name.startswith("target/")}


def test_no_modules_import_each_other() -> None:
    """`lint-imports` checks the layers of packages; this checks the modules within each as well, types included."""
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"d"}}) == [["b", "c"], ["d"]]
    edges = imports(modules(LIBRARY), exported_lazily(LIBRARY), types=True)
    assert "receptance.cli.app" in edges["receptance.cli.__main__"]  # inside a function
    assert circles(edges) == []


LAZY = sorted(path.parent for path in LIBRARY.rglob("__init__.pyi"))
"""Packages whose names are imported at first use, from a stub file that type checkers and editors read."""


@pytest.mark.parametrize("folder", LAZY, ids=lambda folder: folder.name)
def test_names_of_a_stub_file_are_those_of_the_package(folder: Path) -> None:
    package = importlib.import_module(".".join(folder.relative_to(LIBRARY.parent).parts))
    stub = ast.parse((folder / "__init__.pyi").read_text(encoding="utf-8"))
    imported = {
        name.name: f"{package.__name__}.{node.module or name.name}"
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    assert set(package.__all__) == set(dir(package)) == set(imported)
    for name, module in imported.items():
        home = importlib.import_module(module)
        assert getattr(package, name) is (home if module == f"{package.__name__}.{name}" else getattr(home, name))
    with pytest.raises(AttributeError, match="no_such_name"):
        package.no_such_name  # noqa: B018


def _loaded(code: str) -> set[str]:
    """Return the packages from outside that a new interpreter has loaded after some code."""
    printed = "print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\n{printed}"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split()) - set(sys.stdlib_module_names)


def test_imports_load_little() -> None:
    """Names are imported at first use; a command loads what it needs."""
    assert not _loaded("import receptance") & {"numpy", "scipy"}
    model = _loaded("from receptance import Assembly, Part, identify, FRF")
    assert "numpy" in model
    assert not model & {"typer", "rich", "matplotlib", "pandas", "xarray"}
    # rich, for the help of all commands, is loaded by typer.
    assert not _loaded("import receptance.cli") & {"numpy", "matplotlib"}


def test_only_modules_of_figures_load_matplotlib() -> None:
    code = (
        "import importlib, pkgutil, receptance\n"
        "for module in pkgutil.walk_packages(receptance.__path__, 'receptance.'):\n"
        "    if not module.name.endswith(('.figure', '__main__', '._core')):\n"
        "        importlib.import_module(module.name)"
    )
    assert "matplotlib" not in _loaded(code)
