# SPDX-License-Identifier: Apache-2.0
"""Controllers: objects with one method, ``torque(state, reference)``, and wrappers around them.

They depend on the model of the arm and on references, and not on what applies their torques.
Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.control.compiled_law import Compiled, preparation
    from arm_dynamics.control.computed_torque import ComputedTorque
    from arm_dynamics.control.controller import AnyController, Controller, Measured
    from arm_dynamics.control.disturbance_observer import DisturbanceObserver
    from arm_dynamics.control.factory import NAMES, Settings, make_controller
    from arm_dynamics.control.friction_compensation import FrictionFeedForward
    from arm_dynamics.control.half_tick_ahead import HalfTickAhead
    from arm_dynamics.control.joint_space import (
        PD,
        PID,
        FeedForwardPD,
        GravityCompensation,
        JointImpedance,
        PDGravity,
    )
    from arm_dynamics.control.law import JointLaw, Law
    from arm_dynamics.control.pole_placement import gains, held_gains, tuned
    from arm_dynamics.control.switch import Switch
    from arm_dynamics.control.task_space import (
        CartesianImpedance,
        MotionForce,
        OperationalSpace,
        at_rest,
    )
    from arm_dynamics.control.wrappers import Saturated

__all__ = [
    "AnyController", "CartesianImpedance", "Compiled", "ComputedTorque", "Controller",
    "DisturbanceObserver", "FeedForwardPD", "FrictionFeedForward", "GravityCompensation",
    "HalfTickAhead", "JointImpedance", "JointLaw", "Law", "Measured", "MotionForce", "NAMES",
    "OperationalSpace", "PD", "PDGravity", "PID", "Saturated", "Settings", "Switch", "at_rest",
    "gains", "held_gains", "make_controller", "preparation", "tuned",
]  # fmt: skip
__getattr__, __dir__ = on_demand(__name__, __file__)
