# SPDX-License-Identifier: Apache-2.0
"""The page's server: on this machine by default, and serving only the page."""

from __future__ import annotations

import contextlib
import errno
import logging
import socket
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from arm_dynamics.exceptions import missing
from arm_sim.exceptions import ViewError
from arm_sim.view.access import refusing

if TYPE_CHECKING:
    import viser

HERE = "127.0.0.1"
PORT = 8080
CONTROLS = 320  # width of the panel of controls in pixels
ROOMY = "<style>.mantine-Slider-root + .mantine-NumberInput-root {width: 4rem !important}</style>"
"""Boxes of sliders wide enough for eight digits; those of the library hold five."""
TRIED = 50  # ports tried after the default one

_log = logging.getLogger(__name__)


def library() -> Any:
    """The visualization library.

    Raises:
        ViewError: If it is not installed.
    """
    for module in ("viser", "collada", "playwright"):
        if find_spec(module) is None:
            raise ViewError(missing(module, "view"))
    import viser

    return viser


def open_server(label: str, host: str = HERE, port: int | None = None) -> viser.ViserServer:
    """Serve an empty page.

    Args:
        label: Heading of its panel, and title of the page.
        host: Address to listen on; ``0.0.0.0`` lets every machine of the network control it.
        port: Port; None for 8080 or the next free one, which is logged.

    Raises:
        ViewError: If the library is missing, or the address or port cannot be used.
    """
    make, chosen = library().ViserServer, _free_port(host, port)
    with _silent(), refusing(host, label):
        server: viser.ViserServer = make(host=host, port=chosen, label=label, verbose=False)
    if server.get_port() != chosen:
        close_server(server)
        raise ViewError(f"port {chosen} of {host} was just taken by another process; try again")
    # The library can publish the page through a tunnel, on request of any visitor.
    server.request_share_url = lambda verbose=True: None
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    server.gui.main_panel.dock_right()  # beside the picture, not over it
    server.gui.main_panel.set_width(CONTROLS)
    server.gui.add_html(ROOMY)
    return server


def close_server(server: viser.ViserServer) -> None:
    """End a server silently."""
    with _silent():
        server.stop()


def address(server: viser.ViserServer) -> str:
    """URL for a browser."""
    host = server.get_host()
    return f"http://{'localhost' if host == '0.0.0.0' else host}:{server.get_port()}"


def _free_port(host: str, port: int | None) -> int:
    if port is not None and not (isinstance(port, int) and 0 <= port <= 65535):
        raise ViewError(f"port = {port!r}; allowed: 1 to 65535, and 0 for any that is free")
    first = PORT if port is None else port
    for candidate in range(first, first + (TRIED if port is None else 1)):
        try:
            with socket.socket() as trial:
                trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                trial.bind((host, candidate))
                found = int(trial.getsockname()[1])
        except OSError as error:
            trouble = error
            if error.errno == errno.EADDRINUSE:
                continue
            break  # the next port has the same trouble
        if found != first and first:
            _log.warning("port %d is taken; the view is at port %d", first, found)
        return found
    if trouble.errno == errno.EADDRINUSE:
        tried = "" if port else f" to {first + TRIED - 1}"
        raise ViewError(
            f"port {first}{tried} of {host} is taken, perhaps by another view; end it, or choose "
            "another port (0: any that is free)"
        )
    raise ViewError(f"port {first} of {host} cannot be used: {trouble.strerror or trouble}")


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
