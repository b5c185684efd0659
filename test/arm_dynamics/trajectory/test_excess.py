# SPDX-License-Identifier: Apache-2.0
"""Limits of a robot as those of a trajectory: which joint breaks which, when, and by how much."""

from dataclasses import replace

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, Unreachable, load_scene
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Bounds, Limits, Trajectory, Waypoint, spline, stretched_spline
from arm_dynamics.trajectory.joint_paths import check_limits
from models.driven import wheel

ARM = models.dynamics("two_link")
NONE = np.full(2, np.inf)
FREE = Limits(NONE, NONE, -NONE, NONE, ("shoulder", "elbow"))


def limits(**only: list[float]) -> Limits:
    return Limits(**({name: getattr(FREE, name) for name in ("velocity", "acceleration", "lower",
                  "upper")} | {k: np.array(v) for k, v in only.items()}),
                  joint_names=FREE.joint_names)  # fmt: skip


def rest_to_rest(*q: float, time: float = 2.0) -> Trajectory:
    """The quintic 10 s³ - 15 s⁴ + 6 s⁵ from zero."""
    still = [0.0, 0.0]
    return spline([Waypoint(0.0, still, still, still), Waypoint(time, q, still, still)])


def complaint(bounds: Bounds, trajectory: Trajectory, late: float = 0.0) -> str:
    with pytest.raises(InvalidInput) as found:
        bounds.check(trajectory, late)
    return str(found.value)


def test_velocity_joint_moment_and_limit_are_named() -> None:
    """u' = 30 s² (1 - s)² / T reaches half its peak of 15/8 / T at s = (1 - √(1 - √½)) / 2."""
    peak = 15 / 8 / 2
    Bounds(limits(velocity=[peak, peak], upper=[1, 1], lower=[-1, -1])).check(rest_to_rest(1, -1))
    half = peak / 2
    said = complaint(Bounds(limits(velocity=[9, half])), rest_to_rest(1, -1))
    when = 2 * (1 - np.sqrt(1 - np.sqrt(0.5))) / 2
    assert said == (
        f"joint 'elbow' would leave its velocity limit at {when:.3f} s and reach {-2 * half:.4g}; "
        f"allowed: {-half:.4g}"
    )


def test_how_far_a_joint_goes_is_that_of_the_whole_trajectory() -> None:
    """It leaves its limit in the first segment, and goes on in the second."""
    still, bounds = [0.0, 0.0], Bounds(limits(lower=[-9, -1], upper=[9, 1]))
    for sign in (1.0, -1.0):
        places = [[0.0, 0.0], [0.0, 1.2 * sign], [0.0, 1.7 * sign], [0.0, 1.1 * sign]]
        way = spline([Waypoint(float(k), q, still, still) for k, q in enumerate(places)])
        assert f"and reach {1.7 * sign:.4g}; allowed: {sign:.4g}" in complaint(bounds, way)


def test_the_first_in_time_is_named_with_its_unit_and_what_the_margin_widens() -> None:
    types = ("revolute", "prismatic")
    fast = replace(limits(velocity=[9, 0.4], upper=[9, 0.5]), joint_types=types)
    said = complaint(Bounds(fast, margin=0.02), rest_to_rest(0, 1))
    assert said.endswith("and reach 0.9375 m/s; allowed: 0.4 m/s and 2 % more (limit_margin)")
    far = replace(limits(velocity=[9, 0.9], upper=[9, 0.01]), joint_types=types)
    said = complaint(Bounds(far, margin=0.02), rest_to_rest(0, 1))
    assert said.endswith("and reach 1 m; allowed: 0.01 m")


def test_an_arm_beyond_a_position_limit_may_come_back() -> None:
    away = spline([Waypoint(0.0, [1.2, 0], [0, 0], [0, 0]), Waypoint(1.0, [0.5, 0])])
    Bounds(limits(upper=[1, 1])).check(away)
    below = spline([Waypoint(0.0, [0, -1.2], [0, 0], [0, 0]), Waypoint(1.0, [0, -0.5])])
    Bounds(limits(lower=[-1, -1])).check(below)
    out = spline([Waypoint(0.0, [0, -0.5], [0, 0], [0, 0]), Waypoint(1.0, [0, -1.2])])
    assert "'elbow' would leave its position" in complaint(Bounds(limits(lower=[-1, -1])), out)


def test_lines_jump_in_velocity_which_no_acceleration_limit_allows() -> None:
    lines = spline([Waypoint(0.0, [0, 0], [0, 0], [0, 0]), Waypoint(1.0, [0, 0.1]),
                    Waypoint(2.0, [0, 0.1])])  # fmt: skip
    Bounds(FREE).check(lines)
    said = complaint(Bounds(limits(acceleration=[5, 5])), lines)
    assert "'elbow' would leave its acceleration limit at 0.000 s and reach inf" in said
    with pytest.raises(InvalidInput, match="at 1.000 s"):  # it moved like that already
        Bounds(limits(acceleration=[5, 5])).check(lines, before=np.array([0.0, 0.1]))
    assert "position limit at 0.750 s" in complaint(
        Bounds(limits(upper=[9, 0.05])), lines, late=0.25
    )


def test_a_margin_widens_velocities_and_not_positions() -> None:
    peak = 15 / 8 / 2
    Bounds(limits(velocity=[peak / 1.05] * 2), margin=0.06).check(rest_to_rest(1, 0))
    complaint(Bounds(limits(velocity=[peak / 1.05] * 2), margin=0.04), rest_to_rest(1, 0))
    complaint(Bounds(limits(upper=[0.99, 1]), margin=1.0), rest_to_rest(1, 0))


