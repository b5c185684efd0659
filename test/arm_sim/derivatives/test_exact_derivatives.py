# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks by state, command and parameters, to the last digits.

The tick is written once more as it is made, by evaluating its functions at complex numbers; that
it is the tick is asserted too. Modes of joints and contacts stay within these ticks.
"""

from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import InvalidInput
from arm_sim import Simulator
from arm_sim.integrators import METHODS, build_step
from arm_sim.plant.slopes import scaled_jacobian
from arm_sim.stepping import Modes
from complex_step import EPSILON, evaluated, seeded
from models import features
from tolerances import BACKENDS, assert_close

SLOPE = 1e-11
"""Relative to the largest derivative; ticks without contacts reach 1e-14."""


def tick(sim: Simulator, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """One tick at complex numbers, a column for each point."""
    plant, n, points = sim.arm.plant, sim.n, x.shape[1]
    more = plant.mechanics.project, lambda: scaled_jacobian(plant)
    step = build_step(sim.choice.method, plant.rhs, n, *more)
    if plant.layout.directions:  # held joints are at rest
        place = len(plant.parameters.nominal)
        change = -(1.0 - p[place : place + n] ** 2) * x[n : 2 * n]
        still = np.zeros((3 * len(plant.points), points), complex)
        v = evaluated(plant.mechanics.impact_map, [x[: 2 * n], p, change, still])[0]
        x = np.concatenate([x[:n], v, x[2 * n :]])
    h = np.full((1, points), sim.dt + 0j)
    if plant.mechanics.contact is None:
        return evaluated(step, [x, u, p, h])[0]
    where = evaluated(plant.mechanics.contact.geometry, [x[: 2 * n]])[0]
    anchor = where.reshape(-1, 3, points)[:, 1:].reshape(-1, points)
    settled = evaluated(plant.mechanics.contact.settle, [x[: 2 * n], p])[0]
    moved = evaluated(step, [np.concatenate([x[:n], settled, x[2 * n :]]), u, p, h])[0]
    held = moved[: 2 * n]
    for _ in range(2):
        held = evaluated(plant.mechanics.contact.close, [held, p, anchor])[0]
    return np.concatenate([held, moved[2 * n :]])


def check(sim: Simulator, tau: Any, by: tuple[str, ...] = ()) -> Modes:
    """Compare the derivatives of the tick at the present state; returns what joints do there."""
    tau, x, n = np.array(tau, dtype=float), sim.arm.x.copy(), sim.n
    modes = sim.arm.compiled.stepper.reactions.modes_at(x, tau, sim.arm.compiled.stepper.p)
    p = modes.p if sim.arm.plant.eventful else sim.arm.parameters
    end = tick(sim, *seeded([x, tau, p]))
    places = [i for own in sim.arm.plant.parameters.places(by).values() for i in own]
    columns = [*range(len(x) + n), *(len(x) + n + i for i in places)]
    A, B, P = sim.linearize(sim.state, tau, by=by)
    assert_close(np.hstack([A, B, *P.values()]), end.imag[:, columns] / EPSILON, SLOPE)
    sim.arm.restore(x, sim.arm.parameters, 0)
    sim.step(tau)
    assert_close(sim.arm.x, end[:, 0].real, BACKENDS)
    return modes


SETS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "springs and loads": (
        ("viscous", "armature", "spring", "point spring", "payload", "mimic"), ("payload",)
    ),
    "sliding friction": (("coulomb", "table", "lossy gear", "payload"), ("payload",)),
    "drives": (("current", "flexible", "harmonic"), ()),
    "voltage and bristles": (("lugre", "voltage", "payload"), ("payload",)),
    "a loop with friction and a drive": (
        ("coulomb", "flexible", "bilateral", "payload"), ("payload",)
    ),
}  # fmt: skip
"""Features, and what to differentiate by beside state and command."""


def moving(chosen: tuple[str, ...], scene: dict[str, Any]) -> tuple[Simulator, np.ndarray]:
    """An arm a few ticks after it began to move, and a command near one that holds it."""
    # Under error control, which bristles get, one step as well, whose derivatives settle at once.
    one_step, fast = {"sim": {"accuracy": 1e-4}}, "lugre" in chosen
    sim = Simulator(scene | one_step, integrator="rk4", dt=1e-4 if fast else 1e-3)
    command = features.command("planar", scene)
    tau = np.array([1.2 * command.get(joint, 0.0) for joint in sim.joint_names])
    sim.reset(sim.model.q0, np.zeros(sim.n) if "bilateral" in chosen else [0.8, -0.5, 0.6])
    sim.run(0.01, tau)
    return sim, tau


@pytest.mark.parametrize("name", SETS)
def test_features(name: str) -> None:
    chosen, by = SETS[name]
    check(*moving(chosen, features.scene("planar", chosen)), by)


def test_a_joint_that_sticks() -> None:
    chosen = ("coulomb", "table", "payload")
    sim = Simulator(features.scene("planar", chosen), integrator="rk4", dt=1e-3)
    sim.reset(sim.model.q0, [0.0, -0.05, 0.06])  # the second has no dry friction
    modes = check(sim, sim.dynamics.gravity(sim.state.q), ("payload",))
    assert modes.direction.tolist() == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("sticks", [False, True])
def test_a_closed_contact(sticks: bool) -> None:
    chosen = ("contact", "payload", *(["viscous"] if sticks else []))
    scene = features.scene("planar", chosen)
    scene["constraints"][0] |= {"friction": 2.0 if sticks else 0.1}
    sim, tau = moving(chosen, scene)
    sim.run(0.6 if sticks else 0.35, 0.5 * tau)
    contacts = check(sim, 0.5 * tau, ("payload",)).contact
    assert contacts["closed"].tolist() == [1.0]
    assert contacts["sticks"].tolist() == [float(sticks)]


BY = ("gravity", "payload", "friction", "external")


def loaded(**options: Any) -> Simulator:
    scene = features.scene("planar", ("viscous", "payload")) | {"tunable": list(BY)}
    sim = Simulator(scene, **options)
    sim.reset(sim.model.q0, [0.8, -0.5, 0.6])
    return sim


@pytest.mark.parametrize("method", sampled(METHODS, 4))
def test_methods_by_all_that_is_tunable(method: str) -> None:
    check(loaded(integrator=method, dt=0.01), [20.0, 5.0, 1.0], BY)


@pytest.mark.parametrize("by", ["constraints", ["gravity", "tau"]])
def test_refusals(by: Any) -> None:
    sim = models.simulator("two_link")
    with pytest.raises(InvalidInput, match="no derivative by .*'tunable' allows"):
        sim.linearize(sim.state, [0.0, 0.0], by=by)
