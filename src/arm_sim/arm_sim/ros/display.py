# SPDX-License-Identifier: Apache-2.0
"""Topics for visualization: joint states of all joints, locked and mimic ones too, and frames."""

from collections.abc import Callable, Sequence
from itertools import count

import numpy as np
from rclpy.node import Node

from arm_dynamics import ArmError, ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.model.description import AllJoints, Links
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.joint_state import JointStateSink, JointStateWriter
from arm_sim.ros.frames import Frames
from arm_sim.ros.interfaces import ALL_JOINT_STATES
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.tick_engine import TickEngine

_PERIOD = 0.2  # [s] between checks for subscribers
_SELDOM = 5  # checks for subscribers, of which one also looks for other publishers of frames


class AllJointStates:
    """Arrays for all joints, filled from those of the arm's joints.

    Attributes:
        names: All joints.
        arrays: Their positions, velocities and efforts, each of shape (len(names),).
    """

    def __init__(self, model: ArmModel, own: Sequence[Array]) -> None:
        """Use the published arrays of the arm's own joints."""
        self._joints, self._own = AllJoints(model), tuple(own)
        self.names = self._joints.names
        self.arrays = tuple(np.zeros(len(self.names)) for _ in own)

    def fill(self) -> None:
        """Copy the current contents of the arm's arrays."""
        (q, v, tau), (all_q, all_v, all_tau) = self._own, self.arrays
        all_q[:] = self._joints.positions(q)
        all_v[:] = self._joints.velocities(v)
        all_tau[: tau.size] = tau


class Display:
    """Publishes ``~/all_joint_states`` and ``/tf`` while there are subscribers.

    It runs in the thread that spins the node, and requests a copy of the state from the ticking
    thread between two ticks.
    """

    def __init__(
        self, node: Node, engine: TickEngine, params: SimParams, arrays: Sequence[Array],
        stamp: Callable[[], int],
    ) -> None:  # fmt: skip
        """Advertise the topics.

        ``arrays`` are positions, velocities and efforts of ``joint_states``, each of shape (n,);
        ``stamp`` returns the stamp of the current state in [ns], in the ticking thread.
        """
        self._engine, self._own, self._stamp = engine, arrays, stamp
        model = engine.simulator.model
        self._copies = tuple(array.copy() for array in arrays)
        self._all = AllJointStates(model, self._copies)
        self._tf, self._absence = None, "off"
        writer = JointStateWriter(self._all.names, frame_id=params.frame_id)
        self._states = JointStateSink(node, ALL_JOINT_STATES, writer, self._all.arrays)
        if params.publish_tf:
            try:
                self._tf = Frames(node, Links(model), self._all.names, params.frame_prefix)
            except ImportError:
                self._absence = "not published: tf2_msgs is not installed"
        self._checks, self._has_rivals = count(), False
        self._sends_states = self._sends_frames = False
        self._timer = steady_timer(node, 1.0 / params.display_rate, self.publish)
        self._timer.cancel()
        self._check_timer = steady_timer(node, _PERIOD, self.check_subscribers)

    @property
    def frames(self) -> str:
        """State of ``/tf``, as text."""
        if self._tf is None:
            return self._absence
        return "left to robot_state_publisher" if self._has_rivals else "published"

    def check_subscribers(self) -> None:
        """Check for subscribers, and start or stop publishing."""
        self._sends_states = self._states.has_subscribers
        if self._tf is not None:
            if next(self._checks) % _SELDOM == 0:
                self._has_rivals = self._tf.has_rivals()
            self._sends_frames = self._tf.has_subscribers and not self._has_rivals
        if not (self._sends_states or self._sends_frames):
            self._timer.cancel()
        elif self._timer.is_canceled():
            self._timer.reset()

    def publish(self) -> None:
        """Publish the subscribed topics."""
        try:
            stamp = self._engine.queue.run(self._copy)
        except ArmError:
            return  # without ticks there is nothing new
        self._all.fill()
        if self._sends_states:
            self._states.send(stamp)
        if self._sends_frames:
            self._tf.publish(stamp, self._all.arrays[0])

    def _copy(self) -> int:
        for copy, array in zip(self._copies, self._own, strict=True):
            copy[:] = array
        return self._stamp()
