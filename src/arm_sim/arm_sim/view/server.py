# SPDX-License-Identifier: Apache-2.0
"""The page's server: on this machine by default, and for no page but its own."""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import socket
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from arm_dynamics.exceptions import missing
from arm_sim.exceptions import ViewError
from arm_sim.view.same_origin import same_origin_only

if TYPE_CHECKING:
    import viser

HERE = "127.0.0.1"
PORT, PORT_COUNT = 8080, 50  # the default port, and how many from it on are tried
CONTROLS = 320  # width of the panel of controls in pixels
# Boxes of sliders wide enough for eight digits; those of the library hold five
ROOMY = "<style>.mantine-Slider-root + .mantine-NumberInput-root {width: 4rem !important}</style>"

_log = logging.getLogger(__name__)


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
    make, free = library().ViserServer, _free_port(host, port)
    from viser._messages import RunJavascriptMessage

    with _silent(), same_origin_only(host):
        server: viser.ViserServer = make(host=host, port=free, label=label, verbose=False)
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


def _free_port(host: str, port: int | None) -> int:
    """A port that can be used; viser would try others, and forever at a wrong address."""
    first = PORT if port is None else port
    for candidate in range(first, first + (PORT_COUNT if port is None else 1)):
        try:
            family = socket.getaddrinfo(host, None)[0][0]
            with socket.create_server((host, candidate), family=family) as trial:
                free = int(trial.getsockname()[1])
        except (OSError, OverflowError) as error:
            if getattr(error, "errno", None) == errno.EADDRINUSE:
                continue
            reason = getattr(error, "strerror", None) or error
            raise ViewError(f"port {first} of {host} cannot be used: {reason}") from None
        if free != first and first:
            _log.warning("port %d is taken; the view is at port %d", first, free)
        return free
    raise ViewError(
        f"port {first} of {host} is taken, perhaps by another view; end it, or choose "
        "another port (0: any that is free)"
    )


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
