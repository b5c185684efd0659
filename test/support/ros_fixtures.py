# SPDX-License-Identifier: Apache-2.0
"""Every test of a node has a ROS of its own: context, domain, executor; nothing stays behind.

The conftest.py of each folder with such tests imports these fixtures.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from harness import Ros
from typist import Typist

from arm_dynamics.ros.common.transport import by_udp, clear_dead


@pytest.fixture(autouse=True)
def ros_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests are isolated from other nodes, and their logs are removed."""
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    for name in ("ROS_DOMAIN_ID", "ROS_NAMESPACE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session", autouse=True)
def transports() -> Iterator[None]:
    """Nobody outside this machine hears the tests, and they stay out of shared memory.

    Nodes that tests start as processes talk as for users; what killed ones leave is given back.
    """
    with pytest.MonkeyPatch.context() as patch:
        for name, value in by_udp().items():
            patch.setenv(name, value)
        yield
    clear_dead()


@pytest.fixture
def ros(ros_environment: None) -> Iterator[Ros]:
    """A ROS for one test."""
    instance = Ros()
    yield instance
    instance.close()


@pytest.fixture
def arm(domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Typist:
    """Types ``./arm call`` in the domain of a file's nodes."""
    return Typist(domain, monkeypatch, capfd)
