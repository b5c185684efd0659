# SPDX-License-Identifier: Apache-2.0
"""Motion under constraints: closed forms, order, no drift, redundancy, singular positions,
switches.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ConstraintError, Dynamics, InvalidInput, load_scene
from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators import METHODS
from arm_sim.recording import Recording
from tolerances import (
    BACKENDS,
    CLOSURE,
    CLOSURE_SPEED,
    FINITE_DIFF,
    ORDER,
    TRAJECTORY,
    assert_close,
)

SCENES = ("slider_crank", "four_bar", "five_bar", "parallel_gripper", "panda_pen", "bricard")
STEPS = {1: (11, 12), 2: (8, 9), 4: (8, 9), 5: (8, 9), 8: (5, 6)}
TIP = {"frames": ["tip", "world"]}


def scene(name: str, **more: Any) -> Any:
    return load_scene(
        load_scene(models.SCENES / f"{name}.yaml").model_dump(exclude_unset=True) | more
    )


def inline(links: str, *constraints: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"robot": {"urdf": f'<robot name="r"><link name="ground"/>{links}</robot>'},
            "constraints": list(constraints), **more}  # fmt: skip


def body(name: str, parent: str, kind: str, axis: str, mass: float, inertia: float) -> str:
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{inertia}" ixy="0" '
        f'ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>'
        f'<joint name="{name}_joint" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
        f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="0" velocity="0"/></joint>'
    )


def interpreted(given: Any, **options: Any) -> Simulator:
    """Without compiler: short motions are over before a compiler is."""
    return Simulator(given, backend="vm", **options)


def worst_gaps(sim: Simulator, run: Recording, every: int) -> tuple[float, float]:
    """Largest residual of positions and speeds along a motion."""
    rows = sim.dynamics.constrained.closure.rows
    gaps = np.zeros(2)
    for q, v in zip(run.q[::every], run.v[::every], strict=True):
        row = rows.stacked(q, v, sim.held_constraints)
        speed = abs(row.jacobian @ v).max()
        gaps = np.maximum(gaps, [abs(row.residual).max(), speed])
    return float(gaps[0]), float(gaps[1])


@pytest.mark.parametrize("name", SCENES)
def test_no_drift_in_a_minute(name: str) -> None:
    """At 1 ms, moving on its own or pushed."""
    sim = Simulator(scene(name), integrator="rk4", dt=1e-3)
    push = 0.02 * np.cos(np.arange(sim.n)) if name in ("five_bar", "parallel_gripper") else None
    gap, speed = worst_gaps(sim, sim.run(60.0, push), 301)
    assert gap <= CLOSURE, f"open by {gap:.2e}"
    assert speed <= CLOSURE_SPEED, f"opening at {speed:.2e}"


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "bricard"])
def test_energy_drifts_no_more_than_without_constraints(name: str) -> None:
    """At most twice that of the same links, cut open, from the same start, relative to what
    moves."""
    closed = Simulator(scene(name), integrator="rk4", dt=1e-3)
    cut = Simulator(scene(name, constraints=[]), integrator="rk4", dt=1e-3)
    cut.reset(closed.state.q, closed.state.v)
    runs = [sim.run(10.0) for sim in (closed, cut)]
    drift = [np.ptp(run.energy) / np.ptp(run.kinetic) for run in runs]
    assert drift[0] <= 2.0 * drift[1], f"{drift[0]:.2e} against {drift[1]:.2e}"


@cache
def path(method: str, exponent: int) -> np.ndarray:
    """States of the slider-crank over half a second at a step of 2^-exponent."""
    sim = interpreted(scene("slider_crank"), integrator=method, dt=2.0**-exponent)
    run = sim.run(0.5)
    return np.hstack([run.q, run.v])


@pytest.mark.parametrize("method", METHODS)
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


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_error_control_keeps_its_word(tolerance: float) -> None:
    exact = interpreted(scene("slider_crank"), integrator="dop853", dt=2.5e-4).run(1.0)
    run = interpreted(scene("slider_crank"), tolerance=tolerance, dt=1e-2).run(1.0)
    error = abs(run.q[-1] - exact.q[-1]).max()
    assert error <= 100 * tolerance
    assert error <= 10 * run.error[-1] + 1e-13


def test_a_gear_adds_inertia() -> None:
    """Two rotors, th1 = -3 th2: (J1 + J2 / 9) th1'' = tau."""
    rotors = body("one", "ground", "continuous", "0 0 1", 1, 0.2) + body(
        "two", "ground", "continuous", "0 0 1", 1, 0.9
    )
    gear = {"type": "coupling", "joints": ["one_joint", "two_joint"], "ratio": -3.0}
    sim = interpreted(inline(rotors, gear), dt=1e-2)
    run = sim.run(1.0, [0.6, 0.0])
    assert_close(run.q[-1], [1.0, -1.0 / 3.0], 1e-12)
    # It turns the second rotor: 0 = J2 th2'' + 3 λ.
    assert_close(sim.multipliers(), [0.2], 1e-12)


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


def test_a_ball_turns_with_a_turntable_it_does_not_slip_on() -> None:
    """Rolling is no constraint of positions: a closed path of the centre turns the ball."""
    links = (
        body("cart", "ground", "prismatic", "1 0 0", 0.5, 0.001)
        + body("cross", "cart", "prismatic", "0 1 0", 0.5, 0.001)
        + body("pan", "cross", "continuous", "0 0 1", 0.1, 0.01)
        + body("tilt", "pan", "continuous", "0 1 0", 0.1, 0.01)
        + body("ball", "tilt", "continuous", "1 0 0", 1.0, 0.02)
    )
    rolls = {"type": "rolling", "frames": ["ball", "world"], "radius": 0.1}
    sim = interpreted(inline(links, rolls, gravity=[0, 0, 0]), dt=1e-3)
    t = np.arange(1000) * 1e-3
    push = 0.3 * np.c_[np.sin(2 * np.pi * t), np.cos(2 * np.pi * t) - 0.5, 0 * t, 0 * t, 0 * t]
    run = sim.run(1.0, push)
    assert np.abs(run.q[-1, 2:]).max() > 0.1
    assert worst_gaps(sim, run, 10)[1] < CLOSURE_SPEED
    assert abs(run.balance).max() < 1e-8


def test_a_rod_makes_a_pendulum_of_a_sliding_mass() -> None:
    """A mass free in the plane, 0.5 m from a nail, swings as a pendulum does."""
    links = body("x", "ground", "prismatic", "1 0 0", 1e-3, 1e-6) + body(
        "z", "x", "prismatic", "0 0 1", 1.0, 1e-6
    )
    rod = {"type": "distance", "frames": ["z", "world"], "distance": 0.5}
    start = {"x_joint": 0.5 * np.sin(0.7), "z_joint": -0.5 * np.cos(0.7)}
    sim = interpreted(inline(links, rod, initial={"position": start}), integrator="dop853")
    run = sim.run(1.0)
    angle = np.arctan2(run.q[:, 0], -run.q[:, 1])
    speed = (run.v[:, 0] * np.cos(angle) + run.v[:, 1] * np.sin(angle)) / 0.5
    # The frame of the x slide adds 1 g horizontally: T = (1 + 0.001 cos²) (0.5 w)² / 2.
    kinetic = 0.5 * (1.0 + 1e-3 * np.cos(angle) ** 2) * (0.5 * speed) ** 2
    fall = 9.81 * 0.5 * (np.cos(angle) - np.cos(0.7))
    assert_close(kinetic, fall, 1e-10)


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_doubled_constraints_change_nothing(turn: float) -> None:
    """Nor does a planar loop in a tilted plane, whose third row depends on the other two."""
    once = scene("four_bar")
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


@pytest.mark.parametrize("dt", [2e-3, 1e-2])
def test_an_overconstrained_linkage_moves(dt: float) -> None:
    """Bricard's, at steps whose stages are far off the positions where its rows depend."""
    fine = interpreted(scene("bricard"), tolerance=1e-10, dt=0.1).run(2.0)
    run = interpreted(scene("bricard"), integrator="rk4", dt=dt).run(2.0)
    error = abs(run.q[-1] - fine.q[-1]).max()
    assert error < 1e4 * dt**4, f"{error:.1e}"
    assert np.ptp(fine.energy) < 1e-8


