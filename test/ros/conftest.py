# SPDX-License-Identifier: Apache-2.0
"""Every test of a node has a ROS of its own: context, domain, executor; nothing stays behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness import TRANSPORTS, Ros

from arm_dynamics.ros.shared_memory import clear_dead


def pytest_configure(config: pytest.Config) -> None:
    """The message parser that ROS brings along imports modules that Python is about to drop."""
    for module in ("sre_parse", "sre_constants"):
        config.addinivalue_line(
            "filterwarnings", f"ignore:module '{module}' is deprecated:DeprecationWarning"
        )


@pytest.fixture(autouse=True)
def ros_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody outside this machine hears the tests, and their logs go away with them."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    for name in ("ROS_DOMAIN_ID", "ROS_NAMESPACE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session", autouse=True)
def shared_memory() -> Iterator[None]:
    """Stay out of shared memory, and give back what nodes that tests have killed could not.

    A node that is killed while it writes leaves a locked mutex in the memory of whoever listens.
    Fast DDS 2.14 then maps that memory anew, and who is just leaving it crashes.
    """
    os.environ[TRANSPORTS] = "UDPv4"
    yield
    del os.environ[TRANSPORTS]
    clear_dead()


@pytest.fixture
def ros(ros_environment: None) -> Iterator[Ros]:
    """A ROS for one test."""
    instance = Ros()
    yield instance
    instance.close()
