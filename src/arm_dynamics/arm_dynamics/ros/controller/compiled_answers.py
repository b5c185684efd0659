# SPDX-License-Identifier: Apache-2.0
"""Answers ordinary joint states in C, without the interpreter lock.

A thread waits for states in C. Most are ordinary: time, arm and reference have advanced by one
step. C answers those with bitwise the same result as Python. All other states are passed to Python
unchanged, which alone decides on them. Jumps, references, tolerances, repeated states and the
tracking state are matters of C for both.

Python changes the parts of the controller under a lock that C holds while it answers a state. C
stops answering at every change, and resumes after the next answer by Python.
"""

from collections.abc import Callable
from ctypes import byref, c_void_p
from functools import partial
from threading import Thread

from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from arm_dynamics.ros.common.endpoints import guarded
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.controller.controller_library import HEADER, library
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.shared_answers import Parts, SharedAnswers
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_dynamics.ros.joint_state import FAILED

_ENDED = HEADER.constants["ENDED"]
# Fast DDS's listeners may take and write; others hold locks meanwhile that taking needs.
_TAKE_IN_CALLBACKS = ("rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")


class CompiledAnswers:
    """Answers ordinary states in C and passes all others to Python.

    As a context manager it is the lock of the controller's parts, and stops C; it may be nested.

    From ``start`` to ``close``: C answers states until one is not ordinary. Then it stops, and
    ``answer`` is called for that one, with the lock held. It ends with ``resume``, after which C
    answers again, or without, and the next state comes to ``answer``, too.

    Example:
        >>> answers = CompiledAnswers()
        >>> answers.start(node, parts, answer, claim, direct=True)
        >>> with answers:
        ...     follow(goal)

    Attributes:
        obstacle: Why C answers no states at present; empty if it does.
        count: Number of states that C has answered.
    """

    def __init__(self) -> None:
        self.obstacle, self.count = "the executor answers", 0
        self._receiver = c_void_p(None)  # set from ``start`` to ``close``
        self._shared: SharedAnswers | None = None
        self._summarized = 0  # states, at the last summary

    def start(
        self, node: Node, parts: Parts, answer: Callable[[bytes], None], claim: Callable[[], None],
        direct: bool,
    ) -> bool:  # fmt: skip
        """Subscribe to the states and start the thread that answers them.

        Args:
            node: The controller.
            parts: Its parts.
            answer: Answers a state in Python; called with the lock held.
            claim: Called by the thread before the first state.
            direct: Whether C may answer on the thread of the middleware that brings a state, where
                the middleware allows it: that saves a change of threads.

        Returns:
            Whether it was started; if not, ``obstacle`` says why.
        """
        self._native, self._reader = library(), parts.reader
        self._newest = PolledSubscription(node, JOINT_STATES)
        receiver = c_void_p(self._native.receiver_create(self._newest.pointer))
        if not receiver:
            self.obstacle = "the middleware does not report new messages"
            self._newest.close()
            return False
        self._reader.open(self._newest.pointer)
        self._shared, self._receiver = SharedAnswers(parts), receiver
        self._answer, self._claim = answer, claim
        self._direct = direct and get_rmw_implementation_identifier() in _TAKE_IN_CALLBACKS
        self._pass_on = guarded(node, self._in_python)
        node.context.on_shutdown(self._end)
        self._thread = Thread(target=self._serve, name="states", daemon=True)
        self._thread.start()
        return True

    def close(self) -> None:
        """End the thread and the subscription; call before the node is destroyed."""
        if not self._receiver:
            return
        self._end()
        self._thread.join()
        self._native.receiver_free(self._receiver)
        self._receiver = c_void_p(None)
        self._reader.close()
        self._newest.close()

    def __enter__(self) -> None:
        """Lock the parts of the controller and stop C from answering."""
        if self._receiver:
            self._native.receiver_lock(self._receiver)
            self._stop()

    def __exit__(self, *_: object) -> None:
        """Unlock them."""
        if self._receiver:
            self._native.receiver_unlock(self._receiver)

    def interrupt(self) -> None:
        """Have the next state answered in Python; may be called from any thread."""
        if self._shared is not None:
            self._shared.structure.interrupt = 1

    def summary(self) -> dict[str, str | int | float]:
        """Values for the diagnostics; times since the last call. The lock must be held."""
        total, longest = (0, 0) if self._shared is None else self._shared.take_durations()
        values: dict[str, str | int | float] = {
            "answered in C": self.count,
            "answered in Python": self.obstacle or "few states, as after a change",
            "answer in C [µs]": 1e-3 * total / max(1, self.count - self._summarized),
            "longest answer in C [µs]": 1e-3 * longest,
        }
        self._summarized = self.count
        return values

    def resume(self, params: ControllerParams, refusal: str = "") -> None:
        """Let C answer the next states, if possible, unless for the reason of a ``refusal``.

        Call it at the end of ``answer``, as the lock must be held.
        """
        self.obstacle = refusal or self._shared.activate(params)

    def _stop(self) -> None:
        self.count += self._shared.deactivate()

    def _end(self) -> None:
        if self._receiver:
            self._native.receiver_end(self._receiver)

    def _serve(self) -> None:
        """Answer states until the end."""
        self._claim()
        self._native.receiver_lock(self._receiver)
        answers = byref(self._shared.structure)
        serve = partial(self._native.receiver_serve, self._receiver, answers, self._direct)
        while (outcome := serve()) != _ENDED:
            self._stop()
            self._pass_on(outcome)
        self._native.receiver_unlock(self._receiver)

    def _in_python(self, outcome: int) -> None:
        """Answer the state that C has taken with this outcome."""
        if outcome != FAILED:
            self._answer(self._reader.raw)
        elif message := self._newest.take():  # or it raises an error with the reason
            self._answer(message[0])
