# SPDX-License-Identifier: Apache-2.0
"""Balls that roll, and planes that links carry, against closed forms and other equations."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from arm_dynamics import SceneError
from arm_sim import Simulator, contact_history
from models.touching import carrier, contact, free_body, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
M, R, J = 2.0, 0.3, 0.05
ROLLS = 1.0 + J / (M * R**2)
CONTROLLED: dict[str, Any] = {"tolerance": 1e-11, "dt": 1e-2}


def roller(mu: float, slope: float = 0.0, **options: Any) -> Simulator:
    """A wheel in the x-z plane on a slope that falls towards +x."""
    plane = {"point": [0, 0, 0], "normal": [np.sin(slope), 0, np.cos(slope)]}
    wheel = contact("body", radius=R, friction=mu, plane=plane)
    start = {"initial": {"position": {"z": R / np.cos(slope)}}}
    scene = {**rails("xz", M, turns=True, iyy=J), **start, "constraints": [wheel]}
    return Simulator(scene, **options)


# --- balls on planes of the world ----------------------------------------------------------------


def test_a_wheel_rolls_down_a_slope_or_slides_and_spins_up() -> None:
    """g sin θ / (1 + I/mr²) with enough friction; else g (sin θ - µ cos θ), turned by µ m g r."""
    angle = 0.4
    down = np.array([np.cos(angle), -np.sin(angle)])
    needed = np.tan(angle) * (1 - 1 / ROLLS)
    for mu, state in ((1.01 * needed, "sticks"), (0.99 * needed, "slides")):
        sim = roller(mu, angle, **CONTROLLED)
        run = sim.run(0.5)
        pressed = G * np.cos(angle)
        a = G * np.sin(angle) / ROLLS if state == "sticks" else G * np.sin(angle) - mu * pressed
        spin = a / R if state == "sticks" else mu * M * pressed * R / J
        assert_close(run.q[:, :2] - run.q[0, :2], 0.5 * a * np.outer(run.time**2, down), 1e-11)
        assert_close(run.q[:, 2], 0.5 * spin * run.time**2, 1e-11)
        (force,) = sim.contact_forces()
        assert force.state == state
        assert_close(force.normal, M * pressed, 1e-10)
        touching = run.q[-1, :2] - R * np.array([np.sin(angle), np.cos(angle)])
        assert_close(force.point[[0, 2]], touching, CLOSED_FORM)


def test_a_bowled_ball_slides_until_it_rolls() -> None:
    """Thrown without spin it slides for (v0 - v)/µg and then rolls on with v = v0/(1 + I/mr²).

    Its friction has then taken the rest of the energy, and takes no more.
    """
    mu, v0 = 0.3, 2.0
    sim = roller(mu, **CONTROLLED)
    sim.reset(v=[v0, 0.0, 0.0])
    run = sim.run(1.0)
    rolls_at, speed = (v0 - v0 / ROLLS) / (mu * G), v0 / ROLLS
    rolling = run.time > rolls_at
    assert_close(run.v[rolling], np.tile([speed, 0.0, speed / R], (rolling.sum(), 1)), CLOSED_FORM)
    way = v0 * rolls_at - 0.5 * mu * G * rolls_at**2 + speed * (1.0 - rolls_at)
    assert_close(run.q[-1, 0], way, CLOSED_FORM)
    lost = 0.5 * M * v0**2 - 0.5 * M * ROLLS * speed**2
    history = contact_history(sim, run)
    assert_close(history.friction_loss[-1], lost, 1e-10)
    assert_close(np.diff(history.friction_loss[rolling]), np.zeros(rolling.sum() - 1), CLOSED_FORM)
    assert_close(run.balance, np.zeros(len(run)), 1e-10)


def test_chaplygins_ball_against_euler_equations() -> None:
    """A ball of three different moments rolls where its spin takes it (Chaplygin 1903).

    The moment of momentum about where it touches changes as J ω x ω in the body turns; integrated
    on quaternions by DOP853.
    """
    moments = np.array([0.02, 0.05, 0.06])
    ball = contact("body", radius=R, friction=10.0)
    start = {"initial": {"position": {"z": R}}}
    scene = {**free_body(M, moments), **start, "constraints": [ball]}
    sim = Simulator(scene, **CONTROLLED)
    spin = np.array([2.0, -1.5, 1.0])
    sim.reset(q=[0, 0, R, 0, 0, 0], v=[R * spin[1], -R * spin[0], 0.0, *spin])
    run = sim.run(0.5)

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        Q, w, n = Rotation.from_quat(x[:4]).as_matrix(), x[4:7], np.array([0.0, 0.0, 1.0])
        own = Q @ np.diag(moments) @ Q.T
        inertia = own + M * R**2 * (np.eye(3) - np.outer(n, n))
        dw = np.linalg.solve(inertia, -np.cross(w, own @ w))
        quat = 0.5 * np.array([*(x[3] * w + np.cross(w, x[:3])), -w @ x[:3]])
        return np.array([*quat, *dw, R * w[1], -R * w[0]])

    x0 = [0.0, 0.0, 0.0, 1.0, *spin, 0.0, 0.0]
    exact = solve_ivp(slope, (0, 0.5), x0, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    assert_close(run.q[-1, :2], exact[7:], 1e-10)
    found = Rotation.from_euler("XYZ", run.q[-1, 3:])
    away = found.inv() * Rotation.from_quat(exact[:4] / np.linalg.norm(exact[:4]))
    assert_close(away.magnitude(), 0.0, 1e-10)
    assert_close(run.q[:, 2], np.full(len(run), R), 1e-15)
    assert_close(run.energy, np.full(len(run), run.energy[0]), 1e-10)


# --- planes that links carry ---------------------------------------------------------------------


def wedge(mu: float, angle: float, base: float, mass: float, **options: Any) -> Simulator:
    """A block on a wedge that is free to slide along x and falls towards +x."""
    plane = {"frame": "tray", "normal": [np.sin(angle), 0, np.cos(angle)]}
    scene = rails("xz", mass, branches=[carrier("prismatic", "x", base)])
    return Simulator(
        {**scene, "constraints": [contact("body", friction=mu, plane=plane)]}, **options
    )


def of_joints(sim: Simulator, **values: float) -> np.ndarray:
    return np.array([values.get(name, 0.0) for name in sim.dynamics.joint_names])


def test_a_block_slides_down_a_wedge_that_moves() -> None:
    """Newton for both bodies, with the same force N n - µ N d, once on each."""
    angle, base, mass = 0.5, 3.0, 2.0
    n, d = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
    for mu in (0.0, 0.2):
        push = n - mu * d
        # Unknown: acceleration of the wedge, of the block against it, normal force.
        A = np.array(
            [[mass, mass * d[0], -push[0]], [0, mass * d[1], -push[1]], [base, 0, push[0]]]
        )
        a_wedge, a_block, normal = np.linalg.solve(A, [0.0, -mass * G, 0.0])
        sim = wedge(mu, angle, base, mass, **CONTROLLED)
        run = sim.run(0.4)
        half = 0.5 * run.time**2
        x, z, drive = (run.q[:, sim.dynamics.joint_names.index(k)] for k in ("x", "z", "drive"))
        assert_close(drive, a_wedge * half, CLOSED_FORM)
        assert_close(x, (a_wedge + a_block * d[0]) * half, CLOSED_FORM)
        assert_close(z, a_block * d[1] * half, CLOSED_FORM)
        (force,) = sim.contact_forces()
        assert force.state == "slides"
        assert_close(force.force[[0, 2]], normal * push, 1e-10)
        assert_close(force.point, [x[-1], 0.0, z[-1]], CLOSED_FORM)
        assert_close(run.balance, np.zeros(len(run)), 1e-10)


def test_a_ball_on_a_turntable_goes_in_circles() -> None:
    """Its centre turns with Ω / (1 + m r²/I), wherever and however fast (Routh 1884)."""
    table, turning = 1e12, 3.0
    branch = carrier("continuous", "z", 1.0, izz=table)
    start = {"initial": {"position": {"z": R}}}
    ball = contact("body", radius=R, friction=5.0, plane={"frame": "tray"})
    scene = {**free_body(M, [J] * 3, branch), **start, "constraints": [ball]}
    sim = Simulator(scene, **CONTROLLED)
    place, v = np.array([0.2, -0.1]), np.array([0.15, 0.3])
    slip = v - turning * np.array([-place[1], place[0]])
    sim.reset(
        q=of_joints(sim, x=place[0], y=place[1], z=R),
        v=of_joints(sim, x=v[0], y=v[1], roll=-slip[1] / R, pitch=slip[0] / R, drive=turning),
    )
    run = sim.run(0.6)
    rate = turning / (1.0 + M * R**2 / J)
    turned = rate * run.time
    ahead, aside = np.sin(turned) / rate, (1 - np.cos(turned)) / rate
    circle = place + np.outer(ahead, v) + np.outer(aside, [-v[1], v[0]])
    names = sim.dynamics.joint_names
    assert_close(run.q[:, [names.index("x"), names.index("y")]], circle, 1e-9)
    assert sim.contact_forces()[0].state == "sticks"


# --- whatever they meet in the suite -------------------------------------------------------------


BOTH = {"frame": "body", "plane": {"frame": "tray"}}


def test_torques_for_a_push_act_where_the_ball_touches() -> None:
    sim = roller(0.5, 0.4)
    sim.step(np.zeros(3))
    push = np.array([1.0, 0.0, -3.0])
    point, place = sim.contact_forces()[0].point, sim.state.q
    arm = point - [place[0], 0.0, place[1]]
    wanted = [push[0], push[2], np.cross(arm, push)[1]]
    assert_close(sim.dynamics.contact_torque(place, push), wanted, CLOSED_FORM)


@pytest.mark.parametrize(
    ("change", "more", "said"),
    [
        (BOTH, [{"type": "frame", "frames": ["tray", "body"], "name": "weld"}],
         "'body' relative to its plane's frame 'tray'"),
        ({"frame": "base"}, [], "no joint moves"),
        ({"radius": 0.1}, [], r"0\.1 m inside its plane"),
    ],
)  # fmt: skip
def test_what_cannot_touch_is_refused_by_name(
    change: dict[str, Any], more: list[dict[str, Any]], said: str
) -> None:
    scene = free_body(1.0, [0.1] * 3, carrier("continuous", "y", 1.0, iyy=1.0))
    with pytest.raises(SceneError, match=said):
        Simulator({**scene, "constraints": [{**contact("body"), **change}, *more]})
