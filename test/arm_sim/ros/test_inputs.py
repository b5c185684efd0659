# SPDX-License-Identifier: Apache-2.0
"""Commands from topics, without a graph: accepted, clipped, refused, counted.

Of two controllers the first one stays in control; the other is refused and reported.
"""

from ctypes import byref
from unittest.mock import Mock

import numpy as np
import pytest
from polled import offered
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import next_command
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.convert import to_time
from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.inputs.inputs import Inputs
from arm_sim.ros.node_library import library
from arm_sim.ros.tick_engine import TickEngine

pytestmark = pytest.mark.ros

NAMES = list(models.dynamics("panda").joint_names)
LIMIT = models.dynamics("panda").model.command_limit.tolist()
ZERO = [0.0] * 7
NAN = float("nan")


def read(engine: TickEngine) -> None:
    """Read what waits, as before a tick."""
    engine._run(library().ticks_read_commands)


@pytest.fixture
def node() -> Mock:
    """Takes the place of a node of which nothing is needed but its log."""
    return Mock()


@pytest.fixture
def engine() -> TickEngine:
    return TickEngine(models.simulator("panda"), wrench_timeout=0.1, wrench_reference="local")


@pytest.fixture
def inputs(node: Mock, engine: TickEngine) -> Inputs:
    return Inputs(node, engine, Mock(**{"alarm.message": ""}))


def command(stamp: int = 0, source: str = "", **joints: float) -> bytes:
    message = JointState(name=[f"panda_{j}" for j in joints], effort=list(joints.values()))
    message.header.frame_id, message.header.stamp = source, to_time(stamp)
    return serialize_message(message)


def acting(engine: TickEngine) -> list[float]:
    return list(next_command(engine.commands, engine.simulator.state.q))


def lead(inputs: Inputs, source: str = "leader") -> None:
    """Make a stream that owns the first joint."""
    for _ in range(10):
        inputs.on_joint_commands(command(source=source, joint1=1.0))


def test_bare_commands_claim_all_joints_under_a_name_of_their_own(
    inputs: Inputs, engine: TickEngine
) -> None:
    for _ in range(10):
        inputs.on_commands(Float64MultiArray(data=[1.0] * 7))
    for joint in ("joint1", "joint7"):
        assert inputs.on_joint_commands(command(1, "other", **{joint: 9.0})) is None
    assert "refused while '~/commands' commands" in engine.arbiter.last_refusal
    assert acting(engine) == [1.0] * 7


def test_positions_from_before_bare_efforts_do_not_come_back(
    inputs: Inputs, engine: TickEngine
) -> None:
    inputs.on_joint_commands(serialize_message(JointState(name=NAMES[:1], position=[0.3])))
    inputs.on_commands(Float64MultiArray(data=[3.0] * 7))
    inputs.on_joint_commands(command(joint2=2.0))
    assert acting(engine) == [0.0, 2.0, *ZERO[2:]]


def test_beside_an_effort_that_is_cut_gaps_stay_gaps(inputs: Inputs, engine: TickEngine) -> None:
    message = JointState(name=NAMES[:3], effort=[NAN, -1e3, NAN], position=[0.3, NAN, 0.2])
    inputs.on_joint_commands(serialize_message(message))
    held = next_command(engine.commands, engine.simulator.state.q)
    np.testing.assert_array_equal(held.effort, [NAN, -LIMIT[1], *[NAN] * 5])
    np.testing.assert_array_equal(held.position, [0.3, NAN, 0.2, *[NAN] * 4])


def test_of_what_waits_the_newest_that_is_admitted_acts(
    inputs: Inputs, engine: TickEngine
) -> None:
    lead(inputs)
    bad = command(source="leader", joint1=NAN)
    other = command(source="other", joint1=9.0)
    good = [command(source="leader", joint1=x) for x in (2.0, 3.0)]
    waiting = offered(inputs, engine, [bad, good[0], other, good[1], bad, other])
    read(engine)
    assert not waiting
    assert acting(engine)[0] == 3.0
    assert inputs.refused == 4


def test_as_many_as_the_topic_holds_are_read_at_once(inputs: Inputs, engine: TickEngine) -> None:
    waiting = offered(inputs, engine, [command(joint1=float(k)) for k in range(1, 41)])
    read(engine)
    assert acting(engine)[0] == 16.0
    read(engine)
    assert acting(engine)[0] == 32.0
    assert len(waiting) == 8


@pytest.mark.parametrize(
    ("stamp", "sent", "alone", "acts"),
    [
        (5, 5, True, 1.0),  # nothing can be newer than the answer to the newest state
        (5, 5, False, 2.0),  # but others may have something to say, too
        (4, 5, True, 2.0),
        (0, 0, True, 2.0),  # no stamp answers nothing
    ],
)
def test_behind_the_answer_to_the_newest_state_of_a_lone_source_none_is_sought(
    inputs: Inputs, engine: TickEngine, stamp: int, sent: int, alone: bool, acts: float
) -> None:
    library().trip_register_state(byref(engine.round_trip), sent)
    if not alone:
        engine.arbiter.admit("other", frozenset({6}))
    offered(inputs, engine, [command(stamp, "one", joint1=1.0), command(3, "one", joint1=2.0)])
    read(engine)
    assert acting(engine)[0] == acts


@pytest.mark.parametrize("waits", [True, False])
def test_answers_are_timed_from_state_to_arrival(
    inputs: Inputs, engine: TickEngine, waits: bool
) -> None:
    trip = engine.round_trip
    for stamp in 5, 6, 7:
        library().trip_register_state(byref(trip), stamp)
    arrival, late = int(trip._times[0]), 10**6
    if waits:
        offered(inputs, engine, [command(5, joint1=1.0), command(6, joint1=NAN)], arrival + late)
        read(engine)
    else:
        inputs.on_joint_commands(command(5, joint1=1.0), arrival + late)
        inputs.on_joint_commands(command(6, joint1=NAN), arrival + 2 * late)
    assert trip.histogram.percentiles().count == 1 and trip.awaits(6) and not trip.awaits(5)
    assert trip.histogram.percentiles().max == pytest.approx(1e-9 * late)


def test_after_it_is_closed_nothing_is_read(inputs: Inputs, engine: TickEngine) -> None:
    waiting = offered(inputs, engine, [command(joint1=1.0)])
    inputs.polled.close()
    inputs.polled.close()
    read(engine)
    assert waiting and acting(engine) == ZERO


def test_numbers_that_begin_elsewhere_are_refused(inputs: Inputs, node: Mock) -> None:
    message = Float64MultiArray(data=ZERO)
    message.layout.data_offset = 1
    inputs.on_commands(message)
    assert inputs.refused == 1 and "data_offset is 1; allowed: 0" in str(node.mock_calls)


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
    assert not arbiter.has_conflict
    for count, source in enumerate(("right", "middle"), 1):
        arbiter.now += 4
        arbiter.admit("left", BOTH)
        assert not admits(arbiter, source, FIRST)
        assert arbiter.refused == count and arbiter.sources == ("left",)
    arbiter.now += 5
    assert arbiter.has_conflict
    arbiter.now += 1
    assert not arbiter.has_conflict


def test_alone_is_a_source_beside_which_none_is_remembered() -> None:
    arbiter = Arbiter(5)
    assert not arbiter.has_one_source
    for source, joints, alone in ("left", FIRST, True), ("right", SECOND, False):
        arbiter.admit(source, joints)
        assert arbiter.has_one_source == alone
    arbiter.now += 6
    arbiter.admit("left", FIRST)
    assert arbiter.has_one_source
