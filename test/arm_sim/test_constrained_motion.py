# SPDX-License-Identifier: Apache-2.0
"""Motion under constraints: closed forms, order, no drift, redundancy, singular positions,
switches.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import load_scene
from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators.methods import METHODS
from models.linkages import body, inline, interpreted, scene, worst_gaps
from tolerances import CLOSURE, CLOSURE_SPEED, ORDER, assert_close

SCENES = ("five_bar", "panda_pen", "bricard")
STEPS = {1: (11, 12), 2: (8, 9), 4: (8, 9), 5: (8, 9), 8: (5, 6)}


@pytest.mark.parametrize("name", SCENES)
def test_no_drift_in_a_minute(name: str) -> None:
    """At 1 ms, moving on its own or pushed."""
    sim = Simulator(scene(name), integrator="rk4", dt=1e-3)
    push = 0.02 * np.cos(np.arange(sim.n)) if name == "five_bar" else None
    gap, speed = worst_gaps(sim, sim.run(60.0, push), 301)
    assert gap <= CLOSURE, f"open by {gap:.2e}"
    assert speed <= CLOSURE_SPEED, f"opening at {speed:.2e}"


@cache
def path(method: str, exponent: int) -> np.ndarray:
    """States of the slider-crank over half a second at a step of 2^-exponent."""
    sim = interpreted(scene("slider_crank"), integrator=method, dt=2.0**-exponent)
    run = sim.run(0.5)
    return np.hstack([run.q, run.v])


@pytest.mark.parametrize("method", sampled(METHODS, 2))
def test_every_method_keeps_its_order(method: str) -> None:
    """Against DOP853 at 1 ms, at all common times."""
    order, finest = METHODS[method].order, 10
    errors = []
    for exponent in STEPS[order]:
        every = 2 ** (finest - exponent) if exponent < finest else 1
        mine = path(method, exponent)[:: 2 ** max(0, exponent - finest)]
        errors.append(abs(mine - path("dop853", finest)[::every]).max())
    measured = np.log2(errors[0] / errors[1])
    assert -ORDER <= measured - order <= (ORDER if order <= 4 else 1.2), f"order {measured:.2f}"


@pytest.mark.parametrize("axle", [[0, 1, 0], None])
def test_a_wheel_rolls_down_a_slope(axle: list[float] | None) -> None:
    """a = g sin(alpha) / (1 + I / (m r²)); it does not slip, and friction is m g sin - m a."""
    links = (
        body("cart", "ground", "prismatic", "1 0 0", 0.5, 0.001)
        + body("lift", "cart", "prismatic", "0 0 1", 0.5, 0.001)
        + body("wheel", "lift", "continuous", "0 1 0", 2.0, 0.03)
    )
    slope = 0.3
    gravity = [9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)]
    ground = {"type": "plane", "frames": ["wheel", "world"], "height": 0.2}
    rolls: dict[str, Any] = {"type": "rolling", "frames": ["wheel", "world"], "radius": 0.2}
    if axle:
        rolls["axle"] = axle
    sim = interpreted(inline(links, rolls, ground, gravity=gravity))
    run = sim.run(1.0)
    inertia = 3.0 + 0.03 / 0.2**2
    a = 3.0 * gravity[0] / inertia
    assert_close(run.q[-1], [a / 2, 0.2, a / 2 / 0.2], 1e-12)
    forward = [name for name in sim.dynamics.constrained.names].index("plane_1")
    weight = sim.multipliers()[forward]
    assert_close(weight, 2.5 * gravity[2], 1e-10)


@pytest.mark.parametrize("coulomb", [0.0, 2.0])
def test_a_joint_that_a_rod_leaves_no_speed_at_first(coulomb: float) -> None:
    """Slides with stops, or dry friction: at rest across the rod they do not stick."""
    rod = {"type": "distance", "frames": ["carriage", "world"], "distance": 0.5}
    sim = Simulator(
        {
            "robot": {"urdf": (models.FOLDER / "gantry.urdf").read_text()},
            "joints": {"y": {"friction": {"coulomb": coulomb}}},
            "constraints": [rod],
            "initial": {"position": {"y": -0.5}},
        },
        tolerance=1e-10,
    )
    sim.reset(v=[0.6, 0.0])
    run = sim.run(0.5)
    assert run.v[0, 1] == 0.0 and abs(run.v[:, 1]).max() > 0.1
    assert_close(np.linalg.norm(run.q, axis=1), np.full(len(run.q), 0.5), CLOSURE)
    slid = abs(np.diff(run.q[:, 1])).sum()
    fallen = 15.0 * 9.81 * 0.6 * run.q[-1, 0]  # the x slide rises by 0.6 of its way
    kinetic = 0.5 * run.v[-1] ** 2 @ [15.0, 3.0]
    assert_close(kinetic, 0.5 * 15.0 * 0.6**2 - fallen - coulomb * slid, 1e-6)


@pytest.mark.parametrize(("stopped", "coulomb"), [((0, 1), 0.05), ((0, 3), 0.0)])
def test_a_linkage_between_two_stops_comes_to_rest(
    stopped: tuple[int, int], coulomb: float
) -> None:
    """Rebounds that accumulate take the loop with them, also in ticks that are time-stepped."""
    begin = Simulator(scene("five_bar")).model
    names, q0 = begin.joint_names, begin.q0
    joints: dict[str, Any] = {
        names[k]: {"limits": {"lower": q0[k] - 0.03, "upper": q0[k] + 0.03,
                              "stop": {"restitution": 0.8}}} for k in stopped
    }  # fmt: skip
    joints[names[0]]["friction"] = {"coulomb": coulomb}
    start = {"position": dict(zip(names, q0.tolist(), strict=True))}
    sim = Simulator(scene("five_bar", joints=joints, initial=start), integrator="rk4", dt=1e-2)
    for seed in range(2):
        sim.reset()
        run = sim.run(2.0, np.random.default_rng(seed).normal(size=4))
        assert not run.v[-1].any()
        gap, speed = worst_gaps(sim, run, 201)
        assert gap <= CLOSURE and speed <= CLOSURE_SPEED


def test_doubled_constraints_change_nothing() -> None:
    """Nor does a planar loop in a tilted plane, whose third row depends on the other two."""
    once, turn = scene("four_bar"), 0.4
    urdf = once.robot.urdf.replace(
        '<origin xyz="0 0 0"/>', f'<origin xyz="0 0 0" rpy="{turn} 0 0"/>'
    )
    urdf = urdf.replace('<origin xyz="0.35 0 0"/>', f'<origin xyz="0.35 0 0" rpy="{turn} 0 0"/>')
    gravity = [0.0, 9.81 * np.sin(turn), -9.81 * np.cos(turn)]
    loop = once.constraints[0].model_dump(exclude_unset=True) | {"switchable": True}
    tilted = {"robot": {"urdf": urdf}, "gravity": gravity,
              "constraints": [loop, loop | {"name": "again"}, loop | {"name": "third"}],
              "initial": once.initial.model_dump()}  # fmt: skip
    one, three = interpreted(once), interpreted(tilted)
    runs = [sim.run(0.5) for sim in (one, three)]
    assert_close(runs[1].q, runs[0].q, 1e-9)
    # The smallest multipliers share the load equally.
    shares = three.multipliers().reshape(3, 3)
    assert_close(shares, np.tile(shares[0], (3, 1)), 1e-9)
    assert_close(np.linalg.norm(shares.sum(0)), np.linalg.norm(one.multipliers()), 1e-6)


def test_torques_that_fight_in_a_singular_position_are_an_error() -> None:
    """At two cranks and a coupler, flat: they tear at the hinges without end."""
    path = models.FOLDER.parent / "reference/parallelograms_1.yaml"
    plain = load_scene(path).model_dump(exclude_unset=True)
    sim = interpreted(plain | {"gravity": [0, 0, 0]})
    sim.reset([0.005, -0.005, 0.005], [-0.01, 0.01, -0.01])
    with pytest.raises(SimulationDiverged, match="near a singular position") as error:
        sim.run(2.0, [10.0, 0.0, -10.0])
    motion = error.value.recording
    assert motion is not None
    assert abs(motion.q[:, 0] - motion.q[:, 2]).max() < 1e-6
