"""Every Python block and every `receptance` line of the documents runs and prints the text below it."""

from __future__ import annotations

import contextlib
import io
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from command_line import call
from examples.documents import DOCUMENTS, ROOT, blocks, commands, difference, links
from limits import LIMIT_S


def _named(document: Path) -> str:
    return str(document.relative_to(ROOT))


WITH_PYTHON = [one for one in DOCUMENTS if any(block.language == "python" for block in blocks(one))]
WITH_COMMANDS = [one for one in DOCUMENTS if any(commands(block) for block in blocks(one))]


@pytest.mark.slow
@pytest.mark.parametrize("document", WITH_PYTHON, ids=_named)
def test_python_blocks(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of one document run in order in one namespace, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    namespace: dict[str, object] = {"__name__": "__main__"}
    for block in blocks(document):
        if block.language != "python":
            continue
        # Blank lines in front, so that a traceback names the line of the document.
        code = compile("\n" * (block.line - 1) + block.body, str(document), "exec")
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(code, namespace)
        where = f"{_named(document)}, the block at line {block.line}"
        wrong = difference(printed.getvalue(), block.shown or "")
        assert wrong is None, f"{where}: {wrong}"


@pytest.mark.slow
@pytest.mark.parametrize("document", WITH_COMMANDS, ids=_named)
def test_shell_lines(
    document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands of a document, run in their order in an empty folder, print the lines shown below them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    for block in blocks(document):
        where = f"{_named(document)}:{block.line}"
        for command in commands(block):
            code = call(*shlex.split(command)[1:])
            assert code == 0, f"{where}, {command}: exit code {code}\n{capsys.readouterr()}"
        printed = capsys.readouterr().out.splitlines()
        assert any(printed) or not commands(block), f"{where}: {block.body} prints nothing"
        for shown in (block.shown or "").splitlines() if commands(block) else ():
            assert any(difference(line, shown) is None for line in printed), f"{where} shows {shown!r}"


def test_installed_command_runs() -> None:
    program = shutil.which("receptance", path=sysconfig.get_path("scripts"))
    assert program is not None, f"there is no command `receptance` beside {sys.executable}: install the package"
    done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=LIMIT_S, check=True)
    assert done.stdout.startswith("receptance ")


@pytest.mark.parametrize("document", DOCUMENTS, ids=_named)
def test_links_resolve(document: Path) -> None:
    missing = [target for target in links(document) if not (document.parent / target).exists()]
    assert not missing, f"{_named(document)} links to {missing}, which is not there"


def test_the_readme_has_two_set_up_lines() -> None:
    """They stand in one block, and `.ci/run` finds no other line that it would take for one of them."""
    setup = [block.body.splitlines() for block in blocks(ROOT / "README.md") if "pip install" in block.body]
    assert len(setup) == 1
    assert [line.split("#")[0].strip() for line in setup[0]] == [
        "pip install . && receptance demo",
        'pip install ".[test]" && pytest -n auto',
    ]
    everywhere = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in everywhere if line.startswith("pip install ")] == setup[0]


@pytest.mark.parametrize(
    ("printed", "shown", "agrees"),
    [
        ("f1 2623.41 Hz\n", "f1  2623.40 Hz", True),
        ("f1 2623.43 Hz\n", "f1  2623.40 Hz", False),
        ("[ 1.0e-03 -2. ]", "[1.1e-03 -2.]", True),
        ("[ 1.0e-03 -2. ]", "[1.3e-03 -2.]", False),
        ("(6000,)", "(6001,)", False),
        ("converged", "did not converge", False),
        ("something", "", False),
        ("", "", True),
    ],
)
def test_comparison(printed: str, shown: str, agrees: bool) -> None:
    assert (difference(printed, shown) is None) == agrees
