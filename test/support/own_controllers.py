# SPDX-License-Identifier: Apache-2.0
"""Controllers as somebody else would write them, good ones and others."""

from typing import Any

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.control import JointLaw, Settings


class Springs:
    """Weight, and springs and dampers of its own."""

    def __init__(self, dynamics: Dynamics, bandwidth: float = 1.0, stiffness: float = 400.0):
        self.dynamics, self.bandwidth, self.stiffness = dynamics, bandwidth, stiffness

    def torque(self, state: Any, reference: Any) -> list[float]:
        e, rate = reference.q - state.q, reference.v - state.v
        tau = self.dynamics.gravity(state.q) + self.stiffness * e + 40.0 * rate
        return list(tau)


class Pull(JointLaw):
    """A spring and a damper as a formula, with a memory of the last pull."""

    friction_terms = "all"

    def __init__(self, dynamics: Dynamics, stiffness: float = 400.0):
        super().__init__(dynamics.n, dynamics.model)
        self.tuning = np.full(dynamics.n, stiffness), np.full(dynamics.n, 40.0)
        self.memory = (np.zeros(dynamics.n),)

    def restart(self) -> None:
        self.memory = (np.zeros(self._n),)

    def formula(self, rigid: Any, q: Any, v: Any, desired: Any, tuning: Any, memory: Any) -> Any:
        pull = tuning[0] * (desired.q - q) + tuning[1] * (desired.v - v)
        return rigid.gravity(q) + 0.5 * (pull + memory[0]), (pull,)


class Numbers(Pull):
    """Its formula takes numbers only."""

    def formula(self, rigid: Any, q: Any, *rest: Any) -> Any:
        return super().formula(rigid, np.array(q, dtype=float), *rest)


class Other(Pull):
    """Its formula is not its torque."""

    def torque(self, state: Any, reference: Any) -> np.ndarray:
        return super().torque(state, reference) + 1.0


class Everything:
    """Takes what there is to be taken."""

    def __init__(self, dynamics: Dynamics, settings: Settings, *, dt: float, limit: Any = None):
        self.given = dynamics, settings, dt, limit

    def torque(self, state: Any, reference: Any) -> np.ndarray:
        return np.zeros(self.given[0].n)


class Fails(Springs):
    """Does as ``how`` says once that is set."""

    how = ""

    def restart(self) -> None:
        if self.how == "restart":
            raise RuntimeError("cannot begin")

    def torque(self, state: Any, reference: Any) -> Any:
        tau = super().torque(state, reference)
        match self.how:
            case "raise":
                raise ZeroDivisionError("oh\n" * 1000)
            case "nan":
                tau[0] = np.nan
            case "shape":
                return tau[:-1]
            case "text":
                return "torque"
            case "write reference":
                reference.q[:] = 0.0
        return tau


class NeedsMore:
    def __init__(self, dynamics: Dynamics, camera: Any):
        pass


class Broken:
    def __init__(self, dynamics: Dynamics):
        raise OSError("no calibration file")


class NoTorque:
    pass


NUMBER = 7