def flat(**options: Any) -> Simulator:
    """Two cranks and a coupler of 1 m, no weight: flat, they may go on parallel or crossed."""
    path = models.FOLDER.parent / "reference/parallelograms_1.yaml"
    plain = load_scene(path).model_dump(exclude_unset=True)
    return interpreted(plain | {"gravity": [0, 0, 0]}, **options)


@pytest.mark.parametrize("speed", [1e-6, 1e-3, 0.1, 3.0, 30.0])
@pytest.mark.parametrize("options", [{}, {"tolerance": 1e-7}, {"integrator": "midpoint"}], ids=str)
def test_the_branch_is_kept_through_flat(speed: float, options: dict[str, Any]) -> None:
    """From half a second before it to half a second after, and through rest in it."""
    sim = flat(**options)
    start = 0.5003 * speed
    sim.reset([start, -start, start], [-speed, speed, -speed])
    run = sim.run(1.0)
    assert_close(run.q[:, 0], start - speed * run.time, 1e-9)
    assert_close(run.q[:, 2], run.q[:, 0], 1e-9)


def test_torques_that_fight_in_a_singular_position_are_an_error() -> None:
    """They tear at the hinges without end; no motion follows from them."""
    sim = flat()
    sim.reset([0.005, -0.005, 0.005], [-0.01, 0.01, -0.01])
    with pytest.raises(SimulationDiverged, match="near a singular position") as error:
        sim.run(2.0, [10.0, 0.0, -10.0])
    motion = error.value.recording
    assert motion is not None
    assert abs(motion.q[:, 0] - motion.q[:, 2]).max() < 1e-6


