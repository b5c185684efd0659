# SPDX-License-Identifier: Apache-2.0
"""Services answered by C code, from the request to the response, without the interpreter lock.

A thread waits until ROS signals requests. Requests that C does not support or finds invalid are
passed to Python, which alone rejects requests. The functions are compiled in the background after
a number of calls of a service, since a few calls would not be worth it.
"""

import ctypes
from collections import Counter
from collections.abc import Callable, Sequence
from ctypes import c_char_p, c_void_p
from functools import cache
from pathlib import Path
from threading import RLock, Thread
from typing import Any, NamedTuple

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_profile_services_default
from rclpy.type_support import check_for_type_support

from arm_dynamics.codegen.header import Header
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import KernelError, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.rcl_code import code_of_nodes
from arm_dynamics.ros.common.threads.background import Background
from arm_dynamics.ros.dynamics.c_message import CMessage
from arm_dynamics.ros.interfaces import Service
from arm_dynamics.terms.compiled import rows
from arm_dynamics.terms.table import FORWARD, INVERSE, OF_SERVICE, Entry


class Candidate(NamedTuple):
    """A service that C may answer: its terms, and the largest number of points of a request."""

    service: Service
    terms: tuple[Entry, ...]
    max_points: int


# In the order of services.c
CANDIDATES = (
    Candidate(interfaces.INVERSE_DYNAMICS, (INVERSE,), interfaces.MAX_POINTS),
    Candidate(interfaces.FORWARD_DYNAMICS, (FORWARD,), interfaces.MAX_POINTS),
    Candidate(interfaces.DYNAMICS_TERMS, OF_SERVICE, interfaces.MAX_TERMS_POINTS),
)
MIN_CALLS = 20  # of a service, after which compiling it is worth the time
SOURCE = Path(__file__).with_name("native") / "services.c"
HEADER = Header(SOURCE.with_suffix(".h"))
_ENDED = HEADER.constants["ENDED"]
_SharedAnswer = HEADER.structure("answer_t")


def code_of(entries: Sequence[Entry], dynamics: Dynamics) -> Any | None:
    """The C function that computes terms for a service; None if it cannot be compiled."""
    terms = [(entry, ()) for entry in entries]
    function = rows(dynamics.model, dynamics.steady_friction, terms, fixed=("external",))
    return function and function.entry


@cache
def native() -> ctypes.CDLL:
    """The compiled functions.

    Raises:
        KernelError: If they are not available.
    """
    return code_of_nodes(SOURCE, headers=(HEADER,), packages=("arm_msgs",))


class _Answer:
    """What C answers a service with, for one arm.

    Attributes:
        shared: ``answer_t`` of services.h, where the fields are explained.
    """

    def __init__(self, candidate: Candidate, dynamics: Dynamics, rows: Any) -> None:
        names, friction = list(dynamics.joint_names), dynamics.steady_friction
        self._level, self._zeros = np.array(friction.joints.level), np.zeros(dynamics.n)
        response = candidate.service.type.Response(success=True, joint_names=names)
        self._response = CMessage.of(response)
        self._names = (c_char_p * len(names))(*(name.encode() for name in names))
        self.shared = _SharedAnswer(
            rows=ctypes.cast(rows, c_void_p), response=self._response.address,
            names=ctypes.addressof(self._names),
            joints=len(names), max_points=candidate.max_points,
            level=self._level.ctypes.data if friction.has_dry else None,
            zeros=self._zeros.ctypes.data,
        )  # fmt: skip

    def close(self) -> None:
        """Free its memory, once nothing uses it."""
        self._response.close()


