# SPDX-License-Identifier: Apache-2.0
"""Ticks in C equal those in Python, and all that is not ordinary is left to Python."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import addressof
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
import rclpy
from arm_msgs.msg import Energy
from harness import Ros
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from recorded_engine import contents
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, motion, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics.ros.common.convert import to_nanoseconds, to_time
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim import Recording, Simulator
from arm_sim.replay import replay
from arm_sim.ros.lockstep import Ahead
from arm_sim.ros.ordinary import ticks as ordinary
from arm_sim.ros.sim_node import SimNode
from arm_sim.ros.timing.latency import Histogram
from arm_sim.ros.timing.realtime_loop import Due

pytestmark = pytest.mark.ros

DRIVE = {
    "actuator": {
        "command": "voltage", "resistance": 0.8, "inductance": 8e-4, "torque_constant": 0.06,
        "rotor_inertia": 3e-5, "gear_ratio": 60.0, "voltage_limit": 24.0,
    },
    "transmission": {"stiffness": 300.0, "damping": 1.0, "backlash": 1e-2},
}  # fmt: skip
EACH = 5  # ticks that a command acts
MILLISECOND, SECOND = 10**6, 10**9


def message(*tau: float, source: str = "leader", stamp: int = 0) -> bytes:
    """A command of efforts."""
    told = JointState(name=NAMES, effort=list(tau))
    told.header.frame_id, told.header.stamp = source, to_time(stamp)
    return serialize_message(told)


def node_of(ros: Ros, scene: Any = "two_link", **parameters: Any) -> SimNode:
    """A node that ticks by hand, and whose commands grow old after a few ticks."""
    return by_hand(ros, scene, command_timeout=EACH * 1e-3, **parameters)


REST = message(0.0, 0.0)  # once: padding may hold anything


def led_in_python(node: SimNode, raw: bytes = REST) -> None:
    """Ticks of one command, made by Python."""
    node.inputs.on_joint_commands(raw)
    ticks(node, EACH)


class Fast:
    """A node whose commands come over the topic, and whose ticks C makes where it can.

    Attributes:
        left: Ticks that C has begun and left to Python, which are not made here.
    """

    def __init__(self, ros: Ros, scene: Any = "two_link", **parameters: Any) -> None:
        self.node = node_of(ros, scene, **parameters)
        self.publisher = ros.publisher(JointState, JOINT_COMMANDS.name)
        self.lateness, self.left = Histogram(), 0
        self.due = Due(give_up=10 * SECOND, lateness=addressof(self.lateness))
        led_in_python(self.node)  # C knows what comes after a first one
        assert self.node.ordinary.refusal == ""

    @property
    def made(self) -> int:
        """Ticks so far."""
        return self.node.simulator.arm.step_count

    def led(self, *tau: float) -> bytes:
        """Ticks of one command, made by C; the message."""
        raw = message(*tau, stamp=self.made * MILLISECOND)
        self.publisher.publish(raw)
        end = self.made + EACH
        self.until(lambda: self.made == end)
        return raw

    def until(self, done: Any) -> None:
        """Let C make ticks until then."""
        before, end = self.made, time.monotonic() + 20.0
        while self.made == before or not done():
            assert time.monotonic() < end, "no tick was made"
            self.left += not self.node.ordinary.by_the_clock(self.due)

    def refuses(self, raw: bytes) -> None:
        """Wait until a message has come that C leaves to Python; no tick is made."""
        before, end = self.made, time.monotonic() + 20.0
        self.publisher.publish(raw)
        while not self.node.inputs.reader.left:
            assert time.monotonic() < end, "no message came"
            assert not self.node.ordinary.by_the_clock(self.due)
        assert self.made == before


def driven() -> dict[str, Any]:
    """Two links with bristles, one with a motor and a gear with play."""
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    bristles = {"viscous": 0.1, "coulomb": 0.3, "lugre": {"sigma0": 1e3, "sigma1": 5.0}}
    scene["joints"] = {
        "shoulder": {"friction": bristles, **DRIVE}, "elbow": {"friction": bristles}
    }  # fmt: skip
    return scene


@pytest.mark.parametrize(
    "scene, every, rows",
    [("two_link", 1, 3), ("two_link", 2, 8192), (driven(), 1, 8192), (driven(), 3, 8192)],
    ids=["every state, for an account of few ticks at once", "every second one", "with a drive",
         "with a drive, every third one"],
)  # fmt: skip
def test_states_and_files_are_those_of_python(
    ros: Ros, tmp_path: Path, rng: np.random.Generator, scene: Any, every: int, rows: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(ordinary, "_ROWS", rows)
    files = [tmp_path / "fast.mcap", tmp_path / "slow.mcap"]
    fast = Fast(ros, scene, record=str(files[0]), publish_every=every)
    slow = node_of(ros, scene, record=str(files[1]), publish_every=every)
    slow.inputs.close()
    led_in_python(slow)
    ros.listen(Energy, "sim/energy")
    for node in fast.node, slow:
        node.engine.keep_account(True)
    for tau in rng.uniform(-2.0, 2.0, (30, 2)).tolist():
        led_in_python(slow, fast.led(*tau))
        assert fast.node.simulator.state.q.tobytes() == slow.simulator.state.q.tobytes()
        assert fast.node.simulator.state.v.tobytes() == slow.simulator.state.v.tobytes()
    assert fast.node.ordinary.count == 30 * EACH and slow.ordinary.count == 0
    assert fast.node.recorder is not None and slow.recorder is not None
    assert fast.node.recorder.ticks == slow.recorder.ticks == 31 * EACH
    accounts = [node.engine.account() for node in (fast.node, slow)]
    assert accounts[0] is not None and accounts[0].input != 0.0
    np.testing.assert_allclose(accounts[0], accounts[1], atol=1e-12)
    for node in fast.node, slow:
        node.recorder.close()
    told = [contents(path) for path in files]
    for topic in "/sim/ticks", "/joint_states", "/joint_commands":
        assert told[0][topic] == told[1][topic]
    assert len(told[0]["/joint_states"]) >= 31 * EACH // every
    assert replay(Recording.load(files[0])).equal


IN_PART = 60 * MILLISECOND  # time of the state to which a partner answers for one joint alone


def torque(stamp: int) -> tuple[float, float]:
    """An answer to a state of that time in [ns]."""
    return math.sin(3e-9 * stamp), math.cos(7e-9 * stamp)


@contextmanager
def partner(domain: int) -> Iterator[None]:
    """A thread that answers states."""
    context, ended = Context(), Event()
    rclpy.init(args=[], context=context, domain_id=domain)
    peer, executor = Node("partner", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(peer)
    publisher = peer.create_publisher(JointState, JOINT_COMMANDS.name, 10)

    def answer(state: JointState) -> None:
        stamp = to_nanoseconds(state.header.stamp)
        if stamp != IN_PART:
            return publisher.publish(message(*torque(stamp), stamp=stamp))
        told = JointState(header=state.header, name=NAMES[:1], effort=[torque(stamp)[0]])
        told.header.frame_id = "leader"
        publisher.publish(told)

    peer.create_subscription(JointState, "joint_states", answer, 10)

    def spin() -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        executor.shutdown()
        peer.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize("every", [1, 3])
def test_in_lockstep_states_are_those_of_python(ros: Ros, tmp_path: Path, every: int) -> None:
    path = tmp_path / "run.mcap"
    node = ros.add(
        SimNode, models.scene("two_link"), lockstep=True, publish_every=every, record=str(path),
        stale_policy="zero", lockstep_retry=1.0,
    )  # fmt: skip
    with partner(ros.domain):
        ros.spin_until(lambda: node.ordinary.count >= 20)
        assert node.recorder is not None and node.lockstep is not None
        asked = node.lockstep.asked_again
        ros.spin_until(lambda: node.ordinary.count >= 200)
    assert node.lockstep.asked_again == asked, "an answer was lost"
    node.recorder.close()
    motion, made = Recording.load(path), node.simulator.arm.step_count
    assert len(motion) == made + 1 and not motion.gaps
    expected, tau = Simulator(models.scene("two_link")), [0.0, 0.0]
    for tick in range(made):
        stamp = tick // every * every * MILLISECOND
        tau = [torque(stamp)[0], tau[1] if stamp == IN_PART else torque(stamp)[1]]
        expected.step(tau)
        assert motion.q[tick + 1].tobytes() == expected.state.q.tobytes()
        assert motion.v[tick + 1].tobytes() == expected.state.v.tobytes()


def test_an_order_in_lockstep_waits_for_no_answer(ros: Ros) -> None:
    """The answer stays where it is until Python has done what it was asked for."""
    node = ros.add(SimNode, models.scene("two_link"), lockstep=True, stale_policy="zero")
    lockstep, waiting = node.lockstep, node.lockstep._waiting
    lockstep.on_command(message(0.5, 0.5, stamp=0))

    def ahead(soon: int = 60_000, end: int = 50) -> int:
        begin = time.monotonic_ns()
        waiting.soon, waiting.asked = soon * MILLISECOND, begin
        waiting.end = begin + end * MILLISECOND
        found = lockstep.ahead(waiting)
        assert time.monotonic_ns() - begin < 30 * SECOND, "others have their turn"
        return found

    node.engine.queue.ring()
    ros.publisher(JointState, JOINT_COMMANDS.name).publish(message(1.0, 1.0, stamp=MILLISECOND))
    time.sleep(0.05)
    assert ahead() == Ahead.CANNOT
    node.engine.queue.serve()
    while node.simulator.arm.step_count == 1:
        assert ahead() == Ahead.NOTHING_CAME
    assert node.simulator.arm.step_count == 2
    assert ahead(soon=10, end=60_000) == Ahead.NOTHING_CAME


def test_in_lockstep_c_ticks_for_answers_alone(ros: Ros) -> None:
    """A command that comes late, twice or without a stamp is counted and acts with the answer."""
    node = ros.add(SimNode, models.scene("two_link"), lockstep=True, stale_policy="zero")
    lockstep, publisher = node.lockstep, ros.publisher(JointState, JOINT_COMMANDS.name)
    lockstep.on_command(message(0.5, 0.5, stamp=0))
    ignored = 0
    for tick in 1, 2, 3:
        for stamp in (0, 7 * MILLISECOND, (tick - 1) * MILLISECOND, tick * MILLISECOND):
            publisher.publish(message(tick, stamp * 1e-9, stamp=stamp))
        ignored += 3
        end = time.monotonic() + 20.0
        while node.simulator.arm.step_count == tick:
            assert time.monotonic() < end
            lockstep._waiting.soon = SECOND
            lockstep._waiting.end = time.monotonic_ns() + 50 * MILLISECOND
            lockstep._waiting.asked = time.monotonic_ns()
            lockstep.ahead(lockstep._waiting)
        assert node.simulator.arm.step_count == tick + 1
        assert lockstep.ignored == ignored
        assert node.simulator.effort.tolist() == [tick, tick * MILLISECOND * 1e-9]
    assert node.ordinary.count == 3


@pytest.mark.parametrize(
    "raw, refused",
    [
        (message(float("nan"), 0.0), "finite"),
        (message(1.0, 1.0, source="another"), "two controllers"),
        (serialize_message(JointState(name=["unknown"], effort=[1.0])), "unknown"),
        (b"\x00\x01\x00\x00", "JointState"),
    ],
    ids=["not finite", "another source", "another joint", "no message"],
)
def test_what_is_wrong_is_refused_by_python(ros: Ros, raw: bytes, refused: str) -> None:
    fast = Fast(ros)
    for _ in range(12):
        fast.led(0.5, 0.5)  # a stream
    fast.refuses(raw)
    count = fast.node.inputs.refused
    fast.node.tick()
    assert fast.node.inputs.refused == count + 1
    assert fast.node.simulator.arm.acted.tolist() == [0.0, 0.0], "the old one is too old"


def test_a_command_that_may_not_fit_into_the_recording_is_left_to_python(ros: Ros) -> None:
    fast, long = Fast(ros), "x" * 5000
    led_in_python(fast.node, message(0.5, 0.5, source=long))
    fast.node.engine.arbiter.forget()
    led_in_python(fast.node, message(0.5, 0.5, source=long))
    fast.refuses(message(1.0, 2.0, source=long))
    fast.node.tick()
    assert fast.node.simulator.arm.acted.tolist() == [1.0, 2.0]


def test_a_command_of_some_joints_is_put_together_by_python(ros: Ros) -> None:
    fast = Fast(ros)
    fast.led(0.5, -0.5)
    told = JointState(name=NAMES[:1], effort=[1.5])
    told.header.frame_id = "leader"
    fast.refuses(serialize_message(told))
    fast.node.tick()
    assert fast.node.simulator.arm.acted.tolist() == [1.5, -0.5]
    before = fast.made
    assert not fast.node.ordinary.by_the_clock(fast.due), "the other joint is not its own"
    assert fast.made == before


def test_an_order_waits_for_no_more_than_the_tick_under_way(ros: Ros) -> None:
    fast = Fast(ros)
    fast.led(0.5, -0.5)
    fast.publisher.publish(message(1.0, 1.0))
    before = fast.made
    fast.node.engine.queue.ring()
    assert not fast.node.ordinary.by_the_clock(fast.due) and fast.made == before
    fast.node.tick()  # which empties the queue
    fast.until(lambda: True)


def test_no_tick_is_made_while_the_arm_is_not_led_by_efforts(ros: Ros) -> None:
    fast = Fast(ros)
    engine, ordinary, listen = fast.node.engine, fast.node.ordinary, lambda: None
    for begin, end in (
        (lambda: engine.pause(True), lambda: engine.pause(False)),
        (lambda: fast.node.tick(), lambda: None),  # stale
        (lambda: engine.push("tip", [0.1] * 6), lambda: engine.reset()),
        (lambda: engine.arbiter.admit("other", frozenset({1})), lambda: engine.arbiter.forget()),
        (lambda: engine.on_tick.append(listen), lambda: engine.on_tick.remove(listen)),
    ):
        begin()
        fast.publisher.publish(message(1.0, 1.0))
        time.sleep(0.05)
        before = fast.made
        assert not ordinary.by_the_clock(fast.due) and fast.made == before
        end()
        led_in_python(fast.node)
        fast.led(0.1, 0.2)


def test_efforts_in_model_order_act_at_once(ros: Ros) -> None:
    fast = Fast(ros)
    fast.led(0.5, -0.5)
    fast.node.inputs.on_commands(Float64MultiArray(data=[2.0, 1.0]))
    assert not fast.node.ordinary.by_the_clock(fast.due)
    fast.node.tick()
    assert fast.node.simulator.arm.acted.tolist() == [2.0, 1.0]


def test_late_ticks_are_counted_and_made_up_for(ros: Ros) -> None:
    fast = Fast(ros)
    fast.led(0.0, 0.0)
    now = time.monotonic_ns()
    fast.due = Due(
        deadline=now - 30 * MILLISECOND, period=MILLISECOND, closest=MILLISECOND,
        give_up=100 * SECOND,
        lateness=addressof(fast.lateness),
    )  # fmt: skip
    counted, fast.left = fast.lateness.percentiles().count, 0
    fast.led(0.1, 0.1)
    begun = EACH + fast.left
    assert fast.due.missed == begun == fast.lateness.percentiles().count - counted
    assert fast.due.deadline == now + (begun - 30) * MILLISECOND


def test_commands_age_in_part_while_ticks_are_made_up_for(ros: Ros) -> None:
    """Long behind, ticks of a second follow at once: they take next to no time."""
    fast = Fast(ros, energy_period=1e-3)
    ros.listen(Energy, "sim/energy")
    fast.node.engine.keep_account(True)  # so Python has energies to publish after every tick
    fast.due = Due(
        deadline=time.monotonic_ns() - 1000 * SECOND, period=SECOND, give_up=10_000 * SECOND,
        lateness=addressof(fast.lateness),
    )  # fmt: skip
    end, engine = fast.made + 10 * EACH, fast.node.engine
    heard = engine.arbiter.now
    fast.publisher.publish(message(0.1, 0.1))
    fast.until(lambda: fast.made == end)
    assert 1.0 <= engine.commands.age < 2.0, "the first one counts in full"
    assert 1.0 <= engine.arbiter.now - heard < 2.0


def test_most_ticks_of_a_loop_by_the_clock_are_made_in_c(ros: Ros) -> None:
    """And energies are published beside them."""
    node = ros.add(SimNode, "panda", command_timeout=0.0, energy_period=0.05)
    energies = ros.listen(Energy, "sim/energy")
    names, said = list(node.simulator.joint_names), list[JointState]()

    def answer(state: JointState) -> None:
        said.append(state)
        told = JointState(name=names, effort=[0.0] * len(names), header=state.header)
        told.header.frame_id = "leader"
        publisher.publish(told)

    publisher = ros.publisher(JointState, JOINT_COMMANDS.name)
    ros.peer.create_subscription(JointState, "joint_states", answer, 10)
    ros.spin_until(lambda: len(energies) >= 10)
    node.loop.stop()
    count, trips = node.ordinary.count, node.inputs.round_trip.percentiles().count
    assert trips > 0
    assert count > 0.5 * (node.loop.report().ticks - 300), "and others while it began"
    stamps = np.array([s.header.stamp.sec * SECOND + s.header.stamp.nanosec for s in said])
    assert (np.diff(stamps) >= 0).all() and stamps[-1] <= time.time_ns()
    times = [to_nanoseconds(e.header.stamp) for e in energies]
    assert (np.diff(times) > 0).all() and times[-1] <= time.time_ns()
    assert all(abs(e.balance) < 1e-6 for e in energies)
    last = node.engine.account()
    assert last is not None and last.step == node.simulator.arm.step_count
    assert (last.kinetic, last.potential) == node.simulator.dynamics.energy(*motion(node))
