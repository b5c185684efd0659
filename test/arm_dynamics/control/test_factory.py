# SPDX-License-Identifier: Apache-2.0
"""Controllers by name: all follow the same kind of reference and can replace one another."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.control import NAMES, Measured, Saturated, Settings, Switch, make_controller
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Reference, Waypoint, quintic
from tolerances import ALGEBRA, assert_close

PLANAR = Settings(frame="tip", axes="x z", observer=30.0)


def test_torques_are_clipped_at_the_limits_on_request_and_by_an_observer() -> None:
    dyn, limit = models.dynamics("two_link"), np.array([3.0, 0.5])
    state, reference = Measured(np.full(2, 0.3), np.zeros(2)), Reference(*np.zeros((3, 2)))
    free, cut, observed = (
        make_controller("computed_torque", dyn, Settings(limit=limit, **more))
        for more in ({}, {"saturate": True}, {"observer": 20.0})
    )
    torque = free.torque(state, reference)
    assert (abs(torque) > limit).any()
    for control in (cut, observed):
        clipped = np.clip(torque, -limit, limit)
        np.testing.assert_array_equal(control.torque(state, reference), clipped)
    assert isinstance(cut, Saturated)
    np.testing.assert_array_equal(cut.saturated, abs(torque) > limit)


RUBBED = {"viscous": 0.5, "coulomb": 2.0}  # [N m s/rad], [N m]


@pytest.mark.parametrize("name", NAMES)
def test_friction_of_the_reference_is_fed_forward_once(name: str) -> None:
    """Without error each controller gives its feed-forward torque, including friction."""
    given = models.scene("two_link").model_dump(exclude_none=True)
    dyn = Dynamics(given | {"joints": {"*": {"friction": RUBBED}}})
    q, v = np.array([0.3, 0.8]), np.array([1.0, -2.0])
    task = TaskSpace(dyn, "tip", selection=("x", "z"))
    # motion_force accelerates nothing along z
    a = np.linalg.solve(task.jacobian(q), [5.0, 0.0] - task.bias(q, v))
    settings = Settings(1e-9, damping_ratio=0.0, frame="tip", axes=("x", "z"), friction=True)
    tau = make_controller(name, dyn, settings).torque(Measured(q, v), Reference(q, v, a))
    weight, nothing = dyn.gravity(q), np.zeros(2)
    known = {"pd": nothing, "pid": nothing, "pd_gravity": weight, "float": weight}
    rigid = known.get(name, dyn.inverse(q, v, a, terms=7))
    friction = nothing if name == "float" else [0.5 + 2.0, -1.0 - 2.0]
    assert_close(tau, rigid + friction, 1e-8)


def test_other_gains_act_at_once_unless_the_law_remembers() -> None:
    dyn = models.dynamics("two_link")
    state, reference = Measured(np.full(2, 0.3), np.zeros(2)), Reference(*np.zeros((3, 2)))
    soft, stiff = Settings(bandwidth=5.0), Settings(bandwidth=9.0)
    for name, at_once in (("pd_gravity", True), ("pid", False)):
        control = Switch(make_controller(name, dyn, soft), dt=1e-3)
        before = control.torque(state, reference)
        control.retune(make_controller(name, dyn, stiff))
        assert control.fading != at_once
        assert np.array_equal(control.torque(state, reference), before) != at_once


def test_bad_choices_are_refused() -> None:
    dyn = models.dynamics("two_link")
    with pytest.raises(InvalidInput, match="controller = 'magic'; allowed: pd, pid"):
        make_controller("magic", dyn)
    with pytest.raises(InvalidInput, match="frame .* is not given"):
        make_controller("operational_space", dyn)
    with pytest.raises(InvalidInput, match="frame 'paw' does not exist"):
        make_controller("motion_force", dyn, Settings(frame="paw"))


WIDE = {  # scenes whose start is an unlucky place to take inertia at, and robots of every kind
    "kinova": ("j2s6s200_end_effector", "pose", [0.2, 2.6, 1.4, 0.4, 1.2, 0.3]),
    "ur10": ("tool0", "pose", [0.3, -1.2, 1.5, -1.0, -1.2, 0.4]),
    "scara": ("spindle", ("x", "y", "z", "rz"), [0.3, 0.5, 0.1, 0.2]),
    "two_arms": ("right_rod", ("x", "y", "z"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
    "gripper": ("right_jaw", ("y", "z"), [0.1, 0.02]),
}


LED = [name for name in NAMES if name not in ("pd", "pid", "float")]


@pytest.mark.parametrize(("name", "robot_name"), covering(LED, WIDE))
def test_made_by_name_they_hold_any_arm(name: str, robot_name: str) -> None:
    """Led by 0.1 in half a second and left alone: laws that know the weight.

    Under constant gains a light joint of ``two_arms`` swings out for two seconds more.
    """
    frame, axes, q = WIDE[robot_name]
    sim = models.simulator(robot_name, stops=False, dt=1e-3)
    sim.reset(np.array(q), np.zeros(len(q)))
    direction = (0.0, 0.0, -1.0) if "z" in axes or axes == "pose" else (1.0, 0.0, 0.0)
    settings = Settings(frame=frame, axes=axes, bandwidth=15.0, direction=direction)
    control = make_controller(name, sim.dynamics, settings)
    way = quintic([Waypoint(0.0, q), Waypoint(0.5, np.array(q) + 0.1)])
    seconds = 3.0 if name == "pd_gravity" else 1.0
    done = sim.run(seconds, lambda s: control.torque(s, way.sample(s.time)))
    assert np.isfinite(done.tau).all()
    task = TaskSpace(sim.dynamics, frame, selection=axes)
    error = task.pose(done.q[-1]).position - task.pose(np.array(q) + 0.1).position
    if name != "motion_force":  # along its direction it only brakes
        assert abs(error).max() < 5e-3
    assert abs(done.v[-1]).max() < 0.5


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bandwidth": 1e308}, "bandwidth = 1e.308; allowed: 0 to 432 between nodes"),
        ({"stiffness": [50.0, -1.0]}, r"stiffness = \[50.0, -1.0\]; allowed: 0 to 1e.06"),
        ({"damping_ratio": [1, 101]}, r"damping_ratio = \[1, 101\]; allowed: 0 to 100"),
        ({"observer": np.inf}, "observer is inf"),
        ({"force": -2e4}, "force = "),
        ({"direction": (0, 0, 0)}, "force_direction = "),
        ({"axes": "x q"}, "task_axes: selection = 'x q'"),
        ({"dt": 0.0}, "control_period is 0.0"),
    ],
)
def test_settings_are_checked_whatever_controller_reads_them(
    given: dict[str, Any], said: str
) -> None:
    with pytest.raises(InvalidInput, match=said):
        Settings(**given)


def test_a_joint_without_stiffness_is_soft_where_another_has_one() -> None:
    """Only where all are zero do they follow from the bandwidth."""
    dyn = models.dynamics("two_link")
    still = Reference(np.array([0.3, 0.2]), np.zeros(2), np.zeros(2))
    about = {"damping": [1.0, 1.0]}
    soft = make_controller("joint_impedance", dyn, Settings(stiffness=[0.0, 50.0], **about))
    q = still.q + [0.1, 0.1]
    asked = soft.torque(Measured(q, np.zeros(2)), still) - dyn.gravity(q)
    assert_close(asked, [0.0, -5.0], 1e-9)


@pytest.mark.parametrize("name", ["operational_space", "motion_force", "cartesian_impedance"])
def test_gains_in_task_space_are_bounded_by_the_control_rate(name: str) -> None:
    about = {"frame": "tip", "axes": "x y", "direction": (1, 0, 0), "dt": 0.002}
    make_controller(name, models.dynamics("two_link"), Settings(bandwidth=370.0, **about))
    for gains in {"bandwidth": [20.0, 380.0]}, {"bandwidth": 100.0, "damping_ratio": 4.0}:
        with pytest.raises(InvalidInput, match="at 500 states per second .* at most 375 rad/s"):
            make_controller(name, models.dynamics("two_link"), Settings(**gains, **about))


@pytest.mark.parametrize("name", NAMES)
def test_torques_of_the_reference_are_added_before_limits(
    name: str, rng: np.random.Generator
) -> None:
    dynamics = models.dynamics("two_link")
    q, v, a = models.random_state(rng, 2)
    state, added = Measured(q, 0.1 * v), rng.normal(size=2)
    bounded = replace(PLANAR, saturate=True, limit=30.0)
    plain, more, cut = (
        make_controller(name, dynamics, chosen).torque(state, Reference(q, v, a, tau))
        for tau, chosen in ((None, PLANAR), (added, PLANAR), (added, bounded))
    )
    assert_close(more, plain + added, ALGEBRA)
    assert np.all(abs(cut) <= 30.0)
    with pytest.raises(InvalidInput, match=r"reference\.tau"):
        make_controller(name, dynamics, PLANAR).torque(state, Reference(q, v, a, np.ones(3)))