def test_the_slider_passes_its_dead_centres() -> None:
    sim = Simulator(scene("slider_crank"))
    sim.set_state(v=[20.0, 0.0, 0.0])
    run = sim.run(5.0)
    turns = run.q[-1, 0] / (2 * np.pi)
    assert abs(turns) > 5
    assert_close(run.q[:, 2].max(), 0.55, 1e-3)
    assert_close(run.q[:, 2].min(), 0.25, 1e-3)
    assert np.ptp(run.energy) < 1e-6


def pen(active: bool) -> Simulator:
    sheet = {
        "type": "plane",
        "name": "sheet",
        "height": -0.4,
        "switchable": True,
        "active": active,
    }
    pin = {"type": "point", "name": "pin", "switchable": True, "active": False,
           "points": [[0, 0, 0], [2.0, 0, 0]]}  # fmt: skip
    start = {"position": {"shoulder": -0.5, "elbow": -0.3}}
    return interpreted({"robot": {"urdf": str(models.SCENES / "two_link.urdf")}, "initial": start,
                      "constraints": [sheet | TIP, pin | TIP]})  # fmt: skip


def test_switching() -> None:
    sim = pen(active=True)
    assert sim.held_constraints == ("sheet",)
    held = sim.run(0.2)
    assert sim.multipliers()[0] != 0.0
    sim.set_constraint("sheet", False)
    assert sim.held_constraints == ()
    np.testing.assert_array_equal(sim.multipliers(), np.zeros(4))
    free, plain = sim.run(0.1), interpreted(str(models.SCENES / "two_link.urdf"))
    plain.reset(held.q[-1], held.v[-1])
    assert_close(free.q[-1], plain.run(0.1).q[-1], BACKENDS)
    state = sim.set_constraint("sheet", True)
    assert state.time == free.time[-1]
    gap, speed = worst_gaps(sim, sim.run(0.2), 1)
    assert gap < CLOSURE
    assert speed < CLOSURE_SPEED


