# SPDX-License-Identifier: Apache-2.0
"""LuGre friction of the joints that ask for it: the states z are the deflections of bristles."""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca
import numpy as np

from arm_dynamics.actuation.internal_state import Flow
from arm_dynamics.arrays import Array
from arm_dynamics.equations import friction, lugre
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.equations.tree import constant
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.friction import Lugre, refusal


class LugreFriction:
    """All joints with bristles as one law; see ``internal_state.FrictionLaw``.

    Viscous friction, σ2 v, is not part of it: it acts on every joint alike.
    """

    title = "LuGre friction"
    absent = "no bristles"

    @classmethod
    def of(cls, model: ArmModel) -> LugreFriction | None:
        """The law of the joints that have ``friction.lugre``; None if there are none."""
        said = ((i, model.scene.joint(name)) for i, name in enumerate(model.joint_names))
        asked = {i: joint.friction.lugre for i, joint in said if joint.friction.lugre}
        return cls(model, asked) if asked else None

    def __init__(self, model: ArmModel, asked: Mapping[int, Lugre]) -> None:
        """Take joints and their coefficients.

        Raises:
            SceneError: If the coefficients of a joint do not go together.
        """
        self._n, self._joints = model.n, list(asked)
        self._levels = model.friction.by_law.of(self._joints)
        self.names = tuple(
            f"{model.joint_names[i]} bristle deflection "
            f"[{'m' if model.joint_types[i] == 'prismatic' else 'rad'}]"
            for i in asked
        )
        self._coulomb, self._static, self._fall = (x[self._joints] for x in self._levels)
        self._laws = tuple(asked.values())
        self._sigma0 = np.array([law.sigma0 for law in self._laws])
        self.scale: Array = self._static / self._sigma0  # where bristles give way
        self.replaces_command = np.zeros(model.n, dtype=bool)
        self.summary = f"{len(self.names)} joints, as many states"
        for i, law in asked.items():
            _check(model, i, law)

    def initial(self, q: Array, v: Array) -> Array:
        """Straight bristles."""
        return np.zeros(len(self.names))

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """See ``equations.lugre``."""
        w = ca.vertcat(*[v[i] for i in self._joints])
        level = lugre.level(w, self._coulomb, self._static - self._coulomb, self._fall)
        rate = lugre.bending(w, z, self._sigma0, level)
        sigma1 = ca.vertcat(
            *[lugre.faded(w[k], x.sigma1, x.sigma1_velocity) for k, x in enumerate(self._laws)]
        )
        held = lugre.torque(z, rate, self._sigma0, sigma1)
        torque = ca.SX(self._n, 1)
        for k, i in enumerate(self._joints):
            torque[i] = -held[k]
        stored = 0.5 * ca.dot(ca.DM(self._sigma0), z**2)
        lost = ca.sum1(lugre.heat(w, z, rate, self._sigma0, sigma1, level))
        return Flow(torque, rate, stored, lost=lost)

    def steady(self, v: Quantity, direction: Quantity) -> Quantity:
        """Friction of bristles that have bent, of the sign of ``direction``."""
        coulomb, static, fall = self._levels
        like = constant if isinstance(v, ca.SX) else np.asarray
        return friction.dry(v, direction, like(coulomb), like(static - coulomb), like(fall))

    def fastest_rate(self, M: Array, v: Array) -> float:
        """The frequency of the arm on its bristles, or the rate at which they bend over.

        That is σ0 |v| / Fc for a joint that slides at 1 rad/s or 1 m/s, or as fast as it starts.
        """
        stiffness = np.zeros(self._n)
        stiffness[self._joints] = self._sigma0
        speed = np.maximum(1.0, abs(v[self._joints]))
        bending = float(np.max(self._sigma0 * speed / self._coulomb))
        swinging = np.linalg.eigvals(np.linalg.solve(M, np.diag(stiffness))).real.max()
        return max(math.sqrt(max(0.0, float(swinging))), bending)


def _check(model: ArmModel, i: int, law: Lugre) -> None:
    joint, (mean, skew) = model.joint_names[i], model.friction.viscous
    viscous = float(mean[i] - abs(skew[i]))
    coulomb, static = (float(level[i]) for level in model.friction.by_law[:2])
    if not coulomb > 0.0:
        raise refusal(joint, f"lugre' needs coulomb above zero, got {coulomb}")
    if static > coulomb and model.scene.joint(joint).friction.stribeck_velocity is None:
        raise refusal(joint, "lugre' with static above coulomb needs a 'stribeck_velocity'")
    if not lugre.is_passive(law.sigma1, viscous, coulomb, static, law.sigma1_velocity):
        needed = law.sigma1 * (static - coulomb) / coulomb
        slow = lugre.FADING * coulomb / law.sigma1
        raise refusal(
            joint,
            f"lugre' is not passive, it could give out energy: viscous >= sigma1 (static - "
            f"coulomb) / coulomb = {needed:.4g} is expected, got {viscous:.4g}; or let the "
            f"damping fade: sigma1_velocity <= 4 sqrt(2 e) coulomb / sigma1 = {slow:.4g}, "
            f"got {law.sigma1_velocity}",
        )
