# SPDX-License-Identifier: Apache-2.0
"""Connections to a page's server: from the page itself only, and not from other sites.

A browser lets every page connect to servers of its own machine. It sends the page's site in
``Origin`` (RFC 6455, section 10.2), so a connection is accepted only if that is the requested
address. A site whose name resolves to this machine (DNS rebinding) passes that check; its name is
in ``Host``, which must be an address, this machine's name, or the one that the server was given.
Programs other than browsers send no origin, and are accepted.
"""

import logging
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

_quiet_log = logging.getLogger(f"{__name__}.connections")
_quiet_log.setLevel(logging.CRITICAL)  # no traces of port scans and other visitors without HTTP
_patching = threading.Lock()


def refusal(requested: str | None, origin: str | None, host: str) -> str:
    """Why a server of ``host`` refuses a request with headers Host and Origin; else empty."""
    machine = socket.gethostname().lower()
    requested = (requested or "").lower()
    try:
        name = urlsplit(f"//{requested}").hostname or ""
        own = name in ("localhost", machine, f"{machine}.local", host.lower())
        if not own and not name.endswith(".localhost"):
            ip_address(name)  # a plain address cannot be rebound to another machine
    except ValueError:
        allowed = f"localhost, {machine}, {host} and plain addresses"
        return f"Host is {requested!r}; {allowed} are answered"
    if origin is not None and origin.partition("://")[2].lower() != requested:
        return f"the page of {origin!r} may not use the server of {requested!r}"
    return ""


@contextmanager
def same_origin_only(host: str) -> Iterator[None]:
    """Within the block, a server of viser that starts applies ``refusal``.

    Viser has no option for such a check, so the function that starts its connections is replaced
    within the block.
    """
    import websockets.asyncio.server as connections

    with _patching:
        original: Any = connections.serve

        def serve(handler: Any, *address: Any, process_request: Any, **options: Any) -> Any:
            def check(connection: Any, request: Any) -> Any:
                headers = request.headers
                if reason := refusal(headers.get("Host"), headers.get("Origin"), host):
                    return connection.respond(403, f"{reason}\n")
                return process_request(connection, request)

            return original(handler, *address, process_request=check, logger=_quiet_log, **options)

        connections.serve = serve
        try:
            yield
        finally:
            connections.serve = original
