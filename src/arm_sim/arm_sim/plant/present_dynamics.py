# SPDX-License-Identifier: Apache-2.0
"""The arm under current tunable quantities: numeric dynamics by Pinocchio."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.scene.schema import Payload
from arm_sim.plant.admissible_states import active_constraints
from arm_sim.plant.parameters import CONSTRAINTS, EXTERNAL
from arm_sim.plant.plant import Plant

# Tunable quantities on which the model of the arm depends
ARM_QUANTITIES = ("gravity", "payload", "friction", "coulomb")
# Tunable quantities that act on an arm
EXTERNAL_QUANTITIES = (EXTERNAL, CONSTRAINTS)
# Number of cached dynamics, since a motion may alternate between a few
CACHE_SIZE = 8


class PresentDynamics:
    """Numeric dynamics of a scene under the current tunable quantities.

    Args:
        plant: The scene's equation of motion.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._columns = self._columns_of(ARM_QUANTITIES)
        self._recent = {self._key(plant.parameters.nominal): Dynamics(plant.model)}

    def with_external(self, p: Array) -> Dynamics:
        """The dynamics under all of p, shape (np,): external torques and switches included."""
        parameters, dynamics = self._plant.parameters, self.without_external(p)
        places = [
            place for name in EXTERNAL_QUANTITIES if (place := parameters.place(name)) is not None
        ]
        if all(np.array_equal(p[place], parameters.nominal[place]) for place in places):
            return dynamics
        external = parameters.of(EXTERNAL, p)
        torques = external if external.size else np.zeros(self._plant.model.n)
        return dynamics.under(torques, active_constraints(self._plant, p))

    def without_external(self, p: Array) -> Dynamics:
        """The dynamics of the arm itself under p; the same object for the same numbers."""
        key, recent = self._key(p), self._recent
        if key not in recent:
            dynamics = Dynamics(model_under(self._plant, p))
            # Replaced as a whole, since another thread may be reading it.
            self._recent = recent = {**dict(list(recent.items())[1 - CACHE_SIZE :]), key: dynamics}
        return recent[key]

    def runs(self, p: Array, *others: str) -> list[slice]:
        """Runs of successive rows of p, shape (k, np), with the same dynamics.

        Args:
            p: Tunable quantities, shape (k, np).
            *others: Names of further quantities that are the same in a run.
        """
        quantities = p[:, self._columns_of((*ARM_QUANTITIES, *others))]
        ends = np.flatnonzero((quantities[1:] != quantities[:-1]).any(axis=1)) + 1
        return [slice(a, b) for a, b in pairwise([0, *ends.tolist(), len(quantities)]) if a < b]

    def _columns_of(self, names: tuple[str, ...]) -> NDArray[np.intp]:
        places = (self._plant.parameters.place(name) for name in names)
        return np.asarray(np.r_[*(place for place in places if place is not None), 0:0])

    def _key(self, p: Array) -> bytes:
        return p[self._columns].tobytes()


def model_under(plant: Plant, p: Array) -> ArmModel:
    """The arm of a plant under its tunable quantities p, shape (np,)."""
    parameters, model = plant.parameters, plant.model
    gravity, loads, viscous, coulomb = (parameters.of(name, p) for name in ARM_QUANTITIES)
    if gravity.size or loads.size:
        scene = model.scene
        payloads = scene.payloads
        if loads.size:
            payloads = tuple(
                Payload.model_validate(
                    {"frame": load.frame, "mass": row[0], "com": row[1:4], "inertia": row[4:]}
                )
                for load, row in zip(payloads, loads.reshape(-1, 10).tolist(), strict=True)
            )
        model = model.under(gravity if gravity.size else np.array(scene.gravity), payloads)
    friction = model.friction.with_viscous(viscous) if viscous.size else model.friction
    friction = friction.scaled(coulomb) if coulomb.size else friction
    return model.with_friction(friction)
