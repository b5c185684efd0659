# SPDX-License-Identifier: Apache-2.0
"""Two controllers of the same arm beside each other, of which one answers in C."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from harness import Ros
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from two_link_control import MS, point, state, trajectory

from arm_dynamics.control import make_controller, preparation
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, JOINT_STATES


class Pair:
    """Shows two nodes the same states and orders."""

    def __init__(self, ros: Ros, scene: Any, **parameters: Any) -> None:
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        options: dict[str, Any] = {"context": ros.context, "parameter_overrides": overrides}
        self._ros, self.stamp, self.heard = ros, 0, list[bytes]()
        self.slow = ControllerNode(scene, **options)  # nobody spins it
        self.slow.send = lambda command: None
        self.fast = ros.adopt(ControllerNode(scene, own_thread=True, **options))
        self.by_python = list[bytes | None]()
        answer = self.fast.on_joint_states

        def noted(raw: bytes) -> bytes | None:
            self.by_python.append(answer(raw))
            return self.by_python[-1]

        self.fast.on_joint_states = noted
        ros.peer.create_subscription(
            JointState, JOINT_COMMANDS.name, self.heard.append, 10, raw=True
        )
        self._publisher = ros.publisher(JointState, JOINT_STATES.name)
        ros.spin_until(lambda: self._publisher.get_subscription_count() >= 2)
        ros.spin_until(lambda: ros.peer.count_publishers(JOINT_COMMANDS.name) >= 2)
        self.q, self.v = self.slow.dynamics.model.q0, np.zeros(self.slow.dynamics.n)

    @property
    def names(self) -> list[str]:
        """The joints."""
        return list(self.slow.dynamics.joint_names)

    @property
    def in_c(self) -> int:
        """How many states C has answered."""
        with self.fast.answers:
            return self.fast.answers.count

    def state(self, q: Any, v: Any) -> bytes:
        """A state of the time ``stamp``."""
        return bytes(state(self.stamp, q, v, self.names))

    def answers(self, raw: bytes) -> bytes | None:
        """What both command for a state, which must be the same."""
        commands, by_python = len(self.heard), len(self.by_python)
        expected = self.slow.on_joint_states(raw)
        self._publisher.publish(raw)
        if expected is None:
            self._ros.spin_until(lambda: None in self.by_python[by_python:])
            return None
        self._ros.spin_until(lambda: len(self.heard) > commands)
        assert self.heard[-1] == expected
        return expected

    def shown(self, raw: bytes) -> None:
        """Send it to the fast node only."""
        self._publisher.publish(raw)
        self._ros.spin_once()

    def led(self, states: int, rng: np.random.Generator) -> None:
        """Send both nodes states of an arm close to its reference."""
        for _ in range(states):
            self.stamp += MS
            if self.slow.goals.follower is not None:
                at = self.slow.goals.follower.reference(self.stamp)
                self.q, self.v = (x + rng.normal(0.0, 1e-3, x.size) for x in (at.q, at.v))
            assert self.answers(self.state(self.q, self.v))

    def both(self, order: Callable[[ControllerNode], Any]) -> None:
        """Do something to both, between two states."""
        for node in self.slow, self.fast:
            order(node)

    def change(self, **values: Any) -> None:
        """Set parameters of both."""
        wanted = [Parameter(name, value=value) for name, value in values.items()]
        self.both(lambda node: node.set_parameters_atomically(wanted))

    def build(self, *names: str) -> None:
        """Build controllers of both, so that a change to them takes no time."""
        for node in self.slow, self.fast:
            for name in names:
                if job := preparation(make_controller(name, node.dynamics)):
                    job()

    def go(self, *points: tuple[float, Sequence[float] | float], effort: float = 0.0) -> None:
        """Send both a trajectory of times in [s] and ways from home, perhaps with efforts."""
        home = self.slow.dynamics.model.q0
        made = [
            point(at, *(home + way).tolist(), effort=[effort * at] * len(home) if effort else [])
            for at, way in points
        ]
        self.both(lambda node: node.on_joint_trajectory(trajectory(*made, names=self.names)))


@contextmanager
def side_by_side(ros: Ros, scene: Any, **parameters: Any) -> Iterator[Pair]:
    """A pair; what belongs to no executor is destroyed at the end."""
    pair = Pair(ros, scene, **parameters)
    try:
        yield pair
    finally:
        pair.slow.destroy_node()
