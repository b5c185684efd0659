# SPDX-License-Identifier: Apache-2.0
"""Services answered by C code, from the request to the response, without the interpreter lock.

A thread waits until ROS signals requests. Requests that C does not support or finds invalid are
passed to Python, which alone rejects requests. The functions are compiled in the background after
a number of calls of a service, since a few calls would not be worth it.
"""

from __future__ import annotations

import ctypes
from collections import Counter
from collections.abc import Callable, Sequence
from ctypes import c_char_p, c_void_p
from functools import cache
from pathlib import Path
from threading import RLock, Thread
from typing import Any

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_profile_services_default
from rclpy.type_support import check_for_type_support

from arm_dynamics.codegen.header import Header
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import KernelError, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.background import Background
from arm_dynamics.ros.common.rcl_code import code_of_nodes
from arm_dynamics.ros.dynamics.c_message import CMessage
from arm_dynamics.ros.interfaces import (
    DYNAMICS_TERMS,
    FORWARD_DYNAMICS,
    INVERSE_DYNAMICS,
    MAX_POINTS,
    MAX_TERMS_POINTS,
    Service,
)
from arm_dynamics.terms.compiled import rows
from arm_dynamics.terms.table import FORWARD, INVERSE, OF_SERVICE, Entry

COMPILED: tuple[tuple[Service, tuple[Entry, ...], int], ...] = (
    (INVERSE_DYNAMICS, (INVERSE,), MAX_POINTS),
    (FORWARD_DYNAMICS, (FORWARD,), MAX_POINTS),
    (DYNAMICS_TERMS, OF_SERVICE, MAX_TERMS_POINTS),
)
"""Services in the order of services.c, their terms, and their largest numbers of points."""
WORTH = 20  # number of requests after which compiling a service is worth the time
SOURCE = Path(__file__).with_name("native") / "services.c"
HEADER = Header(SOURCE.with_suffix(".h"))
_ENDED = HEADER.constants["ENDED"]
_Answer = HEADER.structure("answer_t")
"""``answer_t`` of services.h, where the fields are explained."""


def code_of(entries: Sequence[Entry], dynamics: Dynamics) -> Any | None:
    """The C function that computes terms for a service; None if it cannot be compiled."""
    asked = [(entry, ()) for entry in entries]
    made = rows(dynamics.model, dynamics.steady_friction, asked, fixed=("external",))
    return made and made.entry


@cache
def native() -> ctypes.CDLL:
    """The compiled functions.

    Raises:
        KernelError: If they are not available.
    """
    return code_of_nodes(SOURCE, headers=(HEADER,), packages=("arm_msgs",))


class _Known:
    """Data with which C runs a service, for one arm."""

    def __init__(self, service: Service, most: int, dynamics: Dynamics, rows: Any) -> None:
        names, friction = list(dynamics.joint_names), dynamics.steady_friction
        self._level, self._zeros = np.array(friction.joints.level), np.zeros(dynamics.n)
        self._response = CMessage.of(service.type.Response(success=True, joint_names=names))
        self._names = (c_char_p * len(names))(*(name.encode() for name in names))
        self.answer = _Answer(
            rows=ctypes.cast(rows, c_void_p), response=self._response.place,
            names=ctypes.addressof(self._names),
            joints=len(names), most=most,
            level=self._level.ctypes.data if friction.has_dry else None,
            zeros=self._zeros.ctypes.data,
        )  # fmt: skip

    def close(self) -> None:
        """Free its memory, once nothing uses it."""
        self._response.close()


class CompiledServices:
    """Offers the services of ``COMPILED`` for a node.

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
        self._arm, self._lock = dynamics, lock
        self._known: dict[int, _Known] = {}
        self._asked, self._tried = Counter[int](), set[int]()
        self._builder = Background("builder")
        self._handles = []
        profile = qos_profile_services_default.get_c_qos_profile()
        for service, *_ in COMPILED:  # which no executor handles
            check_for_type_support(service.type)
            about = service.type, service.name, profile
            with node.handle:
                self._handles.append(rclpy_implementation.Service(node.handle, *about))
        self._requests = [CMessage(service.type.Request) for service, *_ in COMPILED]
        pointers = [handle.pointer for handle in self._handles]
        places = [message.place.value for message in self._requests]
        table = c_void_p * len(COMPILED)
        self._server = c_void_p(library.server(table(*pointers), table(*places)))
        if not self._server:
            self._give_back()
            raise KernelError("this ROS does not signal service calls")
        node.context.on_shutdown(self._end)
        self._thread = Thread(target=self._serve, name="services", daemon=True)
        self._thread.start()

    @property
    def counts(self) -> ctypes.Structure:
        """Counts of requests that C answered: ``counts_t`` of services.h."""
        counts = HEADER.structure("counts_t")()
        if self._server:
            self._native.counts(self._server, ctypes.byref(counts))
        return counts

    @property
    def compiled(self) -> list[Service]:
        """The services that C answers now."""
        return [COMPILED[k][0] for k in self._known]

    def forget(self) -> None:
        """Stop answering for the current arm, before another one is set."""
        with self._lock:
            for k, known in self._known.items():
                self._native.use(self._server, k, ctypes.byref(_Answer()))
                known.close()
            self._known.clear()
            self._asked.clear()
            self._tried.clear()

    def close(self) -> None:
        """End the thread and the services; before the node is destroyed."""
        if not self._server:
            return
        self._end()
        self._thread.join()
        self.forget()
        self._native.server_free(self._server)
        self._server = c_void_p(None)
        self._give_back()

    def _give_back(self) -> None:
        self._builder.close()
        for handle in self._handles:
            handle.destroy_when_not_in_use()
        for message in self._requests:
            message.close()

    def _end(self) -> None:
        if self._server:
            self._native.end(self._server)

    def _serve(self) -> None:
        """Answer requests that C passes on, until the end."""
        while (k := self._native.serve(self._server)) != _ENDED:
            service, *_ = COMPILED[k]
            try:
                request = self._requests[k].read()
                response = CMessage.of(self._answer(service, request, service.type.Response()))
                self._native.respond(self._server, k, response.place)
                response.close()
                with self._lock:
                    self._builder.deliver()
                    self._compile(k)
            except Exception as error:
                text = f"a request was ignored after an unexpected failure: {error!r}"
                self._log.error(plain(text))

    def _compile(self, k: int) -> None:
        """Start compiling the answer to a service, once that is worth it."""
        arm = self._arm()
        self._asked[k] += 1
        if arm is None or self._asked[k] < WORTH or k in self._tried or self._builder.busy:
            return
        self._tried.add(k)
        _, entries, _ = COMPILED[k]
        self._builder.start(
            lambda: code_of(entries, Dynamics(arm.model)),
            lambda built: self._use(k, arm, built()),
        )

    def _use(self, k: int, arm: Dynamics, rows: Any) -> None:
        if rows is None or arm is not self._arm():
            return
        service, _, most = COMPILED[k]
        self._known[k] = known = _Known(service, most, arm, rows)
        self._native.use(self._server, k, ctypes.byref(known.answer))
