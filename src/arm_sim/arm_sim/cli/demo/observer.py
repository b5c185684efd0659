# SPDX-License-Identifier: Apache-2.0
"""The demo's own node: sends the trajectory, observes the loop and queries torques."""

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.trajectory.reference import Waypoint
from arm_sim.cli.demo.processes import DemoFailed
from arm_sim.cli.robot.listener import Listener, trajectory_message
from arm_sim.ros.interfaces import ENERGY

_START_TIMEOUT, _MOTION_TIMEOUT = 60.0, 10.0  # [s]
_IN_TIME = f"within {_START_TIMEOUT:g} s"
_CHECK_PERIOD = 0.2  # [s]
_DISCOVERY = 0.5  # [s]: of a node, which may block the others for a third of a second
_RETRY = 1.0  # [s] until an unanswered request is repeated


class Observations(NamedTuple):
    """Observations of a motion; time starts with the trajectory, rows are samples.

    Attributes:
        time: Time in [s], shape (k,).
        reference: Desired joint positions, shape (k, n).
        position: Measured joint positions, shape (k, n).
        error: Reference minus position, shape (k, n).
        effort: Commanded torque, shape (k, n).
        query_time: Times of the service requests in [s], shape (m,).
        query_effort: Torques returned for the reference motion, shape (m, n).
        query_command: Torques commanded at those times, shape (m, n).
        latencies: Durations of the service calls in [s], shape (m,).
        work: Work since the sim's energy account was opened in [J], shape (e,).
        heat: Energy dissipated since then, likewise.
        residual: Unexplained energy since then, likewise.
    """

    time: Array
    reference: Array
    position: Array
    error: Array
    effort: Array
    query_time: Array
    query_effort: Array
    query_command: Array
    latencies: Array
    work: Array
    heat: Array
    residual: Array


class _Query(NamedTuple):
    """An answered request for the torques that a state of the controller needs."""

    state: Any
    latency: float  # [s]
    response: Any


class Observer(Listener):
    """Joins the graph of the demo; use it in a ``with`` statement.

    Args:
        names: The joints.
        check: Called periodically while waiting.
    """

    def __init__(self, names: Sequence[str], check: Callable[[], None]) -> None:
        super().__init__()
        self._names, self._check, self._next_check = list(names), check, 0.0
        self._states: list[Any] = []
        self._energies: list[Any] = []
        self._queries: list[_Query] = []
        self._next_query = 0.0
        self.start = 0  # stamp in [ns] at which the trajectory began
        self._inverse_dynamics = self.client(interfaces.INVERSE_DYNAMICS, "dynamics")
        self._info = self.client(interfaces.MODEL_INFO, "dynamics")
        self._reset = self.client(interfaces.RESET_COUNTERS, "sim")
        topic = interfaces.JOINT_TRAJECTORY
        self._trajectory = self.publisher(topic, "controller/joint_trajectory")
        self.subscribe(interfaces.CONTROLLER_STATE, "controller/state", self._on_state)
        self.subscribe(ENERGY, "sim/energy", self._energies.append)

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Process messages, with periodic checks, until a condition holds; whether it does."""

        def checked_condition() -> bool:
            if (now := time.monotonic()) >= self._next_check:
                self._check()
                self._next_check = now + _CHECK_PERIOD
            return condition()

        return super().until(checked_condition, timeout)

    def wait_for_partners(self) -> None:
        """Wait until the dynamics node answers and the controller subscribes."""
        self._demand(self._answers(self._info), f"the dynamics node did not answer {_IN_TIME}")
        self._demand(
            lambda: self._trajectory.get_subscription_count() > 0,
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
        self.spin_for(_DISCOVERY)
        self._demand(self._answers(self._reset), silence)

    def _demand(self, condition: Callable[[], bool], failure: str) -> None:
        """Wait for a condition at start-up, and fail after a timeout."""
        if not self.until(condition, _START_TIMEOUT):
            raise DemoFailed(failure)

    def _answers(self, client: Any) -> Callable[[], bool]:
        """Whether a service has answered an empty request, which is repeated every second."""
        answers, sent = [], 0.0

        def is_answered() -> bool:
            nonlocal sent
            if client.service_is_ready() and time.monotonic() > sent + _RETRY:
                answers.append(client.call_async(client.srv_type.Request()))
                sent = time.monotonic()
            return any(answer.done() for answer in answers)

        return is_answered

    def send(self, waypoints: Sequence[Waypoint]) -> bool:
        """Send the trajectory; return whether the controller started to follow it in time."""
        here, first = list(self._states[-1].reference_position), len(self._states)
        self._trajectory.publish(trajectory_message(self._names, waypoints))

        def last_at_rest() -> Any:
            """The state before the first one whose reference differs from the start, or None."""
            pairs = pairwise(self._states[first - 1 :])
            return next((a for a, b in pairs if list(b.reference_position) != here), None)

        if not self.until(lambda: last_at_rest() is not None, _MOTION_TIMEOUT):
            return False
        self.start = to_nanoseconds(last_at_rest().header.stamp)
        return True

    def now(self) -> float:
        """Simulated time since the trajectory began, in [s]; zero before."""
        return self._time(self._states[-1]) if self.start else 0.0

    def _on_state(self, state: Any) -> None:
        """Keep it, and request the torques that it needs unless an answer is awaited."""
        self._states.append(state)
        sent = time.perf_counter()
        if not self.start or sent < self._next_query:
            return
        self._next_query = sent + _RETRY
        request = interfaces.INVERSE_DYNAMICS.type.Request(
            joint_names=state.joint_names, position=state.reference_position,
            velocity=state.reference_velocity, acceleration=state.reference_acceleration,
        )  # fmt: skip

        def on_answer(future: Any) -> None:
            self._next_query = 0.0
            self._queries.append(_Query(state, time.perf_counter() - sent, future.result()))

        self._inverse_dynamics.call_async(request).add_done_callback(on_answer)

    def observations(self) -> Observations:
        """All observations since the trajectory began."""
        states = [state for state in self._states if self._time(state) >= 0.0]
        energies = [energy for energy in self._energies if self._time(energy) >= 0.0]
        queries = [query for query in self._queries if query.response.success]
        return Observations(
            time=np.array([self._time(state) for state in states]),
            reference=np.array([state.reference_position for state in states]),
            position=np.array([state.feedback_position for state in states]),
            error=np.array([state.position_error for state in states]),
            effort=np.array([state.effort for state in states]),
            query_time=np.array([self._time(query.state) for query in queries]),
            query_effort=np.array([query.response.effort for query in queries]),
            query_command=np.array([query.state.effort for query in queries]),
            latencies=np.array([query.latency for query in queries]),
            work=np.array([energy.input for energy in energies]),
            heat=np.array([energy.dissipated for energy in energies]),
            residual=np.array([energy.balance for energy in energies]),
        )  # fmt: skip

    def _time(self, message: Any) -> float:
        return 1e-9 * (to_nanoseconds(message.header.stamp) - self.start)
