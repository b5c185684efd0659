# SPDX-License-Identifier: Apache-2.0
"""One wheel on a vertical axis with a motor, and what laws of drives make of states."""

from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.actuation.drives import Drives
from models.rotor import rotor

# The motor of the reference values.
R, L, K, J, B = 1.0, 1e-3, 0.05, 5e-5, 1e-5
WINDING = {"resistance": R, "inductance": L, "torque_constant": K}


def wheel(J: float = 0.1, transmission: dict[str, Any] | None = None, **actuator: Any) -> Any:
    """Scene of a wheel of inertia ``J`` [kg m²] whose joint ``axle`` has this drive."""
    scene = rotor(J)
    scene["joints"]["axle"]["actuator"] = actuator
    if transmission:
        scene["joints"]["axle"]["transmission"] = transmission
    return scene


def law(scene: Any) -> Drives:
    """The drives of a scene by themselves."""
    return Drives(ArmModel(load_scene(scene)))


def of_states(drives: Drives, n: int) -> dict[str, ca.Function]:
    """Functions (q, v, z, u) of the law: torque, slope, stored, supplied, lost, and the rate of
    ``stored``.
    """
    q, v, a, u = (ca.SX.sym(name, n) for name in "qvau")
    z = ca.SX.sym("z", len(drives.states))
    flow = drives.equations(q, v, z, u)
    along = [ca.jtimes(flow.stored, x, y) for x, y in ((q, v), (v, a), (z, flow.slope))]
    wanted = {
        "torque": flow.torque,
        "slope": flow.slope,
        "stored": flow.stored,
        "supplied": flow.supplied,
        "lost": flow.lost,
        "rate": ca.substitute(sum(along), a, np.zeros(n)),
    }
    return {name: ca.Function(name, [q, v, z, u], [x]) for name, x in wanted.items()}


def linear(A: np.ndarray, b: np.ndarray, x0: np.ndarray, t: float) -> np.ndarray:
    """Solution of x' = A x + b at ``t``, by the matrix exponential."""
    n = len(x0)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = A, b
    return np.asarray(expm(whole * t) @ np.append(x0, 1.0))[:n]
