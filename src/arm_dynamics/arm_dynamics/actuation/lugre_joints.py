# SPDX-License-Identifier: Apache-2.0
"""LuGre friction of joints; the states z are the deflections of the bristles."""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca
import numpy as np

from arm_dynamics.actuation.internal_state import Flow, InternalState, StateKind
from arm_dynamics.arrays import Array
from arm_dynamics.equations import lugre
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.exceptions import counted
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.friction import Lugre, refusal


class LugreFriction:
    """All joints with LuGre friction as one model; see ``internal_state.FrictionLaw``.

    Viscous friction, σ2 v, is not part of it: it is the same for all joints.
    """

    title = "LuGre friction"
    absent = "no bristles"

    @classmethod
    def of(cls, model: ArmModel) -> LugreFriction | None:
        """The model for the joints that have ``friction.lugre``; None if there are none."""
        frictions = (model.scene.joint(name).friction for name in model.joint_names)
        laws = {i: friction.lugre for i, friction in enumerate(frictions) if friction.lugre}
        return cls(model, laws) if laws else None

    def __init__(self, model: ArmModel, laws: Mapping[int, Lugre]) -> None:
        """Collect joints and their coefficients.

        Raises:
            SceneError: If the coefficients of a joint contradict one another.
        """
        self._n, self._joints = model.n, list(laws)
        self._dry = model.friction.by_law.of(self._joints)
        self._laws = tuple(laws.values())
        self._sigma0 = np.array([law.sigma0 for law in self._laws])
        lowest = [[level.min() for level in self._dry.extremes(i)] for i in laws]
        self._coulomb, static = np.array(lowest).T
        scales = (static / self._sigma0).tolist()
        units = model.units("rad", "m")
        titles = [f"{model.joint_names[i]} bristle deflection [{units[i]}]" for i in laws]
        self.states = tuple(
            InternalState(i, StateKind.DEFLECTION, title, scale)
            for i, title, scale in zip(laws, titles, scales, strict=True)
        )
        self.replaces_command = np.zeros(model.n, dtype=bool)
        self.summary = f"{counted(len(self.states), 'joint')}, as many states"
        for i, law in laws.items():
            _check(model, i, law)

    def initial(self, q: Array, v: Array) -> Array:
        """Bristles without deflection."""
        return np.zeros(len(self.states))

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """See ``equations.lugre``; u are the torques of the drives."""
        w, level = v[self._joints], self._dry.level_at(v, q, u)[self._joints]
        rate = lugre.bending(w, z, self._sigma0, level)
        laws = enumerate(self._laws)
        sigma1 = ca.vertcat(*[lugre.faded(w[k], x.sigma1, x.sigma1_velocity) for k, x in laws])
        held = lugre.torque(z, rate, self._sigma0, sigma1)
        torque = ca.SX(self._n, 1)
        torque[self._joints] = -held
        stored = 0.5 * ca.dot(ca.DM(self._sigma0), z**2)
        lost = ca.sum1(lugre.heat(w, z, rate, self._sigma0, sigma1, level))
        return Flow(torque, rate, stored, lost=lost)

    def steady(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Steady-state friction of the bristles, of the sign of ``direction``."""
        return self._dry.sliding(v, direction, q, load)

    def fastest_rate(self, M: Array, v: Array) -> float:
        """The arm's natural frequency on its bristles, or the relaxation rate of the bristles.

        The latter is σ0 |v| / Fc for a joint that slides at 1 rad/s or 1 m/s, or at its initial
        speed if larger, with its lowest Fc over all positions and loads.
        """
        stiffness = np.zeros(self._n)
        stiffness[self._joints] = self._sigma0
        speed = np.maximum(1.0, abs(v[self._joints]))
        bending = float(np.max(self._sigma0 * speed / self._coulomb))
        swinging = np.linalg.eigvals(np.linalg.solve(M, np.diag(stiffness))).real.max()
        return max(math.sqrt(max(0.0, float(swinging))), bending)


def _check(model: ArmModel, i: int, law: Lugre) -> None:
    """Refuse coefficients that are missing, or with which the model could generate energy."""
    joint, dry = model.joint_names[i], model.friction.by_law
    coulomb = float(dry.coulomb.mean[i] - abs(dry.coulomb.skew[i]))
    if not coulomb > 0.0:
        raise refusal(joint, f"lugre' needs coulomb above zero, got {coulomb}")
    falls = dry.static.mean[i] != dry.coulomb.mean[i]
    if falls and model.scene.joint(joint).friction.stribeck_velocity is None:
        raise refusal(joint, "lugre' with static above coulomb needs a 'stribeck_velocity'")
    sigma1, fading, (mean, skew) = law.sigma1, law.sigma1_velocity, model.friction.viscous
    viscous = mean[i] + skew[i] * np.array([1.0, -1.0])
    lowest, highest = dry.extremes(i)
    required = sigma1 * (highest - lowest) / lowest
    sides = zip(viscous, lowest, highest, strict=True)
    active = [k for k, side in enumerate(sides) if not lugre.is_passive(sigma1, *side, fading)]
    if not active:
        return
    worst = max(active, key=lambda k: float(required[k] - viscous[k]))
    slow = lugre.FADING * lowest[worst] / sigma1
    raise refusal(
        joint,
        f"lugre' is not passive, it could give out energy: viscous >= sigma1 (static - "
        f"coulomb) / coulomb = {required[worst]:.4g} is expected, got {viscous[worst]:.4g}; or "
        f"let the damping fade: sigma1_velocity <= 4 sqrt(2 e) coulomb / sigma1 = {slow:.4g}, "
        f"got {fading}",
    )
