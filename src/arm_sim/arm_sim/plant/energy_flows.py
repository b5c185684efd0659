# SPDX-License-Identifier: Apache-2.0
"""Energies that flow into and out of an arm, as additional states."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import Ensemble, Flow
from arm_dynamics.arrays import Array
from arm_dynamics.equations import spring
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.plant.parameters import EXTERNAL, Parameters

# Energies that a repeated tick integrates
FLOWS = (
    "work supplied [J]", "heat lost [J]", "heat of friction [J]", "external work [J]",
    "lost in contacts [J]",
)  # fmt: skip

# Function (q, v, tau, p) -> power in [W]
Power = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True)
class EnergyFlows(Ensemble):
    """The models of a scene with energy flows as additional states, which come last.

    They are the work supplied to the models and the heat dissipated in them, and integrals of
    ``dissipated_power``, ``external_power`` and ``Mechanics.power_lost``: heat of the joints'
    friction and of dampers, external work, and losses in friction of contacts and in compliant
    stops. Impacts are not included.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """The internal states, and the energies."""
        return (*super().names, *FLOWS)

    @property
    def scale(self) -> Array:
        """Scale of each entry of the state, shape (2n + nz + 5,)."""
        return np.concatenate([super().scale, np.ones(len(FLOWS))])

    def initial(self, q: Array, v: Array) -> Array:
        """The internal states, and energies of zero."""
        return np.concatenate([super().initial(q, v), np.zeros(len(FLOWS))])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Equations of the models, and rates of the first two energies; the plant adds others."""
        flow = super().equations(q, v, z, u)
        return Flow(flow.torque, ca.vertcat(flow.slope, flow.supplied, flow.lost))


def dissipated_power(model: ArmModel, parameters: Parameters) -> Power:
    """Power lost in friction and dampers without states."""
    tree = tree_of(model)
    viscous, dry = map(parameters.place, ("friction", "coulomb"))

    def power(q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        law = model.friction if dry is None else model.friction.scaled(p[dry])
        torque = law.smooth(v, q, None if viscous is None else p[viscous])
        if law.has_dry:
            torque = torque + law.dry(v, ca.sign(v), q, tau)
        return ca.dot(torque, v) + spring.heat(model.springs, tree, q, v)

    return power


def external_power(parameters: Parameters) -> Power:
    """Power of external torques; zero where they are not tunable."""
    external = parameters.place(EXTERNAL)
    return lambda q, v, tau, p: ca.SX(1, 1) if external is None else ca.dot(p[external], v)
