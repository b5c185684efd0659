# SPDX-License-Identifier: Apache-2.0
"""Many arms to advance, from arguments that are checked."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, all_finite, real_array, vector_or_batch
from arm_dynamics.codegen.addresses import repeated
from arm_sim.inputs import check_whole
from arm_sim.memory import refuse_beyond_memory
from arm_sim.plant.admissible_states import clip_to_stops, close_loops_of_arms
from arm_sim.plant.plant import Plant


@dataclass(frozen=True)
class Batch:
    """Arms to advance and where their motion goes.

    Attributes:
        x0: Initial states (q, v, z), shape (b, nx).
        tau: Torques, shape (b, ticks, n); held or shared ones are repeated by strides of zero.
        p: Parameters, shape (b, np).
        steps: Ticks to advance.
        out: States, shape (b, steps + 1, nx), or (b, nx) for the last ones only.
        effort: With a controller, receives what acts in each tick, shape (b, steps, n); ``tau``
            are its references then, shape (b, steps, size).
    """

    x0: Array
    tau: Array
    p: Array
    steps: int
    out: Array
    effort: Array | None = None

    @classmethod
    def of(
        cls, plant: Plant, q0: Any, v0: Any, tau: Any, steps: int, p: Array, last_only: bool
    ) -> Self:
        """Check arguments; ``p`` is of shape (np,) or (b, np)."""
        check_whole("steps", steps, 0)
        x0 = states(plant, p, q0, v0, ("q0", "v0"))
        arms, nx = x0.shape
        rows = np.ascontiguousarray(np.broadcast_to(p, (arms, p.shape[-1])))
        if not last_only:
            run = f"a rollout of {arms} arms over {steps} time steps"
            refuse_beyond_memory(arms * (steps + 1), 8 * nx, run, "last_only=True keeps the end")
        out = np.empty((arms, nx) if last_only else (arms, steps + 1, nx))
        return cls(x0, by_tick("tau", tau, arms, steps, plant.model.n), rows, int(steps), out)


def states(plant: Plant, p: Array, q: Any, v: Any, names: tuple[str, str]) -> Array:
    """Check positions and velocities, and complete them to states, shape (b, nx).

    Args:
        plant: The equation of motion.
        p: Parameters, shape (np,) or (b, np).
        q: Positions, shape (b, n).
        v: Velocities, shape (b, n).
        names: Names of both arguments.
    """
    joints, n = plant.model.joint_names, plant.model.n
    q, v = (np.atleast_2d(vector_or_batch(*x, joints)) for x in zip(names, (q, v), strict=True))
    for name, count in ((names[1], len(v)), ("parameters", len(p) if p.ndim == 2 else len(q))):
        if count != len(q):
            raise InvalidInput(f"{name}: {count} arms, but {names[0]} has {len(q)}")
    x = close_loops_of_arms(plant, np.concatenate([q, v], axis=1), p)
    if stops := plant.model.stops:
        inside = stops.within(x[:, :n])
        for arm in np.flatnonzero((inside != x[:, :n]).any(axis=1)):
            clip_to_stops(plant, x[arm, :n], f"arm {arm}: ")  # which refuses all but rounding
        x[:, :n] = inside
    if plant.nz:
        z = [plant.laws.initial(*np.split(row, 2)) for row in x]
        x = np.concatenate([x, np.reshape(z, (len(x), -1))], axis=1)
    return np.ascontiguousarray(x)  # columns of q and v may lie side by side


def by_tick(name: str, values: Any, arms: int, steps: int, n: int) -> Array:
    """Check numbers for n joints, of every arm and tick or shared; shape (b, ticks, n)."""
    array = np.ascontiguousarray(real_array(name, values))
    if array.shape not in ((n,), (arms, n), (arms, steps, n)):
        allowed = f"({n},), ({arms}, {n}) or ({arms}, {steps}, {n})"
        axis = f"; {name}[None] adds an axis of arms" if array.shape == (steps, n) else ""
        raise InvalidInput(f"{name} has shape {array.shape}; expected {allowed}{axis}")
    if not all_finite(array):
        raise InvalidInput(f"{name} has values that are not finite; finite ones are expected")
    if not array.size:  # of no ticks: nothing acts
        array = np.zeros(n)
    rows = array if array.ndim == 3 else np.atleast_2d(array)[:, None]
    return repeated(rows, (arms, max(1, steps), n))
