# SPDX-License-Identifier: Apache-2.0
"""What the sim node publishes, and when."""

from __future__ import annotations

import numpy as np
from arm_msgs.msg import Energy
from rclpy.node import Node
from rclpy.serialization import serialize_message

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.cdr import HEADER, time_bytes
from arm_dynamics.ros.common.convert import to_time
from arm_dynamics.ros.common.direct import sender
from arm_dynamics.ros.joint_state.compiled import make_sink
from arm_dynamics.ros.joint_state.serialization import JointStateWriter
from arm_sim.ros import interfaces
from arm_sim.ros.energy_meter import Account, EnergyMeter
from arm_sim.ros.multiplier_output import MultiplierOutput
from arm_sim.ros.params import SimParams
from arm_sim.ros.round_trip import RoundTrip
from arm_sim.simulator import Simulator


class Outputs:
    """Joint states, and clock and energy for those who asked; used by the ticking thread only.

    Attributes:
        round_trip: How long answers to joint states take.
        audited: Whether somebody besides the listeners of ``~/energy`` wants the energy account.
        newest: Stamp of the state published last, in [ns].
    """

    def __init__(self, node: Node, simulator: Simulator, params: SimParams) -> None:
        """Advertise what will be published."""
        self._simulator = simulator
        self._every = params.publish_every
        self._energy_every = max(1, round(params.energy_period / simulator.dt))
        writer = JointStateWriter(simulator.joint_names, frame_id=params.frame_id)
        n, x = simulator.n, simulator.x
        self._driven = np.zeros(n) if simulator.plant.torques is not None else None
        effort = simulator.acted if self._driven is None else self._driven
        arrays = x[:n], x[n : 2 * n], effort
        self._states = make_sink(node, interfaces.JOINT_STATES, writer, arrays)
        topic = interfaces.ENERGY
        self._energy = node.create_publisher(topic.type, topic.name, topic.publish)
        self._multipliers = MultiplierOutput(node, simulator)
        self._send_clock = sender(node, interfaces.CLOCK) if params.publish_clock else None
        self._clock_header = bytes(serialize_message(interfaces.CLOCK.type()))[:HEADER]
        self._meter: EnergyMeter | None = None
        simulator.audit.prepare()
        self._idle = 0.0
        self.round_trip = RoundTrip()
        self.audited = False
        self.newest = 0

    def restart(self) -> None:
        """Publish the state after a jump and open a new energy account."""
        self._meter = None
        self.publish()

    def after_tick(self, push: Array | None = None) -> None:
        """Publish what is due after the tick that was just made.

        Args:
            push: Joint torques from outside that acted beside the effort, if any.
        """
        step = self._simulator.step_count
        if self._meter is not None:
            self._meter.note(push)
        if step % self._every == 0:
            self.publish()
        if step % self._energy_every == 0:
            self._publish_energy()
            self._multipliers.publish(self.stamp())

    def repeat(self, period: float, call: float) -> None:
        """Publish the same state again about every ``period``; ``call`` is the time between calls.

        Both are in [s].
        """
        self._idle += call
        if self._idle >= period:
            self.publish()

    def publish(self) -> None:
        """Publish the present state, and the clock."""
        self._idle = 0.0
        self.newest = stamp = self.stamp()
        self.round_trip.sent(stamp)
        if self._driven is not None:
            self._driven[:] = self._simulator.effort
        self._states.send(stamp)
        if self._send_clock is not None:
            self._send_clock(self._clock_header + time_bytes(stamp))

    def stamp(self) -> int:
        """Simulated time in [ns], from the step counter."""
        return round(1e9 * (self._simulator.step_count * self._simulator.dt))

    def account(self) -> Account | None:
        """Energies since the account was opened, None while it is closed."""
        return None if self._meter is None else self._meter.account()

    def _publish_energy(self) -> None:
        """Keep the account while somebody wants it; it opens with the first one who does."""
        heard = self._energy.get_subscription_count() > 0
        if not (heard or self.audited):
            self._meter = None
            return
        if self._meter is None:
            self._meter = EnergyMeter(self._simulator)
        if not heard:
            return
        message = Energy(**self._meter.account()._asdict())
        message.header.stamp = to_time(self.stamp())
        self._energy.publish(message)
