# SPDX-License-Identifier: Apache-2.0
"""Two controllers at once: the first one stays in control, the other is refused and reported."""

import pytest

from arm_dynamics import InvalidInput
from arm_sim.ros.commands.arbiter import Arbiter

pytestmark = pytest.mark.ros

BOTH, FIRST, SECOND = frozenset({0, 1}), frozenset({0}), frozenset({1})


def streaming(source: str, joints: frozenset[int], arbiter: Arbiter) -> None:
    for _ in range(10):
        arbiter.now += 1
        arbiter.admit(source, joints)


def test_ten_commands_make_a_stream_and_nine_do_not() -> None:
    arbiter = Arbiter(100)
    for _ in range(9):
        arbiter.admit("left", BOTH)
    arbiter.admit("right", BOTH)
    arbiter.admit("left", BOTH)
    with pytest.raises(InvalidInput, match="'right' is refused"):
        arbiter.admit("right", BOTH)


def test_a_silent_source_loses_them() -> None:
    arbiter = Arbiter(5)
    streaming("left", BOTH, arbiter)
    arbiter.now += 5
    assert arbiter.sources == ("left",)
    with pytest.raises(InvalidInput, match="'right' is refused"):
        arbiter.admit("right", BOTH)
    arbiter.now += 1
    assert arbiter.sources == ()
    streaming("right", BOTH, arbiter)
    with pytest.raises(InvalidInput, match="'left' is refused"):
        arbiter.admit("left", BOTH)
    assert arbiter.sources == ("right",)


def test_commands_with_long_silences_between_them_make_no_stream() -> None:
    arbiter = Arbiter(5)
    for _ in range(20):
        arbiter.admit("now and then", BOTH)
        arbiter.now += 6
    arbiter.admit("now and then", BOTH)
    arbiter.admit("other", BOTH)


def test_a_stream_owns_the_joints_of_its_newest_command() -> None:
    arbiter = Arbiter(100)
    streaming("left", FIRST, arbiter)
    arbiter.admit("left", SECOND)
    arbiter.admit("right", FIRST)
    with pytest.raises(InvalidInput, match="'right' is refused"):
        arbiter.admit("right", BOTH)


def test_each_refusal_is_counted_and_the_newest_one_reported() -> None:
    arbiter = Arbiter(5)
    assert (arbiter.refused, arbiter.last_refusal) == (0, "")
    streaming("left", BOTH, arbiter)
    for count, source in enumerate(("right", "middle"), 1):
        with pytest.raises(InvalidInput, match="allowed: one stream for each joint"):
            arbiter.admit(source, FIRST)
        assert arbiter.refused == count
        assert f"'{source}' is refused while 'left'" in arbiter.last_refusal
    arbiter.admit("left", BOTH)
    assert arbiter.sources == ("left",)


def test_a_conflict_is_reported_as_long_as_the_newest_refusal_is_remembered() -> None:
    arbiter = Arbiter(5)
    streaming("left", BOTH, arbiter)
    assert not arbiter.conflict
    for _ in range(2):
        arbiter.now += 4
        arbiter.admit("left", BOTH)
        with pytest.raises(InvalidInput):
            arbiter.admit("right", BOTH)
    arbiter.now += 5
    assert arbiter.conflict
    arbiter.now += 1
    assert not arbiter.conflict


def test_alone_is_a_source_beside_which_none_is_remembered() -> None:
    arbiter = Arbiter(5)
    assert not arbiter.alone
    for source, joints, alone in ("left", FIRST, True), ("right", SECOND, False):
        arbiter.admit(source, joints)
        assert arbiter.alone == alone
    arbiter.now += 6
    arbiter.admit("left", FIRST)
    assert arbiter.alone
