# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The viewer answers its own page, and no other that a browser of this machine may have open."""

import http.client
import socket
from contextlib import contextmanager

import numpy as np
import pytest
from tests.report.viewer.shown import source

from wildshape.errors import BadInputError, MissingExtraError
from wildshape.report.viewer import page
from wildshape.report.viewer.allowed_hosts import checked_hosts, is_welcome

AT = 8080
OWN = ("127.0.0.1:8080", "localhost:8080", "[::1]:8080", "LocalHost:8080")
FOREIGN = (
    "evil.com",
    "evil.com:8080",
    "127.0.0.1",
    "127.0.0.1:8081",
    "localhost",
    "localhost.evil.com:8080",
    "localhost:8080@evil.com",
    "evil.com@localhost:8080",
    "evil.com#localhost:8080",
    "localhost:8080/evil.com",
    "localhost:8080?",
    "localhost.:8080",
    "0.0.0.0:8080",
    "[::]:8080",
    "127.1:8080",
    "localhost:99999",
    "localhost:x",
    "localhost:8080\t",
    "[::1",
    "",
    " ",
    "null",
)
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "d2lsZHNoYXBlIHZpZXdlcg==",
}


@pytest.mark.parametrize("host", OWN)
def test_its_own_address_is_answered(host):
    assert is_welcome([host], [], AT)
    assert all(is_welcome([host], [f"http://{other}"], AT) for other in OWN)


@pytest.mark.parametrize("name", FOREIGN)
def test_other_names_are_not(name):
    assert not is_welcome([name], [], AT)
    for origin in (f"http://{name}", f"https://{name}", name, f"http://{name}/"):
        assert not is_welcome([OWN[0]], [origin], AT)


def test_headers_that_are_missing_or_said_twice_are_refused():
    assert not is_welcome([], [], AT)
    assert not is_welcome([OWN[0], "evil.com"], [], AT)
    assert not is_welcome([OWN[0]], [f"http://{OWN[0]}", "http://evil.com"], AT)
    assert not is_welcome([OWN[0]], [f"ftp://{OWN[0]}"], AT)


@pytest.mark.parametrize("port", [-5, 65536])
def test_a_port_is_one(port):
    with (
        pytest.raises(BadInputError, match=rf"--port {port}: expected 0 to 65535"),
        page.serving(source(), port),
    ):
        pass


def test_port_80_goes_without_saying():
    assert is_welcome(["localhost"], ["http://localhost"], 80)
    assert not is_welcome(["localhost"], ["https://localhost"], 80)


def test_allowed_names():
    allowed = checked_hosts(["Tunnel.example", "127.0.0.1:9000", "tls.example:443"])
    assert is_welcome(["tunnel.example"], ["https://tunnel.example"], AT, allowed)
    assert is_welcome(["tunnel.example:7"], [], AT, allowed)
    assert is_welcome(["127.0.0.1:9000"], ["http://127.0.0.1:9000"], AT, allowed)
    assert is_welcome(["tls.example"], ["https://tls.example"], AT, allowed)
    assert not is_welcome(["tls.example"], ["http://tls.example"], AT, allowed)
    assert not is_welcome(["tls.example:8443"], [], AT, allowed)
    assert not is_welcome(["127.0.0.1:9001"], [], AT, allowed)
    assert not is_welcome(["not-tunnel.example"], [], AT, allowed)
    for wrong in ("*", "*.example", "http://a", "a/b", "a@b", "", "a:b"):
        with pytest.raises(BadInputError, match="--allow-host"):
            checked_hosts([wrong])


def status(port, **headers):
    """What a GET with these headers is answered with."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.fixture(scope="module")
def port():
    pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
    with page.serving(source(), allowed=["tunnel.example"]) as served:
        yield served.server.get_port()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_dns_rebinding_is_answered_403(port, capfd):
    rng = np.random.default_rng(0)
    names = ["".join(rng.choice(list("abcxyz.-019"), 12)) for _ in range(100)]
    for name in ("evil.com", f"evil.com:{port}", *names, *(f"{name}:{port}" for name in names)):
        assert status(port, Host=name) == 403, name
        own = {"Host": f"127.0.0.1:{port}", "Origin": f"http://{name}"}
        assert status(port, **own) == 403, name
        assert status(port, **UPGRADE, **own) == 403, name
        assert status(port, **{**UPGRADE, "Upgrade": "WebSocket"}, **own) == 403, name
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]"])
def test_its_own_page_works(port, name):
    assert status(port, Host=f"{name}:{port}") == 200
    assert status(port, Host=f"{name}:{port}", Origin=f"http://{name}:{port}") == 200
    assert status(port, Host="tunnel.example") == 200
    own = {"Host": f"{name}:{port}", "Origin": f"http://{name}:{port}"}
    assert status(port, **UPGRADE, **own) == 101


def test_only_this_machine_can_reach_it(port):
    with pytest.raises(OSError, match="refused"), socket.create_connection(("127.0.0.2", port), 5):
        pass


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_viser_that_cannot_be_told_is_not_used(monkeypatch):
    pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
    ports = []
    real = page.prove

    @contextmanager
    def unheard(_):
        yield

    def noted(port):
        ports.append(port)
        real(port)

    monkeypatch.setattr(page, "answering_only", unheard)
    monkeypatch.setattr(page, "prove", noted)
    with pytest.raises(MissingExtraError, match="answers pages of other hosts"):
        page.serving(source()).__enter__()
    with pytest.raises(OSError, match="refused"):
        status(ports[0], Host="localhost")
