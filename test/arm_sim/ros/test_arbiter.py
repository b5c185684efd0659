# SPDX-License-Identifier: Apache-2.0
"""Two controllers at once: the first one stays in control, the other is refused and reported."""

import pytest

from arm_dynamics import InvalidInput
from arm_sim.ros.commands.arbiter import Arbiter

pytestmark = pytest.mark.ros

BOTH, FIRST, SECOND = frozenset({0, 1}), frozenset({0}), frozenset({1})


def admits(arbiter: Arbiter, source: str, joints: frozenset[int] = BOTH) -> bool:
    try:
        arbiter.admit(source, joints)
    except InvalidInput as error:
        assert f"'{source}' is refused while '" in arbiter.last_refusal
        assert str(error) == f"{arbiter.last_refusal}; allowed: one stream for each joint"
        return False
    return True


def led(patience: int, joints: frozenset[int] = BOTH) -> Arbiter:
    """One under whom ``left`` has commanded these joints in a row of ticks."""
    arbiter = Arbiter(patience)
    for _ in range(10):
        arbiter.now += 1
        arbiter.admit("left", joints)
    return arbiter


def test_ten_commands_make_a_stream_and_nine_do_not() -> None:
    arbiter = Arbiter(5)
    for _ in range(9):
        arbiter.admit("left", BOTH)
    assert admits(arbiter, "right")
    arbiter.admit("left", BOTH)
    assert not admits(arbiter, "right")
    for _ in range(20):  # with long silences between them, they make none
        arbiter.now += 6
        arbiter.admit("now and then", BOTH)
    assert admits(arbiter, "right")


def test_a_silent_source_loses_its_joints() -> None:
    arbiter = led(patience=5)
    arbiter.now += 5
    assert arbiter.sources == ("left",)
    assert not admits(arbiter, "right")
    arbiter.now += 1
    assert arbiter.sources == ()
    assert admits(arbiter, "right")
    assert arbiter.sources == ("right",)


def test_a_stream_owns_the_joints_of_its_newest_command() -> None:
    arbiter = led(100, FIRST)
    arbiter.admit("left", SECOND)
    assert admits(arbiter, "right", FIRST) and not admits(arbiter, "right", BOTH)


def test_refusals_are_counted_and_a_conflict_as_long_as_the_newest_is_remembered() -> None:
    arbiter = led(5)
    assert not arbiter.conflict
    for count, source in enumerate(("right", "middle"), 1):
        arbiter.now += 4
        arbiter.admit("left", BOTH)
        assert not admits(arbiter, source, FIRST)
        assert arbiter.refused == count and arbiter.sources == ("left",)
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
