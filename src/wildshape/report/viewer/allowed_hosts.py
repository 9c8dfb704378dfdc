# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whom the viewer answers: pages of its own address.

Any page that is open in a browser of this machine can ask 127.0.0.1, and under a name of its own
that it lets point here (DNS rebinding) it could read the answers. What it cannot forge are the
headers Host and Origin.
"""

import http.client
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

from wildshape.errors import BadInputError, MissingExtraError

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_PORTS = {"http": 80, "https": 443}
_OTHER_HOST = "viewer-test.invalid"
_SECONDS = 10.0
_CURE = "pip install 'viser==1.1.1'"


def checked_hosts(names: Sequence[str]) -> tuple[str, ...]:
    """Names of hosts, each with a port if need be, in lower case.

    Raises:
        BadInputError: one is no such name.
    """
    for name in names:
        found = _address(f"http://{name}")
        if found is None or "*" in name:
            raise BadInputError(f"--allow-host {name}: expected NAME or NAME:PORT.")
    return tuple(name.lower() for name in names)


def is_welcome(
    hosts: Sequence[str], origins: Sequence[str], port: int, allowed: Sequence[str] = ()
) -> bool:
    """Whether a request is to be answered.

    Args:
        hosts: its headers Host.
        origins: its headers Origin; programs that are no browser send none.
        port: that it came in at.
        allowed: other names than this machine's under which it may be asked for, each at one port
            or at any.
    """
    if len(hosts) != 1 or len(origins) > 1:
        return False
    # A host without a port is at that of its scheme, which it does not say.
    host = any(_is_own(f"{scheme}://{hosts[0]}", port, allowed) for scheme in _PORTS)
    return host and all(_is_own(origin, port, allowed) for origin in origins)


def _is_own(url: str, port: int, allowed: Sequence[str]) -> bool:
    found = _address(url)
    if found is None:
        return False
    name, at = found
    own = name in _LOOPBACK and at == port
    return own or name in allowed or f"{name}:{at}" in allowed


def _address(url: str) -> tuple[str, int] | None:
    """Host and port of an origin, which is nothing but a scheme, a host and a port."""
    try:
        parts = urlsplit(url)
        usual = _PORTS[parts.scheme]
        port = parts.port or usual
    except (ValueError, KeyError):
        return None
    bare = f"{parts.scheme}://{parts.netloc}" == url and not set(parts.netloc) & set("@\\ \t")
    return (parts.hostname, port) if bare and parts.hostname else None


@contextmanager
def answering_only(allowed: Sequence[str]) -> Iterator[None]:
    """Servers of websockets that start in the block refuse all requests but welcome ones.

    viser has no option for it: what it hands to websockets is completed on the way.
    """
    from websockets.asyncio import server

    real = server.serve

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        checked = _before(process_request, allowed)
        return real(*arguments, process_request=checked, **options)

    server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        server.serve = real


def _before(inner: Callable[[Any, Any], Any] | None, allowed: Sequence[str]) -> Any:
    def process_request(connection: Any, request: Any) -> Any:
        port = connection.local_address[1]
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if not is_welcome(hosts, origins, port, allowed):
            text = f"asked for under another name than 127.0.0.1:{port}; see --allow-host\n"
            return connection.respond(403, text)
        return None if inner is None else inner(connection, request)

    return process_request


def prove(port: int) -> None:
    """Ask the viewer as a page of another host would.

    Raises:
        MissingExtraError: it answers; this viser cannot be told whom to answer.
    """
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "d2lsZHNoYXBlIHZpZXdlcg==",
    }
    own, other = f"127.0.0.1:{port}", f"http://{_OTHER_HOST}"
    for headers in ({"Host": _OTHER_HOST}, {**upgrade, "Host": own, "Origin": other}):
        if _status(port, headers) != http.client.FORBIDDEN:
            raise MissingExtraError(
                f"this version of viser answers pages of other hosts, so it is not used: {_CURE}."
            )


def _status(port: int, headers: dict[str, str]) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_SECONDS)
    try:
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status
    except (OSError, http.client.HTTPException):
        return 0
    finally:
        connection.close()
