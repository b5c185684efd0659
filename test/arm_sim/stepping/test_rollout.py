# SPDX-License-Identifier: Apache-2.0
"""Many arms in one call: each moves as it would alone, whatever else is in the call."""

import os
import warnings
from signal import alarm
from threading import current_thread
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged, Simulator
from arm_sim.stepping.rollouts.threads import share
from models import features
from tolerances import BACKENDS, assert_close

STEPS = 20
OPTIONS: list[dict[str, Any]] = [
    {"integrator": "rk4"}, {"integrator": "nystrom4"}, {"integrator": "euler"},
]  # fmt: skip


def batch(sim: Simulator, rng: np.random.Generator, b: int) -> tuple[np.ndarray, ...]:
    q, v = 0.5 * rng.normal(size=(2, b, sim.n))
    return q, v, rng.normal(size=(b, STEPS, sim.n))


def alone(sim: Simulator, q: np.ndarray, v: np.ndarray, torques: np.ndarray) -> np.ndarray:
    sim.reset(q, v)
    run = sim.run(STEPS * sim.dt, torques)
    return np.hstack([run.q, run.v])


@pytest.mark.parametrize(
    ("name", "options"), [*zip(["panda", "gripper", "planar_3r"], OPTIONS, strict=True)], ids=str
)
def test_each_arm_moves_as_if_alone(
    name: str, options: dict[str, Any], rng: np.random.Generator
) -> None:
    sim = models.simulator(name, stops=False, **options)
    q, v, tau = batch(sim, rng, 11)
    together = sim.rollout(q, v, tau, STEPS)
    assert together.shape == (11, STEPS + 1, 2 * sim.n)
    for i in range(11):
        assert_close(together[i], alone(sim, q[i], v[i], tau[i]), BACKENDS)


@pytest.mark.parametrize("threads", [1, 3])
def test_does_not_depend_on_company_order_or_threads(
    threads: int, rng: np.random.Generator
) -> None:
    sim = models.simulator("ur10", integrator="rk4")
    q, v, tau = batch(sim, rng, 37)
    whole = sim.rollout(q, v, tau, STEPS, threads=2)
    order = rng.permutation(37)
    shuffled = sim.rollout(q[order], v[order], tau[order], STEPS, threads=threads)
    np.testing.assert_array_equal(shuffled, whole[order])
    for b in (1, 3, 8):
        few = sim.rollout(q[:b], v[:b], tau[:b], STEPS, threads=threads)
        np.testing.assert_array_equal(few, whole[:b])


def test_shapes_of_torque(rng: np.random.Generator) -> None:
    sim = models.simulator("two_link", integrator="rk4")
    q, v, _ = batch(sim, rng, 5)
    held, before = np.array([1.0, -0.5]), sim.step([1.0, 0.0])
    table = np.broadcast_to(held, (5, STEPS, 2))
    whole = sim.rollout(q, v, table, STEPS)
    np.testing.assert_array_equal(sim.rollout(q, v, held, STEPS), whole)
    np.testing.assert_array_equal(sim.rollout(q, v, table[:, 0], STEPS), whole)
    np.testing.assert_array_equal(sim.rollout(q, v, held, STEPS, last_only=True), whole[:, -1])
    assert sim.state is before


def test_order_of_numbers_in_memory(rng: np.random.Generator) -> None:
    """Arrays whose columns, not rows, lie in one piece, such as transposed ones."""
    sim = models.simulator("planar_3r", stops=False, integrator="rk4")
    arms = batch(sim, rng, 5)
    for lanes in (1, 4):
        found = sim.rollout(*map(np.asfortranarray, arms), STEPS, lanes=lanes)
        np.testing.assert_array_equal(found, sim.rollout(*arms, STEPS, lanes=lanes))


def test_an_arm_that_diverges_does_not_spoil_the_others(rng: np.random.Generator) -> None:
    sim = models.simulator("double_pendulum", integrator="euler", dt=1e-2)
    q, v, _ = batch(sim, rng, 9)
    calm = sim.rollout(q, v, [0.0, 0.0], 200)
    v[4] = 1e4
    wild = sim.rollout(q, v, [0.0, 0.0], 200)
    others = np.arange(9) != 4
    np.testing.assert_array_equal(wild[others], calm[others])
    sim.reset(q[4], v[4])
    with pytest.raises(SimulationDiverged) as caught:
        sim.run(2.0)
    motion = caught.value.recording
    assert motion is not None and 1 < len(motion) < 200
    assert np.isfinite(wild[4, : len(motion)]).all()
    assert np.isnan(wild[4, len(motion) :]).all()
    last = sim.rollout(q, v, [0.0, 0.0], 200, last_only=True)
    np.testing.assert_array_equal(last, wild[:, -1])


TOGETHER: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "error control": (("spring", "point spring"), {"integrator": "dopri5", "tolerance": 1e-7}),
    "bristles": (("lugre",), {}), "a loop": (("bilateral", "current"), {"tolerance": 1e-8}),
    "end stops": (("coulomb", "end stop", "payload"), {}),
    "a loop with dry friction": (("coulomb", "bilateral"), {}),
    "everything": (("table", "lossy gear", "contact", "end stop", "mimic"), {}),
}  # fmt: skip


