"""The command `open`: the page of a folder in the browser."""

from __future__ import annotations

import os
import threading
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

import receptance
from receptance.cli.running import InputError, input_errors, output
from receptance.errors import require

_HOME = Path(".")


def open_page(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a campaign, or of measured files; by default this one.")
    ] = _HOME,
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Port; by default, or with 0, a free one.")
    ] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address, and open no browser.")] = False,
) -> None:
    """Open the page of a folder in the browser: see, move and diagnose its campaign.

    Only this machine can open the address. The command ends with the last tab, or with Ctrl-C.
    """
    require("app", "the page in the browser")
    _check_folder(folder)

    def shown(address: str) -> None:
        # In one line and at once, so that a terminal makes it a link and a program can read it.
        output(quiet=False).out(address, highlight=False)
        if not no_browser:
            # Beside the server: a browser of the terminal runs until it is closed, and others take seconds to start.
            threading.Thread(target=_browse, args=(address,), daemon=True).start()

    with input_errors(OSError):
        try:
            receptance.app.serve(folder, shown, port=port)
        except OSError as error:
            if port == 0:
                raise
            raise InputError(f"--port is {port}: {error.strerror or error}; leave it out for a free port") from None


def _browse(address: str) -> None:
    if not webbrowser.open(address):
        output(stderr=True).print("no browser was found; open the address in one on this machine", soft_wrap=True)


def _check_folder(folder: Path) -> None:
    """Raise `InputError` for what is no folder, or cannot be read."""
    if folder.is_file():
        home = folder.parent.as_posix()
        raise InputError(f"{folder} is a file, expected a folder: receptance open {home}")
    if not folder.exists():
        raise InputError(f"there is no folder {folder}; for an empty one: mkdir {folder.as_posix()}")
    with input_errors(OSError), os.scandir(folder):
        pass  # it can be listed
