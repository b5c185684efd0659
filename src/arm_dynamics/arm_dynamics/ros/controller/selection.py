# SPDX-License-Identifier: Apache-2.0
"""The controllers that a node may run, and the active one, which may change in motion."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from rclpy.node import Node

from arm_dynamics.control import factory
from arm_dynamics.control.compiled_law import Preparation, preparation
from arm_dynamics.control.controller import AnyController
from arm_dynamics.control.custom import Maker, is_own, load_controller
from arm_dynamics.control.factory import NAMES, Settings, make_controller
from arm_dynamics.control.filters.derived_velocity import DerivedVelocity
from arm_dynamics.control.switch import Switch
from arm_dynamics.control.wrappers import Saturated
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput, choices, plain
from arm_dynamics.ros.common.diagnostics import Lateness
from arm_dynamics.ros.common.params import watch
from arm_dynamics.ros.common.threads.background import Background
from arm_dynamics.ros.controller.answer_log import AnswerLog
from arm_dynamics.ros.controller.compiled_answers import CompiledAnswers
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.task_space.task_space import TaskSpace

_GAINS = ("bandwidth", "damping_ratio", "stiffness", "damping")
_FREE = "float"  # the controller for hand guiding: the arm moves away from its reference


class _Controllers:
    """Controllers by name.

    User code is imported here, when the node starts, and never later: a parameter change can only
    select among the loaded controllers.
    """

    def __init__(self, params: ControllerParams, dynamics: Dynamics, settings: Settings) -> None:
        """Load the controllers that the parameters name, and create each once.

        Raises:
            InvalidInput: If one cannot be loaded or created.
        """
        if not all(isinstance(name, str) for name in params.controllers):
            raise InvalidInput(
                f"parameter 'controllers' is {params.controllers}; texts such as "
                "package.module:Class are expected"
            )
        names = dict.fromkeys((params.controller, *params.controllers))
        self._own = {name: load_controller(name) for name in names if is_own(name)}
        for name in names:
            self.maker(name)  # which refuses unknown ones
        for maker in self._own.values():
            make_controller(maker, dynamics, settings)

    def maker(self, name: str) -> str | Maker:
        """The argument of ``make_controller`` for a name.

        Raises:
            InvalidInput: If there is no controller of that name.
        """
        if name in NAMES:
            return name
        if name in self._own:
            return self._own[name]
        hint = "; others must be named in 'controllers' when the node is started"
        allowed = choices(name, [*NAMES, *self._own]) + (hint if is_own(name) else "")
        raise InvalidInput(f"parameter 'controller' is '{name[:100]}'; allowed: one of {allowed}")


class ControllerSelection:
    """Follows the parameters: prepares a controller in the background, then switches to it.

    Attributes:
        params: The parameters in force, of the newest controller.
        active_params: Those of the active controller.
        control: The active controller, and the transition to the next one.
        builder: Prepares controllers.
        gain_warning: A warning of gains that the loop does not carry; empty if it does.
    """

    def __init__(
        self, node: Node, params: ControllerParams, dynamics: Dynamics, answers: CompiledAnswers,
        log: AnswerLog, goals: Goals, lateness: Lateness, velocity: DerivedVelocity | None,
    ) -> None:  # fmt: skip
        """Make the first controller; the parts are those of the node.

        Raises:
            InvalidInput: If parameters cannot be used.
        """
        self._node, self._dynamics, self._answers, self._log = node, dynamics, answers, log
        self._goals, self._lateness, self._velocity = goals, lateness, velocity
        self._restore_params: Callable[[ControllerParams], None] = lambda params: None
        self.gain_warning = ""
        self._controllers = _Controllers(params, dynamics, self._settings(params))
        self.params = self.active_params = params
        self.control = Switch(self._controller_of(params), params.settings.dt, params.switch_time)
        self.builder = Background("builder", answers.interrupt)
        self._build_ahead()

    def watch(self) -> None:
        """Follow the parameters from now on."""
        self._check_settings()
        self._restore_params = watch(self._node, self.params, self._apply)

    def obstacle(self) -> str:
        """Reason why trajectories are not followed now; empty if they are."""
        is_free = _FREE in (self.params.controller, self.active_params.controller)
        refusal = f"controller '{_FREE}' follows no trajectories" if is_free else ""
        return self._log.failure or refusal

    def _settings(self, params: ControllerParams) -> Settings:
        return replace(params.settings, limit=self._dynamics.model.effort_limit)

    def _controller_of(self, params: ControllerParams) -> AnyController:
        frame, axes = params.settings.frame, params.settings.axes
        if frame:  # rejected here, not when a controller first uses it
            TaskSpace(self._dynamics, frame, selection=axes)
        settings, maker = self._settings(params), self._controllers.maker(params.controller)
        control = make_controller(maker, self._dynamics, settings)
        factory.refuse_unsteady(settings)
        return control

    def _build_ahead(self) -> None:
        """Prepare the first controller now, and a task-space controller in the background."""
        if job := _preparation(self.control.active):
            job()
        if not self.params.settings.frame:
            return
        name, settings = factory.IN_TASK_SPACE[0], self._settings(self.params)
        another = make_controller(name, self._dynamics, settings)
        if job := _preparation(another):
            self.builder.start(job, lambda result: None)  # errors matter when it is selected

    def _apply(self, params: ControllerParams) -> None:
        with self._answers:
            control = self._controller_of(params)
            activate = partial(self._activate, params, control)
            self.params = params
            self._log.forget()
            self.builder.give_up()
            if (job := _preparation(control)) is None:
                activate()
            else:
                self.builder.start(job, partial(self._finish_switch, activate))
            self._check_settings()

    def _activate(self, params: ControllerParams, control: AnyController) -> None:
        """Switch to a controller that is prepared."""
        before, self.active_params = self.active_params, params
        if self._log.failure:  # the arm has been braked: there is no torque to fade from
            self.control.restart()
            self._goals.drop("as the controller had failed")
        if _differs_only_in_gains(params, before):
            self.control.retune(control)
            return
        self.control.to(control)
        self._node.get_logger().info(f"controller {params.controller}")
        if before.controller == _FREE and params.controller != _FREE:
            self._goals.drop("as the arm was led by hand")

    def _finish_switch(self, activate: Callable[[], None], result: Callable[[], object]) -> None:
        try:
            result()
        except ArmError as error:
            kept = "controller refused, the old one and its parameters stay in force"
            self._node.get_logger().error(f"{kept}: {plain(error)}")
            self.params = self.active_params
            self._restore_params(self.active_params)
            self._check_settings()
        else:
            activate()

    def _check_settings(self) -> None:
        """Warn of friction that the scene lacks, and of gains that the loop does not carry."""
        settings = self._settings(self.params)
        if settings.friction and not self._dynamics.steady_friction.is_present:
            self._node.get_logger().warning("friction = true: the controller's scene has none")
        self._update_gain_warning(settings)

    def _update_gain_warning(self, settings: Settings) -> None:
        """Set and log ``gain_warning``."""
        maker = self._controllers.maker(self.params.controller)
        delay = self._dynamics.model.scene.delay + max(settings.dt, self._lateness.longest)
        delay += 0.0 if self._velocity is None else self._velocity.delay
        self.gain_warning = factory.overreach(maker, self._dynamics, settings, delay)
        if self.gain_warning:
            self._node.get_logger().warning(self.gain_warning)


def _differs_only_in_gains(params: ControllerParams, before: ControllerParams) -> bool:
    gains = {name: getattr(before.settings, name) for name in _GAINS}
    return replace(params, settings=replace(params.settings, **gains)) == before


def _preparation(control: AnyController) -> Preparation | None:
    return preparation(control.control if isinstance(control, Saturated) else control)
