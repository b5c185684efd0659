# SPDX-License-Identifier: Apache-2.0
"""The page's server: its address, what it serves, and its errors."""

import socket
import urllib.error
import urllib.request
from typing import Any

import pytest
import rich

from arm_sim.exceptions import ViewError
from arm_sim.view import pictures, show
from arm_sim.view.same_origin import refusal
from arm_sim.view.server import address, close_server, open_server


def test_without_the_library_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arm_sim.view.server.find_spec", lambda name: None)
    with pytest.raises(ViewError, match="cannot find the module 'viser': .*view.* installs it"):
        show("two_link")


NAME = socket.gethostname()


@pytest.mark.parametrize(("requested", "origin", "host", "let_in"), [
    ("127.0.0.1:8080", None, "127.0.0.1", True),  # no browser
    ("localhost:9000", "http://localhost:9000", "127.0.0.1", True),  # forwarded by ssh
    ("[::1]:8080", "http://[::1]:8080", "::1", True),
    (f"{NAME}:8080", f"http://{NAME.lower()}:8080", "0.0.0.0", True),
    ("robot.lab:8080", "http://robot.lab:8080", "robot.lab", True),
    ("127.0.0.1:8080", "http://127.0.0.1:9999", "127.0.0.1", False),  # another server here
    ("127.0.0.1:8080", "null", "127.0.0.1", False),  # a file, or a frame in a sandbox
    ("evil.example:8080", "http://evil.example:8080", "127.0.0.1", False),  # rebound name
])  # fmt: skip
def test_pages_of_other_sites_are_refused(
    requested: str | None, origin: str | None, host: str, let_in: bool
) -> None:
    assert (refusal(requested, origin, host) == "") is let_in


def test_without_a_browser_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("ARM_BROWSER", raising=False)
    with pytest.raises(ViewError, match="no browser for pictures.*apt install chromium"):
        pictures.browser()
    monkeypatch.setenv("ARM_BROWSER", "/no/such/browser")
    with pytest.raises(ViewError, match="ARM_BROWSER = '/no/such/browser' is not a program"):
        pictures.browser()


@pytest.mark.group("view")
def test_a_port_that_is_taken_is_refused_or_by_default_the_next_one_used(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ViewError, match=r"port 8080 of 192\.0\.2\.1 cannot be used: .*assign"):
        open_server("arm", host="192.0.2.1")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ViewError, match=f"port {port} of 127.0.0.1 is taken, perhaps by"):
            open_server("arm", port=port)
        monkeypatch.setattr("arm_sim.view.server.PORT", port)
        server = open_server("arm")
        assert server.get_port() > port
        assert f"port {port} is taken" in caplog.text
        close_server(server)


@pytest.mark.group("view")
def test_a_page_on_an_ipv6_address() -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no IPv6")
    server = open_server("arm", host="::", port=0)
    assert address(server) == f"http://[::1]:{server.get_port()}"
    with urllib.request.urlopen(address(server), timeout=10) as page:
        assert page.status == 200
    close_server(server)


@pytest.mark.group("view")
def test_nothing_but_the_page_is_served_and_only_here(server: Any) -> None:
    assert server.get_host() == "127.0.0.1"
    with urllib.request.urlopen(address(server), timeout=10) as page:
        assert b"</html>" in page.read()[-20:]
    for path in ("/etc/passwd", "/%2e%2e/%2e%2e/_viser.py"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(address(server) + path, timeout=10)
        assert refused.value.code == 404
        refused.value.close()
    assert server.request_share_url() is None  # no tunnel to the world


@pytest.mark.group("view")
def test_a_server_prints_nothing_also_of_visitors_without_http(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    console, server = rich.get_console(), open_server("arm", port=0)
    for words in (b"", b"hello\n"):
        with socket.create_connection(("127.0.0.1", server.get_port())) as wire:
            wire.sendall(words)
            wire.shutdown(socket.SHUT_WR)
            assert wire.recv(100) == b""
    with urllib.request.urlopen(address(server), timeout=10) as page:
        assert page.status == 200
    close_server(server)
    assert not caplog.records and "".join(capfd.readouterr()) == "" and not console.quiet


@pytest.mark.group("view")
def test_only_its_own_page_and_programs_connect(server: Any) -> None:
    import viser
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    own = f"ws://127.0.0.1:{server.get_port()}"
    given: dict[str, Any] = {"max_size": None, "subprotocols": [f"viser-v{viser.__version__}"]}
    with connect(own, **given) as connection:
        assert connection.recv(timeout=10)
    with pytest.raises(InvalidStatus, match="403"):
        connect(own, origin="http://evil.example", **given)
    rebound = urllib.request.Request(address(server), headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="403") as refused:
        urllib.request.urlopen(rebound, timeout=10)
    assert b"Host is 'evil.example'" in refused.value.read()
    refused.value.close()