@pytest.mark.parametrize("name", TOGETHER)
def test_arms_in_registers_have_the_bits_of_one_arm(name: str, rng: np.random.Generator) -> None:
    """More arms than lanes: some are held, some slide; sub-steps and events are each one's own."""
    chosen, options = TOGETHER[name]
    sim = Simulator(features.scene("planar", chosen), **options)
    q = sim.model.q0 + 0.005 * rng.normal(size=(11, sim.n))
    v = np.outer(rng.permutation(11) // 3, 0.1 * rng.normal(size=sim.n))
    tau = np.repeat(rng.normal(0.0, 6.0, size=(11, 3, sim.n)), 50, axis=1)
    arms, steps = (q, v, tau), 150
    alone = sim.rollout(*arms, steps, lanes=1)
    for threads in (1, 2):
        together = sim.rollout(*arms, steps, lanes=4, threads=threads)
        np.testing.assert_array_equal(together, alone)
    last = sim.rollout(*arms, steps, lanes=4, last_only=True)
    np.testing.assert_array_equal(last, alone[:, -1])
    shuffled = sim.rollout(*(x[::-1] for x in arms), steps, lanes=4)
    np.testing.assert_array_equal(shuffled, alone[::-1])


def test_in_registers_an_arm_that_cannot_be_advanced_is_nan_from_there_on() -> None:
    sim = models.simulator("double_pendulum", tolerance=1e-8)
    tau = np.zeros((9, 10, 2))
    tau[4, 4:] = 1e300
    start = np.zeros((9, 2)), np.ones((9, 2))
    motion = sim.rollout(*start, tau, 10, lanes=4)
    np.testing.assert_array_equal(motion, sim.rollout(*start, tau, 10, lanes=1))
    assert np.isnan(motion[4, 5:]).all() and np.isfinite(motion[[3, 5]]).all()


def test_threads_are_kept_and_a_fork_starts_its_own() -> None:
    def names() -> set[str]:
        found: set[str] = set()
        share(16, 1, 2, lambda a, b: found.add(current_thread().name))
        return found

    kept = [names() for _ in range(20)]
    assert len(set.union(*kept)) <= 1 + max(2, len(os.sched_getaffinity(0)))
    assert all(len(each) == 2 for each in kept)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of forks of processes with threads
        child = os.fork()
    if child == 0:
        alarm(20)  # ends it if it hangs
        os._exit(len(names()))
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 2


def test_tunable_parameters_differ_between_arms(rng: np.random.Generator) -> None:
    """Each arm as the simulator of a scene that has those numbers from the start."""
    urdf = str(models.SCENES / "two_link.urdf")
    load = {"frame": "tip", "mass": 1.0, "com": [0.1, 0.0, 0.0]}
    base = {
        "robot": {"urdf": urdf},
        "payloads": [load],
        "tunable": ["gravity", "payload", "friction"],
    }
    sim = Simulator(base, integrator="rk4")
    q, v, tau = batch(sim, rng, 3)
    masses, gravities, frictions = (0.5, 1.0, 2.0), (-9.81, -1.62, 0.0), (0.0, 0.3, 0.7)
    together = sim.rollout(q, v, tau, STEPS, parameters={
        "payload": [[m, 0.1, 0, 0, 0, 0, 0, 0, 0, 0] for m in masses],
        "gravity": [[0.0, 0.0, g] for g in gravities],
        "friction": [[f, f] for f in frictions],
    })  # fmt: skip
    for i in range(3):
        fixed = Simulator({
            "robot": {"urdf": urdf},
            "payloads": [{**load, "mass": masses[i]}],
            "gravity": [0.0, 0.0, gravities[i]],
            "joints": {"*": {"friction": {"viscous": frictions[i]}}},
        }, integrator="rk4")  # fmt: skip
        assert_close(together[i], alone(fixed, q[i], v[i], tau[i]), BACKENDS)


BAD: dict[str, dict[str, Any]] = {
    "v0 of another length": {"v0": np.zeros((4, 2))}, "negative steps": {"steps": -1},
    "q0 with NaN": {"q0": np.full((3, 2), np.nan)}, "threads": {"threads": True},
    "no arms": {"q0": np.zeros((0, 2)), "v0": np.zeros((0, 2))},
    "tau too long": {"tau": np.zeros((3, 11, 2))},
    "not tunable": {"parameters": {"gravity": [0.0, 0.0, 0.0]}}, "lanes": {"lanes": True},
}  # fmt: skip


@pytest.mark.parametrize("changes", BAD.values(), ids=BAD)
def test_refusals(changes: dict[str, Any]) -> None:
    sim = models.simulator("two_link", backend="vm")
    good = {"q0": np.zeros((3, 2)), "v0": np.zeros((3, 2)), "tau": [0.0, 0.0], "steps": 10}
    with pytest.raises(InvalidInput):
        sim.rollout(**{**good, **changes})
