# SPDX-License-Identifier: Apache-2.0
"""Controllers: objects with one method, ``torque(state, reference)``, and wrappers around them.

They depend on the model of the arm and on references, and not on what applies their torques.
Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.control.compiled_law import (
        Compiled,
        CompiledComputedTorque,
        Law,
        preparation,
    )
    from arm_dynamics.control.computed_torque import (
        ComputedTorque,
        Controller,
        Measured,
        Restartable,
        gains,
        held_gains,
    )
    from arm_dynamics.control.custom import Watched, load_controller
    from arm_dynamics.control.factory import NAMES, Settings, make_controller
    from arm_dynamics.control.friction_compensation import FrictionFeedForward
    from arm_dynamics.control.joint_space import (
        PD,
        PID,
        FeedForwardPD,
        GravityCompensation,
        JointImpedance,
        JointLaw,
        PDGravity,
        tuned,
    )
    from arm_dynamics.control.task_space import (
        AlongJoints,
        CartesianImpedance,
        MotionForce,
        OperationalSpace,
        TaskController,
        at_rest,
        task_reference,
    )
    from arm_dynamics.control.wrappers import (
        AnyController,
        DisturbanceObserver,
        HalfTickAhead,
        Saturated,
        Switch,
    )

__all__ = [
    "AlongJoints", "AnyController", "CartesianImpedance", "Compiled",
    "CompiledComputedTorque", "ComputedTorque", "Controller", "DisturbanceObserver",
    "FeedForwardPD", "FrictionFeedForward", "GravityCompensation", "HalfTickAhead",
    "JointImpedance", "JointLaw", "Law", "Measured", "MotionForce", "NAMES", "OperationalSpace",
    "PD", "PDGravity", "PID", "Restartable", "Saturated", "Settings", "Switch", "TaskController",
    "Watched", "at_rest", "gains", "held_gains", "load_controller", "make_controller",
    "preparation", "task_reference", "tuned",
]  # fmt: skip
__getattr__, __dir__ = on_demand(__name__, {
    "compiled_law": ("Compiled", "CompiledComputedTorque", "Law", "preparation"),
    "computed_torque": ("ComputedTorque", "Controller", "Measured", "Restartable",
        "gains", "held_gains"),
    "custom": ("Watched", "load_controller"),
    "factory": ("NAMES", "Settings", "make_controller"),
    "friction_compensation": ("FrictionFeedForward",),
    "joint_space": ("PD", "PID", "FeedForwardPD", "GravityCompensation", "JointImpedance",
        "JointLaw", "PDGravity", "tuned"),
    "task_space": ("AlongJoints", "CartesianImpedance", "MotionForce", "OperationalSpace",
        "TaskController", "at_rest", "task_reference"),
    "wrappers": ("AnyController", "DisturbanceObserver", "HalfTickAhead", "Saturated",
        "Switch"),
})  # fmt: skip
