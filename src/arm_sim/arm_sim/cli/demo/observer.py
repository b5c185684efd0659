# SPDX-License-Identifier: Apache-2.0
"""The demo's own node: sends the trajectory, observes the loop and queries torques."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.common.executor import make_executor
from arm_dynamics.ros.interfaces import (
    CONTROLLER_STATE,
    EVERY,
    INVERSE_DYNAMICS,
    JOINT_TRAJECTORY,
    MODEL_INFO,
    RESET_COUNTERS,
)
from arm_dynamics.trajectory.reference import Waypoint
from arm_sim.cli.demo.processes import DemoFailed
from arm_sim.cli.interrupts import postponed
from arm_sim.ros.interfaces import ENERGY

_START_TIMEOUT, _MOTION_TIMEOUT = 60.0, 10.0  # [s]
_IN_TIME = f"within {_START_TIMEOUT:g} s"
_BETWEEN_LOOKS = 0.02  # [s]
_AT_EASE = 0.5  # [s]: discovery of a node may block the others for a third of a second
_ASK_AGAIN = 1.0  # [s] until an unanswered request is repeated
_FIELDS = ("reference_position", "feedback_position", "position_error", "effort")


@dataclass(frozen=True)
class Seen:
    """Observations of a motion; time starts with the trajectory, rows are samples.

    Attributes:
        time: Time in [s], shape (k,).
        reference: Desired joint positions, shape (k, n).
        position: Measured joint positions, shape (k, n).
        error: Reference minus position, shape (k, n).
        effort: Commanded torque, shape (k, n).
        asked_time: Times of the service requests in [s], shape (m,).
        asked_effort: Torques returned for the reference motion, shape (m, n).
        asked_for: Torques commanded at those times, shape (m, n).
        latencies: Durations of the service calls in [s], shape (m,).
        energy: kinetic, potential, total, input, dissipated and balance in [J], shape (e, 6).
    """

    time: Array
    reference: Array
    position: Array
    error: Array
    effort: Array
    asked_time: Array
    asked_effort: Array
    asked_for: Array
    latencies: Array
    energy: Array


class Observer:
    """Joins the graph of the demo; use it in a ``with`` statement."""

    def __init__(self, names: Sequence[str], domain: int, glance: Callable[[], None]) -> None:
        """Observe the joints ``names`` in the ROS domain ``domain``.

        ``glance`` is called periodically while waiting.
        """
        self._names, self._domain, self._glance = list(names), domain, glance
        self._states: list[Any] = []
        self._energies: list[Any] = []
        self._questions: list[tuple[Any, float, Any]] = []
        self._pending: tuple[Future, Any, int] | None = None
        self.start = 0  # stamp in [ns] at which the trajectory began

    def __enter__(self) -> Observer:
        """Start the node."""
        self._context = Context()
        rclpy.init(
            args=[], context=self._context, domain_id=self._domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        self._node = Node("demo", context=self._context, start_parameter_services=False)
        self._executor = make_executor(self._node)
        self._ask = self._node.create_client(INVERSE_DYNAMICS.type, "dynamics/inverse_dynamics")
        self._info = self._node.create_client(MODEL_INFO.type, "dynamics/model_info")
        self._reset = self._node.create_client(RESET_COUNTERS.type, "sim/reset_counters")
        self._send = self._node.create_publisher(
            JointTrajectory, _of("controller", JOINT_TRAJECTORY), JOINT_TRAJECTORY.publish
        )
        self._node.create_subscription(
            CONTROLLER_STATE.type, _of("controller", CONTROLLER_STATE), self._on_state, EVERY
        )
        self._node.create_subscription(
            ENERGY.type, _of("sim", ENERGY), self._energies.append, EVERY
        )
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    # --- waiting -------------------------------------------------------------------------------

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Spin until ``condition``; return whether it was met within ``timeout`` in [s]."""
        end, look = time.monotonic() + timeout, 0.0
        while not (met := condition()) and (now := time.monotonic()) < end:
            with postponed():
                self._executor.spin_once(timeout_sec=_BETWEEN_LOOKS)
            self._collect_answer()
            if now >= look:
                self._glance()
                look = now + 0.2
        return met

    def wait_for_partners(self) -> None:
        """Wait until the dynamics node answers and the controller subscribes."""
        self._demand(self._answer_of(self._info), f"the dynamics node did not answer {_IN_TIME}")
        self._demand(
            lambda: self._send.get_subscription_count() > 0,
            f"the controller did not start {_IN_TIME}",
        )

    def wait_for_motion(self) -> None:
        """Wait until the controller answers the simulated arm, whose counters start then."""
        self._demand(
            lambda: len(self._states) > 3,
            f"the controller sent no command {_IN_TIME}: it receives no joint states",
        )
        silence = f"the sim node did not answer {_IN_TIME}"
        self._demand(self._reset.service_is_ready, silence)
        self.until(lambda: False, _AT_EASE)
        self._demand(self._answer_of(self._reset), silence)

    def _demand(self, condition: Callable[[], bool], failure: str) -> None:
        """Wait for a condition at start-up, and fail after a timeout."""
        if not self.until(condition, _START_TIMEOUT):
            raise DemoFailed(failure)

    def _answer_of(self, client: Any) -> Callable[[], bool]:
        """Whether a service has answered an empty request, which is repeated every second."""
        answers = list[Future]()
        asked = 0.0

        def answered() -> bool:
            nonlocal asked
            if client.service_is_ready() and time.monotonic() > asked + _ASK_AGAIN:
                answers.append(client.call_async(client.srv_type.Request()))
                asked = time.monotonic()
            return any(answer.done() for answer in answers)

        return answered

    # --- the trajectory ------------------------------------------------------------------------

    def send(self, waypoints: Sequence[Waypoint]) -> bool:
        """Send the trajectory; return whether the controller started to follow it in time."""
        message = JointTrajectory(joint_names=self._names)
        for waypoint in waypoints:
            point = JointTrajectoryPoint(positions=np.asarray(waypoint.q).tolist())
            seconds, part = divmod(round(1e9 * waypoint.time), 1_000_000_000)
            point.time_from_start = Duration(sec=seconds, nanosec=part)
            message.points.append(point)
        here, first = list(self._states[-1].reference_position), len(self._states)
        self._send.publish(message)

        def moving() -> Iterator[int]:
            """Indices of the states whose reference differs from the start."""
            later = enumerate(self._states[first:], first)
            return (k for k, state in later if list(state.reference_position) != here)

        if not self.until(lambda: any(moving()), _MOTION_TIMEOUT):
            return False
        self.start = _stamp(self._states[next(moving()) - 1])
        return True

    def now(self) -> float:
        """Simulated time since the trajectory began, in [s]; zero before."""
        return 1e-9 * (_stamp(self._states[-1]) - self.start) if self.start else 0.0

    # --- watching ------------------------------------------------------------------------------

    def _on_state(self, state: Any) -> None:
        self._states.append(state)
        if self.start and self._pending is None:
            request = INVERSE_DYNAMICS.type.Request(
                joint_names=state.joint_names, position=state.reference_position,
                velocity=state.reference_velocity, acceleration=state.reference_acceleration,
            )  # fmt: skip
            asked = time.perf_counter_ns()
            self._pending = (self._ask.call_async(request), state, asked)

    def _collect_answer(self) -> None:
        if self._pending is None:
            return
        future, state, asked = self._pending
        waited = 1e-9 * (time.perf_counter_ns() - asked)
        if future.done():
            self._questions.append((state, waited, future.result()))
        if future.done() or waited > _ASK_AGAIN:
            self._pending = None

    def seen(self) -> Seen:
        """All observations since the trajectory began."""
        states = [s for s in self._states if _stamp(s) >= self.start]
        columns = (np.array([getattr(s, field) for s in states]) for field in _FIELDS)
        good = [(s, waited, r) for s, waited, r in self._questions if r.success]
        return Seen(
            self._times(states), *columns,
            asked_time=self._times([s for s, *_ in good]),
            asked_effort=np.array([r.effort for *_, r in good]),
            asked_for=np.array([s.effort for s, *_ in good]),
            latencies=np.array([waited for _, waited, _ in good]),
            energy=np.reshape([[e.kinetic, e.potential, e.total, e.input, e.dissipated, e.balance]
                               for e in self._energies], (-1, 6)),
        )  # fmt: skip

    def _times(self, states: Sequence[Any]) -> Array:
        return np.array([1e-9 * (_stamp(s) - self.start) for s in states])


def _stamp(state: Any) -> int:
    return to_nanoseconds(state.header.stamp)


def _of(node: str, topic: Any) -> str:
    return topic.name.replace("~", node)
