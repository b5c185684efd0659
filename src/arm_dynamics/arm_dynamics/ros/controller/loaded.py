# SPDX-License-Identifier: Apache-2.0
"""The controllers that a node may run: built-in ones, and user classes named at its start."""

from __future__ import annotations

from arm_dynamics.control.custom import Maker, is_own, load_controller
from arm_dynamics.control.factory import NAMES, Settings, make_controller
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, choices
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.controller.controller_params import ControllerParams


class Loaded:
    """Controllers by name.

    User code is imported here, when the node starts, and never later: a parameter change can only
    select among the loaded controllers.
    """

    def __init__(self, params: ControllerParams, model: ArmModel, settings: Settings) -> None:
        """Load the controllers that the parameters name, and create each once.

        Args:
            params: Parameters at the start of the node.
            model: The arm.
            settings: Settings of the controllers.

        Raises:
            InvalidInput: If one cannot be loaded or created.
        """
        if not all(isinstance(name, str) for name in params.controllers):
            raise InvalidInput(
                f"parameter 'controllers' is {params.controllers}; texts such as "
                "package.module:Class are expected"
            )
        named = dict.fromkeys((params.controller, *params.controllers))
        self._own = {name: load_controller(name) for name in named if is_own(name)}
        for name in named:
            self.maker(name)
        for maker in self._own.values():
            make_controller(maker, Dynamics(model), settings)

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
