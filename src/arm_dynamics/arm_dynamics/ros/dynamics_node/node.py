# SPDX-License-Identifier: Apache-2.0
"""The dynamics node: the equations of motion of an arm, as services."""

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from threading import RLock
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput, KernelError, ModelError, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.diagnostics import Diagnosis, Finding
from arm_dynamics.ros.common.endpoints import answering, guarded, subscribe
from arm_dynamics.ros.common.params import SCENE, declare, parameter, watch
from arm_dynamics.ros.common.robot_source import DescriptionLimits, described_scene, warn_unused
from arm_dynamics.ros.dynamics.answers import ANSWERS
from arm_dynamics.ros.dynamics.compiled_services import CANDIDATES, CompiledServices, native
from arm_dynamics.ros.dynamics.request_counts import RequestCounts
from arm_dynamics.ros.interfaces import ROBOT_DESCRIPTION, Service


@dataclass(frozen=True)
class DynamicsParams(DescriptionLimits):
    """Parameters of the dynamics node."""

    scene: str = parameter("", f"{SCENE}; empty: the arm is given by the robot description")
    robot_description: str = parameter(
        "", "URDF text; empty: it comes from the topic robot_description", read_only=False
    )


class DynamicsNode(Node):
    """Offers inverse and forward dynamics, their terms in joint and task space, and model facts.

    The arm comes from ``scene``, else from the parameter ``scene``, else from the parameter or
    topic ``robot_description``; an invalid description leaves the previous arm in use. One from
    the topic is built in the background.
    """

    def __init__(self, scene: Any = None, **node_kwargs: Any) -> None:
        """Start the node.

        Args:
            scene: Anything ``load_scene`` accepts, or None.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If a scene or description given at start cannot be used.
        """
        super().__init__("dynamics", **node_kwargs)
        self._dynamics: Dynamics | None = None
        self._log = Throttled(self.get_logger())
        self._lock = RLock()  # services are answered on two threads
        self._compiled: CompiledServices | None = None
        self._counts = RequestCounts()
        self._described = deque[String](maxlen=1)  # the newest one is built next
        self._builder = ThreadPoolExecutor(1, thread_name_prefix="descriptions")
        self._params = params = declare(self, DynamicsParams)
        scene = scene if scene is not None else params.scene or None
        if scene is not None:
            warn_unused(self, params.robot_description)
            self.load(scene)
            watch(self, params, _refuse)
        else:
            if params.robot_description:
                self.load_description(params.robot_description)
            subscribe(self, ROBOT_DESCRIPTION, self._build_soon)
            watch(self, params, self._redescribe, always_apply=["robot_description"])
        with suppress(KernelError):  # without compiled code, Python answers all
            self._compiled = CompiledServices(
                self, native(), self.answer, lambda: self._dynamics, self._lock
            )
        in_c = {candidate.service for candidate in CANDIDATES} if self._compiled else set()
        for service in ANSWERS:
            if service not in in_c:
                self.create_service(service.type, service.name, partial(self.answer, service))
        self._diagnosis = Diagnosis(self, self.diagnostics)

    def destroy_node(self) -> None:
        """End the services, and the node."""
        self._described.clear()
        self._builder.shutdown()
        if self._compiled is not None:
            self._compiled.close()
        super().destroy_node()

    @property
    def dynamics(self) -> Dynamics:
        """The current model.

        Raises:
            InvalidInput: If there is none yet.
        """
        if self._dynamics is None:
            raise InvalidInput(
                "there is no robot yet; give the parameter scene or robot_description, or publish "
                f"a URDF on {self.resolve_topic_name(ROBOT_DESCRIPTION.name)}"
            )
        return self._dynamics

    def load(self, scene: Any) -> None:
        """Replace the arm; on any ``ArmError`` the previous one is kept."""
        try:
            dynamics = Dynamics(scene)
        except MemoryError:
            raise ModelError("robot: there is not enough memory to build it") from None
        with self._lock:
            if self._compiled is not None:
                self._compiled.forget()
            self._dynamics = dynamics
        names = ", ".join(dynamics.joint_names)
        self.get_logger().info(f"{dynamics.n} joints: {names}; to try it: ./arm call model-info")

    def load_description(self, urdf: str) -> None:
        """Replace the arm by that of a URDF text, which is never interpreted as a path."""
        self.load(described_scene(urdf, self._params))

    def _redescribe(self, params: DynamicsParams) -> None:
        # After what came before it, which would else replace it when it is built at last.
        self._builder.submit(self.load_description, params.robot_description).result()

    def _build_soon(self, message: String) -> None:
        self._described.append(message)
        self._builder.submit(self._build_newest)

    def _build_newest(self) -> None:
        with suppress(IndexError):  # it was built with an earlier one
            guarded(self, self.on_robot_description)(self._described.pop())

    def on_robot_description(self, message: String) -> None:
        """Load a URDF, or log why it is refused; in any thread."""
        try:
            self.load_description(message.data)
        except ArmError as error:
            self._counts.descriptions_refused += 1
            kept = "the previous one is kept" if self._dynamics else "there is still no robot"
            self._log.error(f"robot_description refused, {kept}: {plain(error)}")

    def diagnostics(self) -> list[Finding]:
        """Diagnostics since the last call."""
        in_c = None if self._compiled is None else self._compiled.counts
        return [self._counts.finding(in_c)]

    def answer(self, service: Service, request: Any, response: Any) -> Any:
        """Answer one of ``ANSWERS``; errors are reported in the response."""
        with self._counts.counting(response), self._lock, answering(response, self._log):
            ANSWERS[service](self.dynamics, request, response)
        return response


def _refuse(params: DynamicsParams) -> None:
    raise InvalidInput(
        "parameter 'robot_description' cannot be set: the node has its arm from a scene; allowed: "
        "a node without one"
    )
