"""`receptance open`: what it refuses, and the browser that it starts."""

from __future__ import annotations

import gc
import os
import socket
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import receptance
from command_line import call
from receptance.errors import require


@pytest.fixture(autouse=True)
def _with_the_extra() -> None:
    require("app", "the page")


def _message(capsys: pytest.CaptureFixture[str]) -> str:
    text = " ".join(capsys.readouterr().err.split())
    assert "Traceback" not in text
    return text


def test_a_folder_that_does_not_exist_is_named_with_what_to_type(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "none"
    assert call("open", folder) == 2
    assert f"there is no folder {folder}; for an empty one: mkdir {folder}" in _message(capsys)
    assert not folder.exists()


def test_of_a_file_the_folder_is_to_be_opened(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "campaign.toml"
    file.touch()
    assert call("open", file) == 2
    assert f"{file} is a file, expected a folder: receptance open {tmp_path}" in _message(capsys)


def test_a_folder_without_rights_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(path: Path) -> Any:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", refused)  # the user of the tests may have all rights
    assert call("open", tmp_path) == 2
    assert f"{tmp_path}: Permission denied" in _message(capsys)


# Tornado leaves the socket that it could not bind to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_port_that_is_taken_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert call("open", tmp_path, "--port", port, "--no-browser") == 2
    gc.collect()
    message = _message(capsys)
    assert f"--port is {port}: " in message
    assert "leave it out for a free port" in message


@pytest.mark.parametrize("options", [(), ("--no-browser",)])
def test_the_address_is_printed_and_opened(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []
    is_opened = threading.Event()

    def browse(address: str) -> bool:
        opened.append(address)
        is_opened.set()
        return True

    def serve(folder: Path, shown: Callable[[str], None], *, port: int) -> None:
        assert (folder, port) == (tmp_path, 0)
        shown("http://127.0.0.1:1/token/")
        assert options or is_opened.wait(60.0)

    monkeypatch.setattr(webbrowser, "open", browse)
    monkeypatch.setattr(receptance.app, "serve", serve)
    assert call("open", tmp_path, *options) == 0
    assert capsys.readouterr().out == "http://127.0.0.1:1/token/\n"
    assert opened == ([] if options else ["http://127.0.0.1:1/token/"])


def test_the_page_of_a_campaign_needs_a_notebook(tmp_path: Path) -> None:
    receptance.examples.write("er32", tmp_path)
    with pytest.raises(receptance.ReceptanceError, match=f"in a terminal: receptance open {tmp_path}"):
        receptance.campaign.load(tmp_path).open()
