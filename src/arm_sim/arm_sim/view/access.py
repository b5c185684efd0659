# SPDX-License-Identifier: Apache-2.0
"""Access control of the page: pages of other sites in the same browser are refused.

A browser lets every page connect to servers of its own machine. It sends the page's site in
``Origin`` (RFC 6455, section 10.2), so a connection is accepted only if that is the requested
address. A site whose name resolves to this machine (DNS rebinding) passes that check; its name is
in ``Host``, which must be an address, this machine's name, or the one that the server was given.
Programs other than browsers send no origin, and are accepted; of what speaks no HTTP, such as a
scan of ports, one line is logged.
"""

from __future__ import annotations

import contextlib
import html
import logging
import socket
import threading
from collections.abc import Callable, Iterator
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any
from urllib.parse import SplitResult, urlsplit

_PORTS = {"http": 80, "https": 443}
_starting = threading.Lock()
_log = logging.getLogger(__name__)


def refusal(asked: str | None, origin: str | None, host: str) -> str:
    """Reason why a request is refused; empty if it is accepted.

    Args:
        asked: Its header ``Host``: the address that the browser opened.
        origin: Its header ``Origin``: the site of the requesting page; None from other programs.
        host: Address that the server listens on.
    """
    try:
        address = urlsplit(f"//{asked or ''}")
        site = None if origin is None else urlsplit(origin)
        if not _means_this_machine(address.hostname, host):
            return f"Host is {asked!r}; {_known(host)} and plain addresses are answered"
        if site is not None and not _same(site, address):
            return f"the page of {origin!r} may not use the server of {asked!r}"
    except ValueError as error:
        return f"Host {asked!r} or Origin {origin!r} cannot be read: {error}"
    return ""


def _known(host: str) -> str:
    return f"localhost, {socket.gethostname()} or {host}"


def _means_this_machine(name: str | None, host: str) -> bool:
    if name is None:
        return False
    own = socket.gethostname().lower()
    if name in ("localhost", own, f"{own}.local", host.lower()) or name.endswith(".localhost"):
        return True
    try:
        ip_address(name)
    except ValueError:
        return False
    return True  # a plain address cannot be rebound to another machine


def _same(site: SplitResult, address: SplitResult) -> bool:
    usual = _PORTS.get(site.scheme)
    return site.hostname == address.hostname and (site.port or usual) == (address.port or usual)


@contextlib.contextmanager
def refusing(host: str, title: str) -> Iterator[None]:
    """Within the block, a server of viser that starts applies ``refusal``.

    Viser has no option for such a check in its connection library, nor for where that logs, nor
    for the title of its page, so the function that starts that library is replaced within the
    block.

    Args:
        host: Address that it listens on.
        title: Title of its page.
    """
    import websockets.asyncio.server as library

    _log.addFilter(_brief)
    with _starting:
        usual: Any = library.serve

        def serve(handler: Any, *where: Any, process_request: Any = None, **options: Any) -> Any:
            check = _checked(process_request, host, title)
            return usual(handler, *where, process_request=check, logger=_log, **options)

        library.serve = serve
        try:
            yield
        finally:
            library.serve = usual


def _brief(record: logging.LogRecord) -> bool:
    """Shorten the report of a visitor that speaks no HTTP, which the library logs with a trace."""
    from websockets.exceptions import InvalidHandshake

    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, InvalidHandshake | EOFError | ConnectionError):
        record.msg, record.args = "a visitor of the view spoke no HTTP: %s", (error,)
        record.levelno, record.levelname = logging.INFO, logging.getLevelName(logging.INFO)
        record.exc_info = None
    return record.levelno >= _log.getEffectiveLevel()


def titled(page: bytes, title: str) -> bytes:
    """A page of viser with a title of its own."""
    named = f"<title>{html.escape(title)}</title>"
    return page.replace(b"<title>Viser</title>", named.encode(), 1)


def _checked(
    answer: Callable[[Any, Any], Any] | None, host: str, title: str
) -> Callable[[Any, Any], Any]:
    def check(connection: Any, request: Any) -> Any:
        why = refusal(request.headers.get("Host"), request.headers.get("Origin"), host)
        if why:
            return connection.respond(HTTPStatus.FORBIDDEN, f"{why}\n")
        request.headers.pop("Accept-Encoding", None)  # the page is compressed in itself
        response = None if answer is None else answer(connection, request)
        if response is not None and "Content-Length" in response.headers:
            response.body = titled(response.body, title)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        return response

    return check
