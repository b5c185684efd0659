# SPDX-License-Identifier: Apache-2.0
"""The independent simulator itself against closed forms: bodies on rails, one law at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from reference.independent import Motion, simulate

NEAR = 1e-10
TIMES = np.linspace(0.0, 1.0, 21)
G = 9.81


def rails(*axes: str, mass: float = 2.0) -> str:
    """A body on rails along axes, one after another: joints x, y, z and the body ``body``."""
    names = ["base", *(f"slide_{axis}" for axis in axes[:-1]), "body"]
    points = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    links = "".join(
        f'<link name="{name}"><inertial><mass value="{mass if name == "body" else 0}"/>'
        '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name in names
    )
    joints = "".join(
        f'<joint name="{axis}" type="prismatic"><parent link="{a}"/><child link="{b}"/>'
        f'<axis xyz="{points[axis]}"/>'
        '<limit lower="-9" upper="9" effort="99" velocity="99"/></joint>'
        for axis, a, b in zip(axes, names, names[1:], strict=False)
    )
    return f'<robot name="rails">{links}{joints}</robot>'


def moved(
    axes: str, command: dict[str, float] | None = None, *, times: np.ndarray = TIMES,
    mass: float = 2.0, **scene: Any,
) -> Motion:  # fmt: skip
    """The motion of a body on rails; its account must close."""
    joints = {"*": {"limits": {"stop": False}}, **scene.pop("joints", {})}
    given = {"robot": {"urdf": rails(*axes, mass=mass)}, "joints": joints, **scene}
    motion = simulate(given, command or {}, times)
    assert abs(motion.balance).max() < NEAR
    return motion


def close(actual: np.ndarray, wanted: np.ndarray, near: float = NEAR) -> None:
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=near)


def test_dry_friction_stops_a_body_and_holds_it() -> None:
    """From 1 m/s with 3 N on 2 kg: 1.5 m/s² until 2/3 s, then at rest under less than static."""
    friction = {"coulomb": 3.5, "static": 4.0}
    start = {"velocity": {"x": 1.0}}
    run = moved("x", {"x": 0.5}, joints={"x": {"friction": friction}}, initial=start)
    t = np.minimum(TIMES, 2 / 3)
    close(run.q[:, 0], t - 0.75 * t**2)
    assert (run.v[TIMES > 0.7] == 0.0).all()
    assert [kind for _, kind, _ in run.log] == ["slides", "sticks"]


def test_a_push_above_static_friction_moves_and_stribeck_lets_it_run() -> None:
    """v' = (f - Fc - (Fs - Fc) exp(-(v/vs)²)) / m by another integrator."""
    friction = {"coulomb": 3.0, "static": 4.0, "stribeck_velocity": 0.3}
    run = moved("x", {"x": 4.2}, joints={"x": {"friction": friction}})
    known = solve_ivp(
        lambda _, x: [x[1], (4.2 - 3.0 - np.exp(-((x[1] / 0.3) ** 2))) / 2.0],
        (0.0, 1.0), [0.0, 0.0], "Radau", TIMES, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    close(run.q[:, 0], known.y[0], 1e-9)


def test_friction_by_position() -> None:
    """Energy is the work against friction: ∫ Fc c(x) dx, the factor here exactly linear."""
    table = {"at": [-1.0, 0.0, 1.0, 2.0], "factor": [1.0, 1.0, 3.0, 3.0]}
    friction = {"coulomb": 1.0, "position": table}
    run = moved(
        "x", joints={"x": {"friction": friction}}, initial={"velocity": {"x": 1.2}}, times=TIMES
    )
    x = run.q[-1, 0]
    # between 0 and 1 the curve is the cubic with level ends: 1 + 2 (3 x² - 2 x³)
    work = x + 2.0 * (x**3 - 0.5 * x**4)
    close(0.5 * 2.0 * (1.2**2 - run.v[-1, 0] ** 2), work)


def test_a_ball_bounces_to_rest() -> None:
    """From h with restitution e it rests after (1 + e)/(1 - e) √(2h/g), having rebounded e² h."""
    contact = {"type": "contact", "frame": "body", "restitution": 0.5}
    run = moved("z", constraints=[contact], initial={"position": {"z": 0.2}})
    first = np.sqrt(0.4 / G)
    t = TIMES[(first < TIMES) & (2 * first > TIMES)] - first
    rebound = 0.5 * np.sqrt(2 * G * 0.2)
    close(run.q[(first < TIMES) & (2 * first > TIMES), 0], rebound * t - 0.5 * G * t**2)
    hits = [at for at, kind, _ in run.log if kind == "impact"]
    close(np.array(hits[-1]), np.array(3.0 * first), 1e-6)
    close(run.q[3.0 * first < TIMES, 0], 0.0)


def test_a_sliding_contact_in_two_directions() -> None:
    """A puck thrown along a table stops after v²/(2 µ g), in the direction it was thrown."""
    contact = {"type": "contact", "frame": "body", "friction": 0.3}
    run = moved("xyz", constraints=[contact], initial={"velocity": {"x": 1.2, "y": -0.9}})
    t = np.minimum(TIMES, 1.5 / (0.3 * G))
    way = 1.5 * t - 0.15 * G * t**2
    close(run.q, np.stack([0.8 * way, -0.6 * way, 0.0 * way], axis=1), 1e-9)
    assert "grips" in [kind for _, kind, _ in run.log]


def test_a_slanting_throw_loses_along_the_table_what_the_blow_takes() -> None:
    """Impulse (1 + e) m v_n pushes, friction takes µ of it from the sliding speed."""
    contact = {"type": "contact", "frame": "body", "friction": 0.2, "restitution": 0.5}
    start = {"position": {"z": 0.05}, "velocity": {"x": 3.0, "z": -1.0}}
    run = moved("xz", constraints=[contact], initial=start, times=np.array([0.0, 0.06]))
    down = np.sqrt(1.0 + 2 * G * 0.05)
    assert [kind for _, kind, _ in run.log] == ["lifts", "impact"]
    close(run.v[-1, 0], 3.0 - 0.2 * 1.5 * down)


def test_a_stop_throws_back_and_then_holds() -> None:
    """1 N on 2 kg against a stop at 0.1 m, e = 0.5: rests at 3 √(2 s / a)."""
    limits = {"lower": -1.0, "upper": 0.1, "stop": {"restitution": 0.5}}
    times = np.linspace(0.0, 3.0, 31)
    run = moved("x", {"x": 1.0}, joints={"x": {"limits": limits}}, times=times)
    rest = 3.0 * np.sqrt(2 * 0.1 / 0.5)
    close(run.q[times > rest, 0], 0.1)
    close(run.q[times < rest / 3, 0], 0.25 * times[times < rest / 3] ** 2)
    assert run.q.max() < 0.1 + 1e-12


def test_the_range_of_the_urdf_has_stops_by_default() -> None:
    run = moved("x", {"x": 4.0}, joints={"*": {}}, initial={"position": {"x": 8.9}})
    close(run.q[np.sqrt(0.1) < TIMES, 0], 9.0)
    assert [kind for _, kind, _ in run.log] == ["leaves", "leaves", "hit", "holds"]


def test_a_soft_stop_pushes_and_never_pulls() -> None:
    """Half a damped oscillation, cut off where spring and damper together would pull."""
    k, d, m = 800.0, 16.0, 2.0
    limits = {"lower": -1.0, "upper": 0.1, "stop": {"stiffness": k, "damping": d}}
    start = {"velocity": {"x": 1.0}}
    run = moved("x", joints={"x": {"limits": limits}}, initial=start)
    decay, omega = d / (2 * m), np.sqrt(k / m - (d / (2 * m)) ** 2)
    ends = np.arctan2(2 * decay * omega, decay**2 - omega**2) % np.pi / omega
    leaves = np.exp(-decay * ends) * (np.cos(omega * ends) - decay / omega * np.sin(omega * ends))
    depth = np.exp(-decay * ends) * np.sin(omega * ends) / omega
    later = TIMES > 0.1 + ends
    close(run.v[later, 0], leaves)
    close(run.q[later, 0], 0.1 + depth + leaves * (TIMES[later] - 0.1 - ends))


def test_a_cord_pulls_once_and_is_slack() -> None:
    """Half a period, and away as fast as it came."""
    cord = {"frames": ["body", "world"], "points": [[0, 0, 0], [2.0, 0, 0]]}
    cord |= {"stiffness": 800.0, "rest_length": 2.1, "tension_only": True}
    run = moved("x", springs=[cord], initial={"velocity": {"x": -1.0}})
    half = np.pi / 20.0
    later = TIMES > 0.1 + half
    close(run.q[later, 0], TIMES[later] - half - 0.2)


def test_a_command_between_every_two_times() -> None:
    """1 N, then none, then held by friction under less than it can hold."""
    commands = np.repeat([[1.0], [0.0], [0.25]], [5, 10, 5], axis=0)
    scene = {"robot": {"urdf": rails("x")}, "joints": {"x": {"friction": {"coulomb": 0.5}}}}
    run = simulate(scene, commands, TIMES)
    t, pushed = TIMES, 0.25
    fast = np.minimum(t, pushed)
    slow = np.clip(t - pushed, 0.0, 0.25)
    close(run.q[:, 0], 0.125 * fast**2 + 0.0625 * slow - 0.125 * slow**2)
    close(run.v[TIMES > 0.51], 0.0, 1e-15)


def test_springs_of_joints_and_of_points() -> None:
    spring = {"stiffness": 18.0, "rest": 0.2}
    run = moved("x", joints={"x": {"spring": spring}})
    close(run.q[:, 0], 0.2 - 0.2 * np.cos(3.0 * TIMES))
    point = {"frames": ["body", "world"], "points": [[0, 0, 0], [2.0, 0, 0]]}
    pull = {**point, "stiffness": 18.0, "rest_length": 1.0, "damping": 2.4}
    run = moved("x", springs=[pull])
    A = np.array([[0.0, 1.0], [-9.0, -1.2]])
    known = [1.0 + (expm(A * t) @ [-1.0, 0.0])[0] for t in TIMES]
    close(run.q[:, 0], np.array(known))


def test_a_motor_with_inductance_on_a_lossy_gear() -> None:
    """Linear as long as it drives: x, v, i by the exponential of a matrix."""
    motor = {
        "command": "voltage", "resistance": 2.0, "inductance": 0.05, "torque_constant": 0.1,
        "rotor_inertia": 1e-3, "gear_ratio": 20.0, "efficiency": 0.7,
    }  # fmt: skip
    run = moved("x", {"x": 6.0}, joints={"x": {"actuator": motor}})
    mass, K = 2.0 + 1e-3 * 400, 2.0
    A = np.array([[0, 1, 0, 0], [0, 0, 0.7 * K / mass, 0], [0, -K / 0.05, -40, 1], [0, 0, 0, 0]])
    known = np.array([expm(A * t) @ [0.0, 0.0, 0.0, 120.0] for t in TIMES])
    close(run.q[:, 0], known[:, 0])
    close(run.z[:, 0], known[:, 2])


def test_a_rotor_on_a_belt() -> None:
    """Two masses on a spring with a damper, pushed by a current."""
    motor = {"command": "current", "torque_constant": 0.1, "rotor_inertia": 1e-3, "gear_ratio": 20}
    belt = {"stiffness": 50.0, "damping": 0.4}
    run = moved("x", {"x": 1.5}, joints={"x": {"actuator": motor, "transmission": belt}})
    k, d, m, J = 50.0, 0.4, 2.0, 0.4
    A = np.zeros((5, 5))
    A[:2, 2:4] = np.eye(2)
    A[2, :4] = np.array([-k, k, -d, d]) / m
    A[3, :4] = np.array([k, -k, d, -d]) / J
    A[3, 4] = 1.0
    known = np.array([expm(A * t) @ [0, 0, 0, 0, 1.5 * 2.0 / J] for t in TIMES])
    close(run.q[:, 0], known[:, 0])
    close(run.z[:, 0], known[:, 1])


def test_hysteresis_of_a_harmonic_drive() -> None:
    """In one direction w = 1 - exp(-δ/D), which the torque on a held link shows."""
    motor = {"command": "current", "torque_constant": 0.1, "rotor_inertia": 1e-3, "gear_ratio": 20}
    belt = {"stiffness": 50.0, "hysteresis": {"torque": 2.0, "deflection": 0.02}}
    joint = {"actuator": motor, "transmission": belt, "friction": {"coulomb": 50.0}}
    run = moved("x", {"x": 1.5}, joints={"x": joint}, times=np.array([0.0, 0.05]))
    twist, rate, w = run.z[-1]
    assert rate > 0.0 and run.q[-1, 0] == 0.0
    close(w, 1.0 - np.exp(-twist / 0.02))


def test_bristles_give_the_friction_of_steady_sliding() -> None:
    """Dragged by f they reach v = (f - Fc) / σ2, and so straight on as the law's own equation."""
    friction = {"coulomb": 1.0, "viscous": 8.0, "lugre": {"sigma0": 400.0, "sigma1": 5.0}}
    times = np.linspace(0.0, 4.0, 9)
    run = moved("x", {"x": 3.0}, joints={"x": {"friction": friction}}, times=times)
    close(run.v[-1, 0], 0.25, 1e-6)

    def rate(_: float, x: np.ndarray) -> list[float]:
        dz = x[1] - 400.0 * abs(x[1]) * x[2]
        return [x[1], (3.0 - 400.0 * x[2] - 5.0 * dz - 8.0 * x[1]) / 2.0, dz]

    known = solve_ivp(rate, (0, 4), np.zeros(3), "Radau", times, rtol=1e-11, atol=1e-13)
    close(run.q[:, 0], known.y[0], 1e-8)


def test_a_rod_makes_a_pendulum_of_two_rails() -> None:
    rod = {
        "type": "distance", "frames": ["body", "world"], "points": [[0, 0, 0], [0, 0, 0]],
        "distance": 0.5,
    }  # fmt: skip
    angle = 1.0
    place = {"x": 0.5 * np.sin(angle), "z": -0.5 * np.cos(angle)}
    run = moved("xz", constraints=[rod], initial={"position": place})
    known = solve_ivp(
        lambda _, x: [x[1], -G / 0.5 * np.sin(x[0])],
        (0.0, 1.0), [angle, 0.0], "DOP853", TIMES, rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    close(run.q, 0.5 * np.stack([np.sin(known.y[0]), -np.cos(known.y[0])], axis=1), 1e-9)


def test_what_it_does_not_know_it_refuses() -> None:
    for joint in ({"backlash": 1}, {"friction": {"load": {}}}, {"limits": {"stop": {"give": 1}}}):
        try:
            moved("x", joints={"x": joint})
        except NotImplementedError:
            continue
        raise AssertionError(joint)
