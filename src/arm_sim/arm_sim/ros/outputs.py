# SPDX-License-Identifier: Apache-2.0
"""Messages that the sim node publishes in the course of ticks."""

from collections.abc import Callable, Sequence
from ctypes import addressof, byref
from typing import Any

import numpy as np
from arm_msgs.msg import Multipliers
from rclpy.node import Node

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.convert import as_bytes, to_time
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.interfaces import JOINT_STATES, Topic
from arm_dynamics.ros.joint_state import JointStateSink, JointStateWriter
from arm_sim.ros.display import AllJointStates
from arm_sim.ros.drive_torques import DriveTorques
from arm_sim.ros.energy import EnergyTopic
from arm_sim.ros.interfaces import GROUND_TRUTH, MULTIPLIERS
from arm_sim.ros.node_library import library
from arm_sim.ros.sim_params import CLOCK, SimParams
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.clock import SimClock
from arm_sim.ros.timing.stamps import ROS, NodeTime, SimulatedTime

_IDLE_PERIOD = 0.1  # [s] between joint states while time stands still
_POLL = 0.5  # [s] between checks for subscribers of infrequent topics


class Outputs:
    """Joint states, the exact ones as well if the scene has sensors, and other requested topics.

    C publishes joint states, and asks for the other topics. Used by the ticking thread only; with
    ticks by the clock, a timer looks for readers.

    Attributes:
        reported: Positions, velocities and efforts of joint states, each shape (n,).
        states: Publishes joint states.
        energy: Keeps and publishes the energy account.
        stamps: Source of stamps.
        clock: Publishes simulated time, or None.
        tap: Called with topic, bytes and stamp in [ns] of every output but the joint states of
            ticks.
    """

    def __init__(
        self, node: Node, engine: TickEngine, params: SimParams, account_read: Callable[[], bool]
    ) -> None:
        """Advertise the topics and attach to the engine.

        ``account_read`` returns whether anything besides ``~/energy`` reads the energy account.
        """
        self._engine = engine
        self._simulator = simulator = engine.simulator
        self._by_the_clock = params.tick_source == CLOCK
        self.tap: Callable[[Topic, Any, int], None] = lambda topic, raw, stamp: None
        self.stamps = _stamps(node, params, simulator.dt)
        self._advertise_states(node, params)
        self._multipliers = None
        if simulator.model.scene.bilateral:
            self._multipliers = advertise(node, MULTIPLIERS)
            simulator.multipliers()  # builds in advance what would delay the loop
        self.clock = SimClock(node) if params.publish_clock else None
        stamp = self.stamps.near if self._by_the_clock else self.stamps.at
        period = params.energy_period
        self.energy = EnergyTopic(node, engine, period, account_read, stamp, self._publish)
        if self._by_the_clock:
            steady_timer(node, _POLL, self._update)
        self._share(params.publish_every)
        engine.on.idle.append(lambda: self.repeat(simulator.dt))
        engine.on.jump.append(self.publish)
        engine.on.pause.append(self._release)

    def _advertise_states(self, node: Node, params: SimParams) -> None:
        """Joint states, of all joints if that is set, and the exact ones if there are sensors."""
        simulator, arm = self._simulator, self._simulator.arm
        n, x, names = simulator.n, arm.x, simulator.joint_names
        torques = arm.plant.torques
        self._drives = None if torques is None else DriveTorques(arm, torques)
        effort = arm.acted if self._drives is None else self._drives.values
        truth = x[:n], x[n : 2 * n], effort

        def sink(topic: Topic, names: Sequence[str], arrays: Sequence[Array]) -> JointStateSink:
            writer = JointStateWriter(names, frame_id=params.frame_id)
            return JointStateSink(node, topic, writer, arrays)

        sensors = arm.sensors
        self.reported = truth if sensors is None else tuple(np.split(sensors.measured, 3))
        self._truth = None if sensors is None else sink(GROUND_TRUTH, names, truth)
        self._all = None
        if params.publish_all_joints:
            self._all = AllJointStates(simulator.model, self.reported)
            self.states = sink(JOINT_STATES, self._all.names, self._all.arrays)
        else:
            self.states = sink(JOINT_STATES, names, self.reported)

    def _share(self, period: int) -> None:
        """Let C publish joint states after every so many ticks."""
        ticks, stamps, drives = self._engine.ticks, self.stamps, self._drives
        ticks.state_period, ticks.joint_states = period, self.states.address
        ticks.ground_truth = None if self._truth is None else self._truth.address
        ticks.clock = None if self.clock is None else addressof(self.clock.sink)
        ticks.times = addressof(stamps) if isinstance(stamps, NodeTime) else None
        ticks.drives = None if drives is None else drives.entry_address
        needs_drives = drives is not None and drives.entry_address is None
        ticks.needs_filling = needs_drives or self._all is not None
        if self._multipliers is not None or not self._by_the_clock:
            ticks.slow_period = self.energy.interval
            self._engine.on.slow_tick.append(self._publish_slow_topics)
        # What C could not publish is published again, which raises the reason.
        ticks.answer(fill=self._fill, unsent=lambda: self.states.publish(bytes(self.states.raw)))

    def _update(self) -> None:
        """Prepare for readers and clocks that came or went; not in the ticking thread."""
        self.stamps.update_source()
        self.energy.update()

    def publish(self) -> None:
        """Publish the current state, and the clock."""
        ticks = self._engine.ticks
        library().ticks_publish_state(byref(ticks))
        self.tap(JOINT_STATES, self.states.raw, ticks.state_stamp)

    def _fill(self) -> None:
        """Fill arrays that C does not compute."""
        if self._drives is not None and self._drives.entry_address is None:
            self._drives.update()
        if self._all is not None:
            self._all.fill()

    def repeat(self, elapsed: float) -> None:
        """Publish the current state periodically; ``elapsed`` in [s] since the last call."""
        self._release()
        self._engine.ticks.idle_time += elapsed
        if self._engine.ticks.idle_time >= _IDLE_PERIOD:
            self.publish()

    def stamp(self) -> int:
        """Stamp of the current state in [ns]."""
        return self.stamps.at(self._engine.stamp)

    def _release(self) -> None:
        """While the arm waits for a command the clock advances; while it is paused stamps stay."""
        if not self._engine.paused:
            self.stamps.release()

    def _publish_slow_topics(self) -> None:
        """Publish other topics than joint states, if there are readers."""
        if not self._by_the_clock:
            self.energy.after_tick()
        publisher, simulator = self._multipliers, self._simulator
        if publisher is not None and publisher.get_subscription_count() > 0:
            message = Multipliers(names=list(simulator.dynamics.constrained.names))
            message.values = simulator.multipliers().tolist()
            self._publish(MULTIPLIERS, publisher, message, self.stamp())

    def _publish(self, topic: Topic, publisher: Any, message: Any, stamp: int) -> None:
        """Publish topics that are not published in every tick."""
        message.header.stamp = to_time(stamp)
        raw = as_bytes(message)
        publisher.publish(raw)
        self.tap(topic, raw, stamp)


def _stamps(node: Node, params: SimParams, dt: float) -> SimulatedTime | NodeTime:
    """The source of stamps; by the clock at its own pace, ticks are due at even times."""
    if params.stamps != ROS:
        return SimulatedTime()
    even = params.tick_source == CLOCK and params.realtime_factor == 1.0
    return NodeTime(node.get_clock(), round(1e9 * dt) if even else 0)