def test_switching_on_takes_the_velocity_across_only() -> None:
    """As a blow without rebound: the impulse is Aᵀ times something."""
    sim = pen(active=False)
    sim.reset(v=[1.0, 2.0])
    q, before = sim.state.q, sim.state.v
    state = sim.set_constraint("sheet", True)
    rows = sim.dynamics.constrained.closure.rows
    A = rows.stacked(state.q, state.v, ("sheet",)).jacobian[0]
    impulse = sim.dynamics.mass_matrix(state.q) @ (before - state.v)
    assert abs(impulse[0] * A[1] - impulse[1] * A[0]) < 1e-10
    assert abs(state.q - q).max() < 0.5


def test_what_cannot_be_switched_loses_nothing() -> None:
    sim = pen(active=True)
    sim.run(0.1)
    before = sim.state
    with pytest.raises(ConstraintError, match="'pin' by"):
        sim.set_constraint("pin", True)
    with pytest.raises(InvalidInput, match="'roof' cannot be switched; switchable: sheet, pin"):
        sim.set_constraint("roof", True)
    assert sim.state is before
    assert sim.held_constraints == ("sheet",)
    sim.run(0.1)


@pytest.mark.parametrize("name", ["four_bar"])
def test_virtual_machine_and_lanes_agree(name: str) -> None:
    sim, slow = Simulator(scene(name)), Simulator(scene(name), backend="vm")
    q, v = sim.state.q, sim.state.v
    torque = 0.01 * np.ones(sim.n)
    ends = [s.run(0.05, torque).q[-1] for s in (sim, slow)]
    assert_close(ends[1], ends[0], BACKENDS)
    arms = sim.rollout(np.tile(q, (9, 1)), np.tile(v, (9, 1)), torque, 50, last_only=True)
    assert_close(arms[:, : sim.n], np.tile(ends[0], (9, 1)), BACKENDS)


def test_rollouts_close_what_they_are_given() -> None:
    sim = interpreted(scene("four_bar"))
    q = sim.state.q + np.array([[0.0, 0, 0], [0.01, 0, 0], [0.0, 0.02, -0.01]])
    motion = sim.rollout(q, 0 * q, np.zeros(3), 5)
    residuals = [sim.dynamics.constrained.closure.residuals(x[:3])["loop"] for x in motion[:, -1]]
    assert max(residuals) < CLOSURE


@pytest.mark.parametrize("name", ["four_bar", "panda_pen"])
def test_derivatives_along_the_constraints(name: str, rng: np.random.Generator) -> None:
    """A of a tick, against differences of motions that obey."""
    sim = interpreted(scene(name))
    sim.run(0.05)
    state, tau, n = sim.state, np.zeros(sim.n), sim.n
    A, B = sim.linearize(state, tau)
    closure = sim.dynamics.constrained.closure
    ends, starts = [], []
    step = 1e-5 * rng.normal(size=(2, n))
    for sign in (1.0, -1.0):
        q, v = closure.closed(state.q + sign * step[0], state.v + sign * step[1])
        starts.append(np.concatenate([q, v]))
        sim.reset(q, v)
        end = sim.step(tau)
        ends.append(np.concatenate([end.q, end.v]))
    wanted, change = ends[0] - ends[1], starts[0] - starts[1]
    assert_close(A @ change / 1e-5, wanted / 1e-5, 10 * FINITE_DIFF)
    assert B.shape == (2 * n, n)


def test_a_scene_without_constraints_has_none_of_it() -> None:
    sim = models.simulator("two_link")
    assert sim.plant.project is None
    assert [part.on for part in sim.plan.parts if part.name == "constraints"] == [False]
    assert sim.plant.parameters.names == []
    assert sim.multipliers().shape == (0,)


def test_mimic_joints_in_a_loop() -> None:
    """A gripper whose jaws follow each other, hung on a rod from the ceiling."""
    urdf = str(models.FOLDER / "gripper.urdf")
    dyn = Dynamics({"robot": {"urdf": urdf}})
    place = dyn.model.pin.frames
    assert len(place)
    rod = {"type": "plane", "frames": ["left_jaw", "world"], "height": 0.0}
    held = interpreted({"robot": {"urdf": urdf}, "constraints": [rod]}, integrator="dop853")
    run = held.run(1.0)
    assert worst_gaps(held, run, 10)[0] < CLOSURE
    assert abs(run.balance).max() < TRAJECTORY
