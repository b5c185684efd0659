# SPDX-License-Identifier: Apache-2.0
"""The quickest timing of a path: bang-bang where that is known, within every limit, or refused."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from samples import always
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import models
from arm_dynamics import Dynamics, InvalidInput, Unreachable
from arm_dynamics.arrays import Array
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import (
    JointPath,
    Quintic,
    Trajectory,
    Trapezoid,
    joint_path,
    line,
    paced,
    retimed,
    timed,
)
from arm_dynamics.trajectory.time_optimal import Profile
from models.driven import wheel
from models.random_tree import tree
from models.rotor import rotor
from tolerances import ALGEBRA, assert_close


@cache
def straight() -> JointPath:
    dyn = models.dynamics("panda")
    task = TaskSpace(dyn, "panda_hand_tcp")
    pose = task.pose(dyn.model.q0)
    goal = Pose(pose.position + [0.05, 0.3, -0.25], pose.rotation)
    return joint_path(task, timed(line(pose, goal), 0.5, 2.0), dyn.model.q0)


TURN = Trajectory(
    np.array([0.0, 1.0]), np.array([[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]), np.array([[0.0], [1.0]])
)
"""One joint by 1 rad."""


def test_friction_that_varies_with_the_speed_is_met_on_a_fine_enough_grid() -> None:
    """By full torque to a place, then by the opposite one to rest at 1 rad, to 0.1 %."""
    law = {"coulomb": 0.6, "static": 0.9, "stribeck_velocity": 0.1}

    def until(event: Any, torque: float, start: list[float]) -> Any:
        event.terminal = True
        friction = Dynamics(rotor(0.1, **law)).friction

        def slope(_: float, x: Any) -> list[float]:
            return [x[1], (torque - friction([max(x[1], 1e-12)])[0]) / 0.1]

        return solve_ivp(slope, (0.0, 9.0), start, events=event, rtol=1e-8, atol=1e-10)

    def motion(place: float) -> tuple[float, float]:
        faster = until(lambda _, x: x[0] - place, 1.0, [0.0, 1e-12])
        slower = until(lambda _, x: x[1], -1.0, faster.y[:, -1])
        return slower.y[0, -1], faster.t[-1] + slower.t[-1]

    _, best = motion(brentq(lambda place: motion(place)[0] - 1.0, 0.5, 0.99, xtol=1e-6))
    quick = retimed(JointPath(TURN, Quintic(9.0)), Dynamics(rotor(0.1, effort=1.0, **law)))
    assert 1.0 - 1e-5 < quick.duration / best < 1.0 + 1.1e-3


def test_a_profile_is_covered_with_constant_accelerations() -> None:
    us = np.linspace(0.0, 1.0, 101)
    made = Profile.of(us, np.sqrt(2.0 * 3.0 * np.minimum(us, 1.0 - us)))  # ±3/s²
    assert made.duration == pytest.approx(2.0 / np.sqrt(3.0), rel=1e-12)
    for t in (0.1, 0.4, 0.8, 1.1):
        u, rate, rise = made.at(t)
        rest = made.duration - t
        assert_close(u, 1.5 * t**2 if t < rest else 1.0 - 1.5 * rest**2, ALGEBRA)
        assert_close([rate, rise], [3.0 * min(t, rest), 3.0 if t < rest else -3.0], 1e-8)
        slow = made.slower(2.0).at(2.0 * t)
        assert_close(slow, [u, rate / 2.0, rise / 4.0], ALGEBRA)
    assert made.at(-1.0) == (0.0, 0.0, 0.0)
    assert made.at(9.0) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("knot", [1e-5, 1.0 - 1e-13])
def test_it_goes_from_end_to_end_wherever_the_path_has_a_knot(knot: float) -> None:
    us, way = np.array([0.0, knot, 1.0]), np.ones((3, 1))
    path = Trajectory.through(us, us[:, None], way, 0.0 * way)
    quick = retimed(JointPath(path, Quintic(9.0)), models.dynamics("pendulum"), np.inf, 2.0)
    arrived = quick.sample(quick.duration - 1e-6).q, quick.sample(quick.duration).q
    assert_close([quick.sample(0.0).q, *arrived], [[0.0], [1.0], [1.0]], ALGEBRA)
    assert quick.duration == pytest.approx(2.0 * np.sqrt(0.5), rel=1e-4)


def test_a_motor_follows_its_torque_speed_curve() -> None:
    """Under its voltage V it approaches the speed V/K as 1 - exp(-t/T); it brakes on stall torque.

    After t it has turned by V/K (t - T (1 - exp(-t/T))) and needs w²/2d to stop.
    """
    inertia, R, K, V = 0.1, 2.0, 0.5, 1.0
    motor = {"command": "voltage", "resistance": R, "torque_constant": K, "voltage_limit": V}
    quick = retimed(JointPath(TURN, Quintic(9.0)), Dynamics(wheel(inertia, **motor)))
    T, brake = inertia * R / K**2, K * V / R / inertia

    def speed(t: float) -> float:
        return V / K * (1.0 - np.exp(-t / T))

    t = brentq(lambda t: V / K * t - T * speed(t) + speed(t) ** 2 / (2.0 * brake) - 1.0, 0.0, 9.0)
    assert quick.duration == pytest.approx(t + speed(t) / brake, rel=2e-3)


def test_what_cannot_be_is_refused() -> None:
    dyn, motion = models.dynamics("panda"), straight()
    with pytest.raises(Unreachable):
        retimed(motion, dyn, 5.0)  # the weight alone takes more
    with pytest.raises(InvalidInput, match="nothing limits the motion"):
        retimed(motion, dyn, np.inf)
    with pytest.raises(InvalidInput, match="limit is -1"):
        retimed(motion, dyn, -1.0)
    with pytest.raises(InvalidInput, match="points = 3"):
        retimed(motion, dyn, points=3)
    with pytest.raises(InvalidInput, match="acceleration is -1"):
        retimed(motion, dyn, None, -1.0)


def test_a_path_on_which_only_a_resting_joint_is_limited_is_refused() -> None:
    robot = {"urdf": tree(np.random.default_rng(1), (0, 1), ("continuous", "continuous"))}
    way = Trajectory.through(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 0.0]]),
                             np.array([[1.0, 0.0]] * 2), np.zeros((2, 2)))  # fmt: skip
    with pytest.raises(InvalidInput, match="nothing limits the motion along this path"):
        retimed(JointPath(way, Quintic(1.0)), Dynamics({"robot": robot}), np.inf, [np.inf, 5.0])


def motor(rng: np.random.Generator, torque: float, speed: float) -> dict[str, Any]:
    """A motor that gives this torque up to a part of this speed, with a lossy gear and cogging."""
    ratio, constant = float(rng.uniform(-90.0, -30.0)), 0.05
    current = torque / abs(ratio) / constant
    voltage = abs(ratio) * constant * speed * float(rng.uniform(0.8, 1.3))
    return {
        "command": str(rng.choice(["torque", "current", "voltage"])),
        "resistance": voltage / current * float(rng.uniform(0.3, 0.9)),
        "torque_constant": constant,
        "rotor_inertia": 1e-5,
        "gear_ratio": ratio,
        "efficiency": float(rng.uniform(0.6, 1.0)),
        "current_limit": current,
        "voltage_limit": voltage,
        "cogging": {"amplitude": 0.01 * torque / abs(ratio), "order": 1.0},
    }


def arm(rng: np.random.Generator, feature: str) -> Dynamics:
    """A random arm of three joints with a feature whose torques depend on the speed."""
    joints: dict[str, Any] = {}
    for name in ("joint1", "joint2", "joint3"):
        torque, speed = rng.uniform(60.0, 120.0), rng.uniform(1.0, 4.0)
        low = float(rng.uniform(0.02, 0.1) * torque)
        friction = {
            "none": {},
            "viscous": {"viscous": float(0.3 * torque / speed)},
            "dry": {"coulomb": low, "static": 1.5 * low, "stribeck_velocity": 0.2 * speed},
            "load": {"coulomb": low, "load": {"at": [0.0, torque], "factor": [1.0, 2.0]}},
            "motors": {"coulomb": low},
        }[feature]
        joints[name] = {
            "limits": {"effort": float(torque), "velocity": float(speed), "stop": False},
            "friction": friction,
        }
        if feature == "motors":
            joints[name]["actuator"] = motor(rng, torque, speed)
    robot = {"urdf": tree(rng, (0, 1, 2), ("revolute", "revolute", "revolute"))}
    return Dynamics({"robot": robot, "gravity": [0.0, 0.0, -5.0], "joints": joints})


def winding(rng: np.random.Generator) -> Trajectory:
    """A smooth path through random positions, at rest nowhere; joints reverse between knots."""
    us, q = np.linspace(0.0, 1.0, 5), rng.uniform(-0.6, 0.6, (5, 3))
    v, a = np.full((2, 5, 3), np.nan)
    for end, near in ((0, 1), (-1, -2)):
        v[end], a[end] = (q[near] - q[end]) / (us[near] - us[end]), 0.0
    return Trajectory.through(us, q, v, a)


def largest_share(dyn: Dynamics, motion: JointPath, acceleration: float, marks: Array) -> float:
    """Of all limits, by their definitions, at 20 points between marks in time."""
    model, inside = dyn.model, np.linspace(1e-5, 1.0 - 1e-5, 20)
    q, v, a = motion.at((marks[:-1, None] + np.diff(marks)[:, None] * inside).ravel())
    tau = np.concatenate([dyn.inverse(*x) for x in zip(*(x.reshape(-1, 100, 3) for x in (q, v, a)),
                                                      strict=True)])  # fmt: skip
    used = [abs(v) / model.velocity_limit, abs(a) / acceleration]
    for i, drive in enumerate(model.drives):
        if drive is None:
            used.append(abs(tau[:, i]) / model.effort_limit[i])
            continue
        m, N = drive.motor, drive.motor.gear_ratio
        poles = -m.cogging.amplitude * np.sin(m.cogging.order * N * q[:, i])
        current = (tau[:, i] / N - poles) / m.torque_constant
        voltage = m.resistance * current + m.torque_constant * N * v[:, i]
        used += [abs(current) / m.current_limit, abs(voltage) / m.voltage_limit]
    return float(max(x.max() for x in used))


FEATURES = ["none", "viscous", "dry", "load", "motors"]


@pytest.mark.parametrize("feature", always(FEATURES, "dry", "motors"))
def test_every_limit_holds_between_the_points_too(feature: str, rng: np.random.Generator) -> None:
    """Of a random arm on a random path, at 20 points in every interval, and one is reached."""
    dyn, over = arm(rng, feature), winding(rng)
    quick = retimed(JointPath(over, Quintic(1.0)), dyn, None, 40.0, points=50)
    marks = quick.timing.times
    turning = np.sign(quick.at(marks)[1].round(9))  # dry friction jumps at points, not between
    assert feature in ("none", "viscous") or (turning[1:] * turning[:-1] >= 0.0).all()
    marks = np.concatenate([marks, np.full(-(len(marks) - 1) % 5, marks[-1])])  # for whole batches
    assert 1.0 - 1e-3 < largest_share(dyn, quick, 40.0, marks) <= 1.0
    for timing in (Quintic(1e-3), Trapezoid(1e-3, 2e-4)):
        smooth = paced(JointPath(over, timing), dyn, None, acceleration=40.0)
        marks = np.linspace(0.0, smooth.duration, 101)
        assert 1.0 - 1e-3 < largest_share(dyn, smooth, 40.0, marks) <= 1.0
        assert smooth.duration > quick.duration
