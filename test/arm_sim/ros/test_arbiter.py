# SPDX-License-Identifier: Apache-2.0
"""Two controllers at once: the first one stays, the other one is refused, and it is said."""

from __future__ import annotations

import pytest

from arm_dynamics import InvalidInput
from arm_sim.ros.commands.arbiter import STREAM, Arbiter

pytestmark = pytest.mark.ros

BOTH, FIRST, SECOND = frozenset({0, 1}), frozenset({0}), frozenset({1})


def streaming(source: str, joints: frozenset[int], arbiter: Arbiter) -> None:
    for _ in range(STREAM):
        arbiter.tick()
        arbiter.admit(source, joints)


def test_a_stream_keeps_its_joints() -> None:
    arbiter = Arbiter(100)
    streaming("left", BOTH, arbiter)
    with pytest.raises(InvalidInput, match="'right' is refused while 'left' commands"):
        arbiter.admit("right", SECOND)
    assert arbiter.conflict
    assert arbiter.refused == 1
    arbiter.admit("left", BOTH)


def test_a_silent_source_loses_them() -> None:
    arbiter = Arbiter(5)
    streaming("left", BOTH, arbiter)
    for _ in range(6):
        arbiter.tick()
    streaming("right", BOTH, arbiter)
    with pytest.raises(InvalidInput, match="'left' is refused"):
        arbiter.admit("left", BOTH)
    assert arbiter.sources == ("right",)


def test_streams_of_different_joints_go_together() -> None:
    arbiter = Arbiter(100)
    streaming("left", FIRST, arbiter)
    streaming("right", SECOND, arbiter)
    streaming("left", FIRST, arbiter)
    assert arbiter.refused == 0


def test_single_commands_own_nothing() -> None:
    arbiter = Arbiter(100)
    for source in ("a", "b", "c", "a"):
        arbiter.tick()
        arbiter.admit(source, BOTH)
    assert not arbiter.conflict
