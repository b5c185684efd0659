# SPDX-License-Identifier: Apache-2.0
"""Joints that meet their position limits, against closed forms and plain matrix algebra."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import models
from arm_dynamics import InvalidInput, SceneError
from arm_sim import SimulationDiverged, Simulator
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

G, MASS = 9.81, 2.0
DROP = 0.5


def rail(stop: Any = None, lower: float = 0.0, **joint: Any) -> dict[str, Any]:
    """A mass on a vertical rail that ends at ``lower``; it starts at rest, ``DROP`` above zero."""
    limits = {"lower": lower, "upper": 2.0, **({} if stop is None else {"stop": stop})}
    joints = {"z": {"limits": limits, **joint}}
    return rails("z", MASS) | {"joints": joints, "initial": {"position": {"z": DROP}}}


def planar(stops: dict[str, Any], **scene: Any) -> dict[str, Any]:
    return {"robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")}, "joints": stops} | scene


def test_a_mass_falls_on_a_rigid_stop_and_stays_there() -> None:
    sim = Simulator(rail())
    assert not sim.stop_torque.any()
    run = sim.run(1.0)
    landing = np.sqrt(2 * DROP / G)
    falling = run.time < landing
    assert_close(run.q[falling, 0], DROP - 0.5 * G * run.time[falling] ** 2, CLOSED_FORM)
    assert not run.q[~falling].any()
    assert not run.v[~falling].any()
    assert sim.impacts == 1
    assert_close(run.lost[-1], MASS * G * DROP, CLOSED_FORM)
    assert abs(run.balance).max() < 1e-11
    assert_close(run.stop_torque, ~falling[:, None] * MASS * G, CLOSED_FORM)
    assert_close(sim.stop_torque, [MASS * G], CLOSED_FORM)


@pytest.mark.parametrize(
    ("place", "way", "method"), [(2e-3, -1.0, {}), (2.0 - 2e-3, 1.0, {"tolerance": 1e-10})]
)
def test_a_blow_between_rest_and_rebound_is_accounted_for(
    place: float, way: float, method: dict[str, Any]
) -> None:
    """Within one tick: only the velocity after it, away from the stop, tells of it."""
    e, push = 0.6, 55.0 * MASS
    sim = Simulator(rail({"restitution": e}), dt=0.01, **method)
    sim.reset([place], [0.0])
    run = sim.run(0.01, np.array([[push * way + MASS * G]]))
    assert run.v[-1, 0] * way < 0.0 and sim.impacts == 1
    assert_close(run.lost[-1], push * 2e-3 * (1 - e**2), 1e-11)
    assert abs(run.balance).max() < 1e-11


@pytest.mark.parametrize(
    ("q", "pushed"),
    [([0.1, 1.5, 0.2], 1), ([0.1, 0.3, -1.0], 2), ([3.0, -0.5, 0.9], -1)],
)
def test_every_stop_that_holds_is_reported_and_no_other(q: list[float], pushed: int) -> None:
    """Either end of any joint, or of all of them at once."""
    ends = {"joint1": (-2.0, 3.0), "joint2": (-0.5, 1.5), "joint3": (-1.0, 0.9)}
    limits = {name: {"limits": {"lower": a, "upper": b}} for name, (a, b) in ends.items()}
    sim = Simulator(planar(limits, gravity=[0, 0, 0]))
    lower, upper = np.transpose(list(ends.values()))
    out = np.where(q == lower, -1.0, np.where(q == upper, 1.0, 0.0))
    push = out * [5.0, 4.0, 3.0]
    sim.reset(q)
    sim.step(sim.dynamics.gravity(q) + push)
    assert np.flatnonzero(out).tolist() == ([0, 1, 2] if pushed < 0 else [pushed])
    assert_close(sim.stop_torque, -push, CLOSED_FORM)


def test_a_stop_releases_at_the_lifting_torque_and_not_before() -> None:
    sim = Simulator(rail())
    sim.reset(q=[0.0])
    assert sim.run(0.1, [MASS * G * (1 - 1e-12)]).q[-1, 0] == 0.0
    run = sim.run(0.1, [MASS * G + 1.0])
    assert_close(run.q[-1, 0], 0.5 * (1.0 / MASS) * 0.1**2, CLOSED_FORM)


def test_a_compliant_stop_is_a_spring_and_a_damper_that_never_pull() -> None:
    k, c = 4e3, 20.0
    run = Simulator(rail({"stiffness": k, "damping": c}), dt=1e-3, integrator="dop853").run(1.0)

    def slope(t: float, x: np.ndarray) -> list[float]:
        push = -k * x[0] - c * x[1]
        return [x[1], -G + (max(push, 0.0) if x[0] < 0 else 0.0) / MASS]

    events = [lambda t, x: x[0], lambda t, x: -k * x[0] - c * x[1]]
    t, x, found = 0.0, np.array([DROP, 0.0]), []
    while t < 1.0 - 1e-12:
        for event in events:
            event.terminal = True  # type: ignore[attr-defined]
        piece = solve_ivp(
            slope, (t, 1.0), x, "DOP853", rtol=1e-13, atol=1e-14, events=events, dense_output=True
        )
        inside = (run.time >= t) & (run.time <= piece.t[-1])
        found.append((run.time[inside], piece.sol(run.time[inside])[0]))
        t, x = piece.t[-1] + 1e-13, piece.y[:, -1] + 1e-13 * np.array(slope(0, piece.y[:, -1]))
    time, q = (np.concatenate(part) for part in zip(*found, strict=True))
    assert_close(run.q[np.searchsorted(run.time, time), 0], q, 1e-9)
    assert abs(run.balance).max() < 1e-9


def test_a_blow_at_a_stop_reaches_all_joints_in_the_metric_of_inertia() -> None:
    limits = {"lower": -1.0, "upper": 1.0, "stop": {"restitution": 0.4}}
    sim = Simulator(planar({"joint2": {"limits": limits}}), dt=1e-7)
    v = np.array([0.7, 2.0, -1.3])
    sim.reset(q=[0.3, 1.0, -0.2], v=v)
    column = np.linalg.inv(sim.dynamics.mass_matrix(sim.state.q))[1]
    assert_close(sim.step(np.zeros(3)).v, v - column * 1.4 * v[1] / column[1], 1e-4)
    assert sim.impacts == 1


def test_a_joint_at_rest_at_its_stop_passes_a_blow_on() -> None:
    """Two joints at their stops, one hits: what both stops give is found together."""
    limits = {"limits": {"lower": -1.0, "upper": 1.0}}
    sim = Simulator(planar({"joint2": limits, "joint3": limits}), dt=1e-7)
    v = np.array([0.0, 2.0, 0.0])
    sim.reset(q=[0.3, 1.0, 1.0], v=v)
    M = sim.dynamics.mass_matrix(sim.state.q)
    W, found = np.linalg.inv(M), None
    for held in ([1], [2], [1, 2]):  # the only set that obeys
        impulse = np.linalg.solve(W[np.ix_(held, held)], -v[held])
        after = v + W[:, held] @ impulse
        if (impulse <= 1e-12).all() and (after[1:] <= 1e-12).all():
            found = after
    assert found is not None
    assert_close(sim.step(np.zeros(3)).v, found, 1e-4)


LEADING, FOLLOWING = 1.0, 0.5


def pair(ratio: float, **joints: Any) -> dict[str, Any]:
    """Two masses on horizontal rails, one of which follows the other; both reach 1 m each way."""
    links = '<link name="base"/>'
    mimic = f'<mimic joint="leader" multiplier="{ratio}"/>'
    for name, mass, more in (("leader", LEADING, ""), ("follower", FOLLOWING, mimic)):
        links += f"""<link name="{name}_mass"><inertial><mass value="{mass}"/>
          <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
          <joint name="{name}" type="prismatic"><parent link="base"/><child link="{name}_mass"/>
          <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1e9" velocity="1e9"/>{more}
          </joint>"""
    settings = {name: {"limits": limits} for name, limits in joints.items()}
    return {"robot": {"urdf": f'<robot name="pair">{links}</robot>'}, "joints": settings}


def test_a_followers_soft_stop_acts_on_its_leader_by_the_square_of_the_ratio() -> None:
    """The leader arrives at 1 m/s and oscillates on the spring."""
    ratio, stiffness, damping = -3.0, 900.0, 4.0
    soft = {"stop": {"stiffness": stiffness, "damping": damping}}
    sim = Simulator(pair(ratio, follower=soft), integrator="dop853", tolerance=1e-11)
    sim.reset(q=[1 / abs(ratio)], v=[1.0])
    run = sim.run(0.02)
    mass = LEADING + ratio**2 * FOLLOWING
    fades = 0.5 * ratio**2 * damping / mass
    swings = np.sqrt(ratio**2 * stiffness / mass - fades**2)
    way = np.exp(-fades * run.time) * np.sin(swings * run.time) / swings
    np.testing.assert_allclose(run.q[:, 0], 1 / abs(ratio) + way, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("way", "place", "e"), [(-1.0, -1.0, 0.2), (1.0, 0.4, 0.7)])
def test_each_side_has_the_restitution_of_the_joint_that_stops_there(
    way: float, place: float, e: float
) -> None:
    """On one side that is the leader, on the other one the follower."""
    limits = {
        "leader": {"stop": {"restitution": 0.2}},
        "follower": {"lower": -9.0, "upper": 0.8, "stop": {"restitution": 0.7}},
    }
    sim = Simulator(pair(2.0, **limits))
    sim.reset(q=[place - 0.1 * way], v=[way])
    run = sim.run(0.15)
    assert_close(run.v[[0, -1], 0], [way, -e * way], CLOSED_FORM)


def test_positions_beyond_a_stop_are_refused() -> None:
    sim = Simulator(rail())
    assert sim.reset(q=[2.0 * (1.0 + 0.9e-9)]).q.tolist() == [2.0]  # by rounding
    with pytest.raises(InvalidInput, match="joint 'z' at .* is beyond its stops"):
        sim.reset(q=[2.0 * (1.0 + 1.1e-9)])
    with pytest.raises(InvalidInput, match="arm 1: joint 'z'"):
        sim.rollout([[0.1], [2.5]], [[0.0], [0.0]], [0.0], 3)
    with pytest.raises(SceneError, match=r"initial.position.*beyond its stops"):
        Simulator(rail() | {"initial": {"position": {"z": 2.1}}})
    zero = rail(lower=0.2) | {"initial": {}}  # a start that nobody asked for is at the nearer stop
    assert Simulator(zero).state.q.tolist() == [0.2]


def test_a_locked_joint_is_not_put_beyond_its_limits() -> None:
    robot = {"urdf": str(models.FOLDER / "gantry.urdf"), "lock": ["x"]}
    with pytest.raises(SceneError, match="locked joint 'x' at -10000 is beyond its limits"):
        Simulator({"robot": robot, "initial": {"position": {"x": -1e4}}})


def test_without_a_compiler_a_scene_runs_until_a_stop_is_met() -> None:
    sim = Simulator(rail(), backend="vm")
    assert_close(sim.run(0.3).q[-1], [DROP - 0.5 * G * 0.09], CLOSED_FORM)
    with pytest.raises(SimulationDiverged, match="a joint reaches its stop"):
        sim.run(0.1)
    assert 0.0 < sim.state.q[0] < 0.02


def test_accumulating_impacts_are_time_stepped_and_reported() -> None:
    """A million blows a tick, between stops a millimetre apart."""
    scene = rail({"restitution": 1.0}, lower=0.4995)
    scene["joints"]["z"]["limits"]["upper"] = 0.5005
    sim = Simulator(scene)
    sim.reset(q=[0.5], v=[1e6])
    run = sim.run(0.02)
    assert run.time_stepped[-1] == sim.state.time_stepped > 0
    assert (np.diff(run.time_stepped) >= 0).all()
    assert run.q.min() >= 0.4995
    assert run.q.max() <= 0.5005
    assert (np.diff(run.energy) <= 1e-6).all()
    assert sim.reset().time_stepped == 0
    assert sim.run(0.1).time_stepped[-1] == 0


def test_no_time_stepped_tick_ends_beyond_a_stop_or_inside_a_slope() -> None:
    """Elastic blows without end, in the wedge of a stop and a slope that leads into the stop."""
    slope = {"normal": [0.8, 0.0, 0.6]}
    scene = rails("xz", 1.5) | {"constraints": [contact("body", restitution=1.0, plane=slope)]}
    limits = {"lower": -1.0, "upper": 1.0, "stop": {"restitution": 1.0}}
    sim = Simulator(scene | {"joints": {"x": {"limits": limits}}}, dt=5.0)
    for q, v in (((-0.7, 2.1), (181, 222)), ((-0.9, 2.1), (1063, 24)), ((0.9, 1.9), (-140, 293))):
        sim.reset(q, v)
        state = sim.step([0.0, 0.0])
        assert state.time_stepped == 1
        assert abs(state.q[0]) <= 1.0
        assert 0.8 * state.q[0] + 0.6 * state.q[1] > -1e-12


def test_what_flies_from_stop_to_stop_by_an_unstable_method_has_diverged() -> None:
    """Friction stops the mass in 2 µs, the tick has 10 ms: its speed grows; it is not at rest."""
    scene = rail({"restitution": 1.0}, friction={"viscous": 1e6})
    sim = Simulator(scene, integrator="rk4", dt=1e-2)
    sim.reset(v=[1.0])
    with pytest.raises(SimulationDiverged, match="cannot be computed"):
        sim.run(0.1)
    assert 0.0 < sim.state.q[0] < 2.0 and sim.state.v[0] != 0.0
