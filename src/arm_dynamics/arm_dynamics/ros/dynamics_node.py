# SPDX-License-Identifier: Apache-2.0
"""The dynamics node: answers what the equations of motion say, as services."""

from __future__ import annotations

import sys
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common import convert
from arm_dynamics.ros.common.diagnostics import Diagnosis
from arm_dynamics.ros.common.executor import run, surviving
from arm_dynamics.ros.common.params import DynamicsParams, declare, one_or_all, watch
from arm_dynamics.ros.common.request_counts import RequestCounts
from arm_dynamics.ros.dynamics.constrained import answer_constrained_dynamics
from arm_dynamics.ros.dynamics.task_space import answer_inverse_kinematics, fill_task_space
from arm_dynamics.scene.load import scene_from_urdf
from arm_dynamics.task_space.task_space import TaskSpace


class DynamicsNode(Node):
    """Offers inverse and forward dynamics, their terms in joint and task space, and model facts.

    The arm comes from ``scene``, else from the parameter ``scene``, else from the parameter or
    topic ``robot_description``; a new description that cannot be used leaves the one before.
    """

    def __init__(self, scene: Any = None, **node_kwargs: Any) -> None:
        """Start the node.

        Args:
            scene: Anything ``load_scene`` takes, or None.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If a scene or description given at start cannot be used.
        """
        super().__init__("dynamics", **node_kwargs)
        self._dynamics: Dynamics | None = None
        self._counts = RequestCounts()
        self._params = declare(self, DynamicsParams)
        scene = scene if scene is not None else self._params.scene or None
        if scene is not None:
            self.load(scene)
        else:
            if self._params.robot_description:
                self.load_description(self._params.robot_description)
            topic = interfaces.ROBOT_DESCRIPTION
            self.create_subscription(
                topic.type,
                topic.name,
                surviving(self, self.on_robot_description),
                topic.subscribe,
            )
            watch(self, lambda: self._params, self._apply)
        for service, callback in (
            (interfaces.INVERSE_DYNAMICS, self.on_inverse_dynamics),
            (interfaces.FORWARD_DYNAMICS, self.on_forward_dynamics),
            (interfaces.DYNAMICS_TERMS, self.on_dynamics_terms),
            (interfaces.CONSTRAINED_DYNAMICS, self.on_constrained_dynamics),
            (interfaces.MODEL_INFO, self.on_model_info),
            (interfaces.TASK_SPACE, self.on_task_space),
            (interfaces.INVERSE_KINEMATICS, self.on_inverse_kinematics),
        ):
            self.create_service(service.type, service.name, self._counts.counted(callback))
        self._diagnosis = Diagnosis(self, lambda: [self._counts.finding(self)])

    @property
    def dynamics(self) -> Dynamics:
        """The model in force.

        Raises:
            InvalidInput: If there is none yet.
        """
        if self._dynamics is None:
            raise InvalidInput(
                "there is no robot yet; give the parameter scene or robot_description, or publish "
                f"a URDF on {self.resolve_topic_name(interfaces.ROBOT_DESCRIPTION.name)}"
            )
        return self._dynamics

    def load(self, scene: Any) -> None:
        """Put another arm in force; on any ``ArmError`` the one before stays."""
        self._dynamics = Dynamics(scene)
        joints = ", ".join(self._dynamics.joint_names)
        self.get_logger().info(f"{self._dynamics.n} joints: {joints}")

    def load_description(self, urdf: str) -> None:
        """Put the arm of a URDF text in force; the text is never taken for a path."""
        self.load(scene_from_urdf(urdf))

    def on_robot_description(self, message: String) -> None:
        """Take a URDF from the topic, or say why not."""
        try:
            self.load_description(message.data)
        except ArmError as error:
            self._counts.descriptions_refused += 1
            kept = "the one before stays" if self._dynamics else "there is still no robot"
            self.get_logger().error(f"robot_description refused, {kept}: {error}")

    def _apply(self, params: DynamicsParams) -> None:
        if params.robot_description != self._params.robot_description:
            self.load_description(params.robot_description)
        self._params = params

    def _batch(self, request: Any, most: int) -> convert.Batch:
        names = self.dynamics.joint_names
        return convert.Batch(request.joint_names, names, request.position, most)

    def on_inverse_dynamics(self, request: Any, response: Any) -> Any:
        """Answer ``~/inverse_dynamics``."""
        with convert.answering(response, self.get_logger()):
            batch = self._batch(request, interfaces.MAX_POINTS)
            v = batch.read("velocity", request.velocity)
            a = batch.read("acceleration", request.acceleration)
            tau = self.dynamics.inverse(batch.q, v, a, request.terms)
            response.effort = batch.vectors(tau)
            response.joint_names = batch.joint_names
        return response

    def on_forward_dynamics(self, request: Any, response: Any) -> Any:
        """Answer ``~/forward_dynamics``."""
        with convert.answering(response, self.get_logger()):
            batch = self._batch(request, interfaces.MAX_POINTS)
            v = batch.read("velocity", request.velocity)
            tau = batch.read("effort", request.effort)
            a = self.dynamics.forward(batch.q, v, tau)
            response.acceleration = batch.vectors(a)
            response.joint_names = batch.joint_names
        return response

    def on_constrained_dynamics(self, request: Any, response: Any) -> Any:
        """Answer ``~/constrained_dynamics``."""
        with convert.answering(response, self.get_logger()):
            batch = self._batch(request, interfaces.MAX_TERMS_POINTS)
            answer_constrained_dynamics(request, response, self.dynamics, batch)
        return response

    def on_dynamics_terms(self, request: Any, response: Any) -> Any:
        """Answer ``~/dynamics_terms``."""
        with convert.answering(response, self.get_logger()):
            dynamics, batch = self.dynamics, self._batch(request, interfaces.MAX_TERMS_POINTS)
            v = batch.read("velocity", request.velocity)
            kinetic, potential = dynamics.energy(batch.q, v)
            response.mass_matrix = batch.matrices(dynamics.mass_matrix(batch.q))
            response.coriolis_matrix = batch.matrices(dynamics.coriolis_matrix(batch.q, v))
            response.gravity = batch.vectors(dynamics.gravity(batch.q))
            response.friction = batch.vectors(dynamics.friction(v, q=batch.q))
            response.kinetic_energy = convert.to_array(convert.finite_answer(kinetic))
            response.potential_energy = convert.to_array(convert.finite_answer(potential))
            response.joint_names = batch.joint_names
        return response

    def on_task_space(self, request: Any, response: Any) -> Any:
        """Answer ``~/task_space``."""
        with convert.answering(response, self.get_logger()):
            batch = self._batch(request, interfaces.MAX_TERMS_POINTS)
            v = batch.read("velocity", request.velocity)
            axes = one_or_all(request.axes) or "pose"
            task = TaskSpace(self.dynamics, request.frame, request.reference, axes)
            direction = request.direction
            felt = task.effective_mass(batch.q, direction) if len(direction) else None
            fill_task_space(response, batch, task.axes, task.terms(batch.q, v), felt)
        return response

    def on_inverse_kinematics(self, request: Any, response: Any) -> Any:
        """Answer ``~/inverse_kinematics``."""
        with convert.answering(response, self.get_logger()):
            answer_inverse_kinematics(request, response, self.dynamics)
        return response

    def on_model_info(self, request: Any, response: Any) -> Any:
        """Answer ``~/model_info``."""
        del request  # empty
        with convert.answering(response, self.get_logger()):
            convert.fill_model_info(response, self.dynamics.model)
        return response


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    sys.exit(run(DynamicsNode, args))
