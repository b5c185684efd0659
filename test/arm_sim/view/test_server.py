# SPDX-License-Identifier: Apache-2.0
"""The page's server: where it listens, what it serves, what it says where it cannot."""

from __future__ import annotations

import builtins
import logging
import socket
import urllib.error
import urllib.request
from typing import Any

import pytest

from arm_sim import Simulator
from arm_sim.exceptions import ViewError
from arm_sim.view import pictures
from arm_sim.view.server import PORT, address, close_server, open_server


def test_without_the_library_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    found = builtins.__import__

    def absent(name: str, *rest: Any, **more: Any) -> Any:
        if name.split(".")[0] == "viser":
            raise ModuleNotFoundError("No module named 'viser'", name="viser")
        return found(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(ViewError, match=r"no module 'viser': .*'./arm setup view' installs them"):
        Simulator("two_link").view()


def test_without_a_browser_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("ARM_BROWSER", raising=False)
    with pytest.raises(ViewError, match="no browser for pictures.*apt install chromium"):
        pictures.browser()
    monkeypatch.setenv("ARM_BROWSER", "/no/such/browser")
    with pytest.raises(ViewError, match="ARM_BROWSER = '/no/such/browser' is no program"):
        pictures.browser()


class TestListening:
    @pytest.fixture(autouse=True)
    def _library(self) -> None:
        pytest.importorskip("viser", reason="the view's packages are missing: ./arm setup view")

    def test_a_port_that_is_taken_is_refused(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            with pytest.raises(ViewError, match=f"port {port} of 127.0.0.1 cannot be used"):
                open_server("arm", port=port)

    def test_the_next_port_is_taken_where_none_was_asked_for(
        self, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            monkeypatch.setattr("arm_sim.view.server.PORT", port)
            with caplog.at_level(logging.WARNING):
                server = open_server("arm")
            try:
                assert server.get_port() > port != PORT
                assert f"port {port} is taken" in caplog.text
            finally:
                close_server(server)

    def test_an_address_of_another_machine_is_refused(self) -> None:
        with pytest.raises(ViewError, match=r"192\.0\.2\.1"):
            open_server("arm", host="192.0.2.1", port=0)

    def test_nothing_but_the_page_is_served_and_only_here(self) -> None:
        server = open_server("arm", port=0)
        try:
            assert server.get_host() == "127.0.0.1"
            with urllib.request.urlopen(address(server), timeout=10) as page:
                assert b"<html" in page.read().lower()
            for path in ("/etc/passwd", "/../pyproject.toml", "/%2e%2e/%2e%2e/_viser.py", "/x"):
                with pytest.raises(urllib.error.HTTPError) as refused:
                    urllib.request.urlopen(address(server) + path, timeout=10)
                assert refused.value.code == 404
                refused.value.close()
            assert server.request_share_url() is None  # no tunnel to the world
        finally:
            close_server(server)