class CompiledServices:
    """Offers the services of ``CANDIDATES`` for a node.

    Args:
        node: The node.
        library: Result of ``native``.
        answer: Answers a request in Python; called in a thread of its own.
        dynamics: Returns the current arm, if there is one.
        lock: Held while the arm is used or exchanged.

    Raises:
        KernelError: If this ROS does not signal service calls.
    """

    def __init__(
        self, node: Node, library: ctypes.CDLL, answer: Callable[[Service, Any, Any], Any],
        dynamics: Callable[[], Dynamics | None], lock: RLock,
    ) -> None:  # fmt: skip
        self._log, self._native, self._answer = Throttled(node.get_logger()), library, answer
        self._dynamics, self._lock = dynamics, lock
        self._answers: dict[int, _Answer] = {}  # by index of the service, as all below
        self._calls, self._tries = Counter[int](), set[int]()
        self._builder = Background("builder")
        self._handles = []
        profile = qos_profile_services_default.get_c_qos_profile()
        for service, *_ in CANDIDATES:  # which no executor handles
            check_for_type_support(service.type)
            with node.handle:
                self._handles.append(
                    rclpy_implementation.Service(node.handle, service.type, service.name, profile)
                )
        self._requests = [CMessage(service.type.Request) for service, *_ in CANDIDATES]
        pointers = [handle.pointer for handle in self._handles]
        requests = [message.address.value for message in self._requests]
        table = c_void_p * len(CANDIDATES)
        self._server = c_void_p(library.server_create(table(*pointers), table(*requests)))
        if not self._server:
            self._release()
            raise KernelError("this ROS does not signal service calls")
        node.context.on_shutdown(self._end)
        self._thread = Thread(target=self._serve, name="services", daemon=True)
        self._thread.start()

    @property
    def counts(self) -> ctypes.Structure:
        """Counts of requests that C answered: ``counts_t`` of services.h."""
        counts = HEADER.structure("counts_t")()
        if self._server:
            self._native.server_counts(self._server, ctypes.byref(counts))
        return counts

    def forget(self) -> None:
        """Stop answering for the current arm, before another one is set."""
        with self._lock:
            for k, answer in self._answers.items():
                self._native.server_set_answer(self._server, k, ctypes.byref(_SharedAnswer()))
                answer.close()
            self._answers.clear()
            self._calls.clear()
            self._tries.clear()

    def close(self) -> None:
        """End the thread and the services; before the node is destroyed."""
        if not self._server:
            return
        self._end()
        self._thread.join()
        self.forget()
        self._native.server_free(self._server)
        self._server = c_void_p(None)
        self._release()

    def _release(self) -> None:
        self._builder.close()
        for handle in self._handles:
            handle.destroy_when_not_in_use()
        for message in self._requests:
            message.close()

    def _end(self) -> None:
        if self._server:
            self._native.server_end(self._server)

    def _serve(self) -> None:
        """Answer requests that C passes on, until the end."""
        while (k := self._native.server_serve(self._server)) != _ENDED:
            service = CANDIDATES[k].service
            try:
                request = self._requests[k].read()
                response = CMessage.of(self._answer(service, request, service.type.Response()))
                self._native.server_respond(self._server, k, response.address)
                response.close()
                with self._lock:
                    self._builder.deliver()
                    self._compile(k)
            except Exception as error:
                text = f"a request was ignored after an unexpected failure: {error!r}"
                self._log.error(plain(text))

    def _compile(self, k: int) -> None:
        """Start compiling the answer to a service, once that is worth it."""
        current = self._dynamics()
        self._calls[k] += 1
        if current is None or self._calls[k] < MIN_CALLS or k in self._tries or self._builder.busy:
            return
        self._tries.add(k)
        self._builder.start(
            lambda: code_of(CANDIDATES[k].terms, Dynamics(current.model)),
            lambda code: self._use(k, current, code()),
        )

    def _use(self, k: int, dynamics: Dynamics, rows: Any) -> None:
        if rows is None or dynamics is not self._dynamics():
            return
        self._answers[k] = answer = _Answer(CANDIDATES[k], dynamics, rows)
        self._native.server_set_answer(self._server, k, ctypes.byref(answer.shared))
