# SPDX-License-Identifier: Apache-2.0
"""The page's server: on this machine by default, and for no page but its own.

A browser lets every page connect to servers of its own machine. It sends the page's site in
``Origin`` (RFC 6455, section 10.2), so a connection is accepted only if that is the requested
address. A site whose name resolves to this machine (DNS rebinding) passes that check; its name is
in ``Host``, which must be an address, this machine's name, or the one that the server was given.
Programs other than browsers send no origin, and are accepted.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import socket
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from arm_dynamics.exceptions import missing
from arm_sim.exceptions import ViewError

if TYPE_CHECKING:
    import viser

HERE = "127.0.0.1"
PORT, TRIED = 8080, 50  # the default port, and how many after it are tried
CONTROLS = 320  # width of the panel of controls in pixels
ROOMY = "<style>.mantine-Slider-root + .mantine-NumberInput-root {width: 4rem !important}</style>"
"""Boxes of sliders wide enough for eight digits; those of the library hold five."""

_log = logging.getLogger(__name__)
_visitors = logging.getLogger(f"{__name__}.visitors")
_visitors.setLevel(logging.CRITICAL)  # no traces of port scans and other visitors without HTTP
_starting = threading.Lock()


def library() -> Any:
    """The visualization library, or a ViewError."""
    for module in ("viser", "collada", "playwright"):
        if find_spec(module) is None:
            raise ViewError(missing(module, "view"))
    import viser

    return viser


def open_server(label: str, host: str = HERE, port: int | None = None) -> viser.ViserServer:
    """Serve an empty page of this title; its port is 8080 or the next free one unless given.

    Raises:
        ViewError: If the library is missing, or the address or port cannot be used.
    """
    make, chosen = library().ViserServer, _free_port(host, port)
    from viser._messages import RunJavascriptMessage

    with _silent(), _refusing(host):
        server: viser.ViserServer = make(host=host, port=chosen, label=label, verbose=False)
    # The library can publish the page through a tunnel, on request of any visitor.
    server.request_share_url = lambda verbose=True: None
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    server.gui.main_panel.dock_right()  # beside the picture, not over it
    server.gui.main_panel.set_width(CONTROLS)
    server.gui.add_html(ROOMY)
    # The library has no option for the title, which a page that is written to a file has, too.
    title = RunJavascriptMessage(f"document.title = {json.dumps(label)}")
    server.gui._websock_interface.queue_message(title)
    return server


def close_server(server: viser.ViserServer) -> None:
    """End a server silently."""
    with _silent():
        server.stop()


def address(server: viser.ViserServer) -> str:
    """URL for a browser."""
    host = {"0.0.0.0": "localhost", "::": "::1"}.get(server.get_host(), server.get_host())
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"


def refusal(asked: str | None, origin: str | None, host: str) -> str:
    """Why a server of ``host`` refuses a request with headers Host and Origin; else empty."""
    machine = socket.gethostname().lower()
    asked = (asked or "").lower()
    try:
        name = urlsplit(f"//{asked}").hostname or ""
        known = name in ("localhost", machine, f"{machine}.local", host.lower())
        if not known and not name.endswith(".localhost"):
            ip_address(name)  # a plain address cannot be rebound to another machine
    except ValueError:
        return f"Host is {asked!r}; localhost, {machine}, {host} and plain addresses are answered"
    if origin is not None and origin.partition("://")[2].lower() != asked:
        return f"the page of {origin!r} may not use the server of {asked!r}"
    return ""


@contextlib.contextmanager
def _refusing(host: str) -> Iterator[None]:
    """Within the block, a server of viser that starts applies ``refusal``.

    Viser has no option for such a check, so the function that starts its connections is replaced
    within the block.
    """
    import websockets.asyncio.server as connections

    with _starting:
        usual: Any = connections.serve

        def serve(handler: Any, *where: Any, process_request: Any, **options: Any) -> Any:
            def check(connection: Any, request: Any) -> Any:
                headers = request.headers
                if why := refusal(headers.get("Host"), headers.get("Origin"), host):
                    return connection.respond(403, f"{why}\n")
                return process_request(connection, request)

            return usual(handler, *where, process_request=check, logger=_visitors, **options)

        connections.serve = serve
        try:
            yield
        finally:
            connections.serve = usual


def _free_port(host: str, port: int | None) -> int:
    """A port that can be used; viser would try others, and forever at a wrong address."""
    first = PORT if port is None else port
    for candidate in range(first, first + (TRIED if port is None else 1)):
        try:
            family = socket.getaddrinfo(host, None)[0][0]
            with socket.create_server((host, candidate), family=family) as trial:
                found = int(trial.getsockname()[1])
        except (OSError, OverflowError) as error:
            trouble = getattr(error, "strerror", None) or error
            if taken := getattr(error, "errno", None) == errno.EADDRINUSE:
                continue
            break  # the next port has the same trouble
        if found != first and first:
            _log.warning("port %d is taken; the view is at port %d", first, found)
        return found
    if taken:
        raise ViewError(
            f"port {first} of {host} is taken, perhaps by another view; end it, or choose "
            "another port (0: any that is free)"
        )
    raise ViewError(f"port {first} of {host} cannot be used: {trouble}")


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Suppress the library's own tables, but not the output of other threads.

    It prints through rich's global console, which the suite does not use otherwise.
    """
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