def test_the_factor_is_what_time_must_be_stretched_by() -> None:
    """Speeds go with one over the time, accelerations with one over its square."""
    peak = 15 / 8 / 2
    by_speed = Bounds(limits(velocity=[peak / 3, 9]))
    assert by_speed.factor(rest_to_rest(1, 0)) == pytest.approx(3.0, rel=1e-9)
    by_rise = Bounds(limits(acceleration=[10 / np.sqrt(3) / 4 / 9, 99]))
    assert by_rise.factor(rest_to_rest(1, 0)) == pytest.approx(3.0, rel=1e-9)
    assert Bounds(FREE).factor(rest_to_rest(1, 0)) == 1.0


def test_an_excess_between_the_points_that_are_looked_at_is_seen() -> None:
    """The limit lies 3e-5 below or above the largest torque, which none of 60 points reaches."""
    quick = rest_to_rest(0.4, 0.4, time=0.2)
    torques = abs(ARM.inverse(*quick.at(np.linspace(0.0, 0.2 - 1e-9, 20001)))[:, 0])
    assert max(torques[:: 20000 // 59]) < max(torques) * (1.0 - 1e-4)
    for higher in (3e-5, -3e-5):
        given = models.scene("two_link").model_dump(exclude_none=True)
        given["joints"]["shoulder"]["limits"] = {"effort": max(torques) * (1.0 + higher)}
        bounds = Bounds(FREE, Dynamics(given))
        if higher > 0.0:
            bounds.check(quick)
            assert bounds.factor(quick) == 1.0
        else:
            assert "'shoulder' would leave its effort limit" in complaint(bounds, quick)
            assert bounds.factor(quick) > 1.0


def test_a_motor_beyond_its_torque_speed_curve_is_named() -> None:
    """With R i + K ω on no more than 12 V the wheel cannot turn by 3 rad in half a second."""
    motor = {"resistance": 0.5, "torque_constant": 0.05, "voltage_limit": 12.0, "gear_ratio": 30.0}
    wheels, one = Dynamics(wheel(0.1, **motor)), np.full(1, np.inf)
    bounds = Bounds(Limits(one, one, -one, one, ("axle",)), wheels)
    still = [0.0]
    start = Waypoint(0.0, still, still, still)
    quick, slow = ([start, Waypoint(T, [3.0], still, still)] for T in (0.5, 1.0))
    bounds.check(spline(slow))
    said = complaint(bounds, spline(quick))
    assert "'axle' would leave its voltage limit at " in said and "allowed: 12" in said
    _, v, a = spline(quick).at(np.linspace(0.0, 0.499, 500))
    most = (0.5 * 0.1 * a / (0.05 * 30.0) + 0.05 * 30.0 * v).max()
    assert float(said.split("reach ")[1].split()[0].strip(";")) == pytest.approx(most, rel=1e-3)
    bounds.check(stretched_spline(quick, bounds.factor))
    Bounds(bounds.limits, wheels, margin=0.5).check(spline(quick))


SCARA = str(models.FOLDER / "scara.urdf")


def test_limits_of_a_robot() -> None:
    """Of a speed limit of zero, which plans nothing, is made none."""
    slow = {"inner": {"limits": {"velocity": 0.0}}, "slide": {"limits": {"velocity": 0.5}}}
    model = ArmModel(load_scene({"robot": {"urdf": SCARA}, "joints": slow}))
    limits = Limits.of(model, 3.0)
    assert limits.velocity.tolist() == [np.inf, 8.0, 0.5, np.inf]
    assert limits.acceleration.tolist() == [3.0] * 4
    assert limits.lower.tolist() == [-2.6, -2.6, 0.0, -np.inf]
    assert limits.upper.tolist() == [2.6, 2.6, 0.2, np.inf]
    assert [limits.name(i) for i in range(4)] == ["inner", "outer", "slide", "spin"]
    assert Limits.of(model).acceleration.tolist() == [np.inf] * 4


@pytest.fixture(scope="module")
def task() -> TaskSpace:
    """Of a slide that goes from 0 to 0.2 m, between joints that go from -2.6 to 2.6 rad."""
    own = {"slide": {"limits": {"upper": 0.25}}, "outer": {"limits": {"upper": 0.0}}}
    dynamics = Dynamics({"robot": {"urdf": SCARA}, "joints": own})
    return TaskSpace(dynamics, "spin", selection="position")


@pytest.mark.parametrize(
    ("joint", "off", "lower", "upper"), [("slide", -1.0, 0.0, 0.25), ("outer", 1.0, -2.6, 0.0)]
)
def test_joints_of_a_path_may_be_at_their_limits_and_not_beyond(
    task: TaskSpace, joint: str, off: float, lower: float, upper: float
) -> None:
    """A billionth of a radian or metre is rounding; limits at zero, where it is exact."""
    place, unit = task.model.joint_names.index(joint), "m" if joint == "slide" else "rad"
    q = np.array([0.1, -0.1, 0.1, 100.0])
    q[place] = 1e-9 * off
    check_limits(task, q, 0.25)
    q[place] = 1.001e-9 * off
    with pytest.raises(Unreachable) as caught:
        check_limits(task, q, 0.25)
    assert str(caught.value) == (
        f"at 25.0% of the path joint '{joint}' would be at {q[place]:.6g} {unit}; "
        f"allowed: {lower:g} to {upper:g} {unit}"
    )
    assert caught.value.residual == 1.001e-9
