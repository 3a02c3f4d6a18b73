"""The server of the page: who may open it, and when it ends; without a browser."""

from __future__ import annotations

import re
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from browser_page import Served, served
from receptance import examples
from receptance.errors import require

_HANDSHAKE = (
    "GET {path}ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: bokeh, {token}\r\n{origin}\r\n"
)


@pytest.fixture(scope="module", autouse=True)
def _with_the_extra() -> None:
    try:
        require("app", "the page")
    except ImportError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("page")
    examples.write("er32", folder)
    with served(folder) as running:
        yield running


def _status(address: str) -> int:
    try:
        with urllib.request.urlopen(address) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return int(error.code)


def _handshake(server: Served, origin: str | None, path: str = "") -> int:
    """Return the status with which a websocket is answered that knows all that the page knows."""
    with urllib.request.urlopen(server.address) as answer:
        found = re.search(r'"token":"([^"]+)"', answer.read().decode())
    assert found
    host, _, token = server.address.removeprefix("http://").partition("/")
    with socket.create_connection((host.partition(":")[0], int(host.partition(":")[2]))) as connection:
        line = "" if origin is None else f"Origin: {origin}\r\n"
        connection.sendall(_HANDSHAKE.format(path=path or f"/{token}", host=host, origin=line, token=found[1]).encode())
        return int(connection.recv(64).split()[1])


def test_only_the_address_with_the_token_is_answered(server: Served) -> None:
    token = server.address.rsplit("/", 2)[1]
    assert len(token) >= 32
    assert _status(server.address) == 200
    for path in ("/", "/ws", "/static/js/bokeh.min.js", "/autoload.js", f"/{token[:-1]}/", f"/{token}x/", "/../"):
        assert _status(server.base + path) == 404, path


def test_no_file_of_the_folder_is_served(server: Served) -> None:
    for path in ("campaign.toml", "../campaign.toml", "static/../campaign.toml", "static/../../../../../etc/passwd"):
        assert _status(server.address + path) in (403, 404), path


def test_websockets_of_other_origins_are_refused(server: Served) -> None:
    port = server.base.rpartition(":")[2]
    for origin in ("http://example.org", f"http://localhost:{port}", "http://127.0.0.1:1", "null"):
        assert _handshake(server, origin) == 403, origin
    assert _handshake(server, server.base) == 101
    assert _handshake(server, server.base, "/ws") == 404


def test_no_other_machine_can_connect(server: Served) -> None:
    assert server.base.startswith("http://127.0.0.1:")
    port = int(server.base.rpartition(":")[2])
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), port, socket.AF_INET)}
    for address in others - {"127.0.0.1"}:
        with pytest.raises(OSError), socket.create_connection((address, port), timeout=1.0):  # noqa: PT011
            pass


def test_two_servers_have_two_addresses(server: Served) -> None:
    with served(server.folder) as other:
        assert other.base != server.base
        assert other.address.rsplit("/", 2)[1] != server.address.rsplit("/", 2)[1]


def test_a_program_that_asks_for_the_page_and_shows_nothing_ends_nothing(tmp_path: Path) -> None:
    with served(tmp_path) as running:
        assert _status(running.address) == 200
        assert _handshake(running, running.base) == 101
        assert running.process.poll() is None
        assert _status(running.address) == 200


def test_ctrl_c_ends_it_without_a_traceback(tmp_path: Path) -> None:
    with served(tmp_path) as running:
        running.interrupt()
        assert running.code(60.0) == 0
