# SPDX-License-Identifier: Apache-2.0
"""Torques of rigid bodies as a linear function of their inertial parameters."""

from functools import cached_property

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_studies.identification.regression.base_parameters import BaseParameters, base_parameters

# Inertial parameters of a body: mass, mass times centre of mass, inertia about the origin of its
# joint's frame; in Pinocchio's order ``NAMES``.
PER_BODY = 10
NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
MASSLESS_BELOW = 1e-9  # Mass in [kg] below which a body is massless, and not identified.


class RigidRegressor:
    """Y(q, v, a) of τ = Y θ, θ the ten parameters of each moving body; without friction.

    Source: Atkeson, An, Hollerbach, "Estimation of inertial parameters of manipulator loads and
    links", Int. J. of Robotics Research 5(3), 1986; computed by Pinocchio.

    Attributes:
        bodies: Names of the bodies, which are those of the joints that move them.
        nominal: θ of the scene's robot without payloads, shape (10 bodies,); links that are fixed
            to each other are one body.
        payload: Contribution of the scene's payloads, likewise.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        self.bodies = tuple(model.pin.names)[1:]
        self.nominal = parameters_of(model.bare)
        self.payload = parameters_of(model.pin) - self.nominal
        self._data = pin.Data(model.pin)

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """Y for rows of states of shape (k, n): shape (k, n, 10 bodies)."""
        model = self.model
        Q, V, A = model.configuration(q), model.spread(v), model.spread(a)
        full = np.empty((len(q), model.pin.nv, PER_BODY * len(self.bodies)))
        for row, *state in zip(full, Q, V, A, strict=True):
            row[:] = pin.computeJointTorqueRegressor(model.pin, self._data, *state)
        if model.has_followers:
            return np.asarray(np.einsum("ji,kjp->kip", model.followers, full))
        return full

    @cached_property
    def base(self) -> BaseParameters:
        """Combinations of armatures and inertial parameters, in this order, that motions show."""
        n = self.model.n

        def columns(q: Array, v: Array, a: Array) -> Array:
            return np.concatenate([np.eye(n) * a[:, :, None], self(q, v, a)], axis=2)

        names = [f"{joint}.armature" for joint in self.model.joint_names]
        names += [f"{body}.{name}" for body in self.bodies for name in NAMES]
        return base_parameters(columns, n, names)


def parameters_of(model: pin.Model) -> Array:
    """θ of a Pinocchio model, shape (10 (njoints - 1),)."""
    inertias = list(model.inertias)[1:]
    return np.concatenate([inertia.toDynamicParameters() for inertia in inertias])
