# SPDX-License-Identifier: Apache-2.0
"""Arms commanded by positions and velocities, in every kind of scene, and their rest, which is
where the torques balance, whatever the tick, and exactly.
"""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput, load_scene
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim import JointCommand, Simulator
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import FREE, SERVOS
from arm_sim.servo.law import servo_law
from models.rotor import rotor

QUICK = 100.0
"""Default bandwidth in [rad/s]."""


def led(sim: Simulator, seconds: float, **command: Any) -> np.ndarray:
    """Positions of a run under a command, shape (k, n)."""
    return np.asarray(sim.run(seconds, JointCommand(**command)).q)


def test_follows_positions_at_half_the_speed_limits() -> None:
    """By the velocity of the stream: without, a critically damped servo lags behind by 2 v/ω."""
    sim = models.simulator("panda")
    away = np.array([0.8, -0.5, 0.6, -0.4, 0.9, 0.7, -0.8])
    duration = np.max(1.875 * abs(away) / (0.5 * sim.model.velocity_limit))
    s = np.arange(0.0, 1.0, sim.dt / duration)[:, None]
    wanted = sim.state.q + away * (10 * s**3 - 15 * s**4 + 6 * s**5)
    error = led(sim, len(wanted) * sim.dt, position=wanted)[:-1] - wanted
    assert np.sqrt((error**2).mean(axis=0)).max() < 1e-3
    sim.reset()
    slow = led(sim, len(wanted) * sim.dt, position=wanted, velocity=0.0 * wanted)[:-1]
    speed, middle = np.gradient(wanted, sim.dt, axis=0), len(wanted) // 2
    behind = (wanted - slow)[middle]
    np.testing.assert_allclose(behind, 2.0 * speed[middle] / QUICK, rtol=0.1, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "droop"),
    [
        ("slider_crank_motor", 5e-5), ("flexible_arm", 2e-4), ("spring_balanced_arm", 0.0),
        ("panda_table", 0.0),
        pytest.param("panda_lugre_table", 1e-6, marks=pytest.mark.nightly),
    ],
)  # fmt: skip
def test_holds_without_droop_and_then_stands_to_the_bit(name: str, droop: float) -> None:
    """Motors, springs, loops, dry and LuGre friction, contact; flexible drives twist at first."""
    sim = models.simulator(name)
    place = sim.state.q.copy()
    held = led(sim, 1.0, position=place)
    assert abs(held[-1] - place).max() <= droop
    np.testing.assert_array_equal(led(sim, 0.2, position=place)[-1], sim.state.q)
    still = sim.state.q.copy()
    assert (led(sim, 0.2, position=place) == still).all()


def test_a_small_step_decays_as_the_bandwidth_says() -> None:
    """e = e₀ (1 + ω t) exp(-ω t), the critically damped equation, at every tick."""
    omega = 30.0
    sim = Simulator(scene("two_link", servo={"bandwidth": omega}))
    place = sim.state.q.copy()
    error = (led(sim, 0.3, position=place + 1e-3) - place - 1e-3) / -1e-3
    t = np.arange(len(error))[:, None] * sim.dt
    np.testing.assert_allclose(
        error, np.broadcast_to((1 + omega * t) * np.exp(-omega * t), error.shape), atol=2e-3
    )


def scene(name: str, tunable: tuple[str, ...] = (), **joint: Any) -> Any:
    """One of the robots with something said of all joints."""
    own = models.scene(name)
    data = own.model_dump(exclude_unset=True, exclude_none=True)
    joints = data.setdefault("joints", {})
    for each in ("*", *joints):
        joints[each] = {**joints.get(each, {}), **joint}
    return load_scene({**data, "tunable": tunable})


def test_stiffness_in_newton_metres() -> None:
    """Under an external torque, a joint is displaced by torque over stiffness."""
    sim = Simulator(scene("two_link", ("external",), servo={"stiffness": 400.0}))
    place, push = sim.state.q.copy(), np.array([2.0, -1.0])
    sim.set_parameter("external", push)
    given = led(sim, 3.0, position=place)[-1] - place
    np.testing.assert_allclose(given, push / 400.0, rtol=1e-6)


def wheel(damping: float) -> dict[str, Any]:
    """Of 1e-3 kg m²: under a torque that is held for 1 ms it bears 2 N m s/rad at most."""
    scene = rotor(1e-3)
    scene["joints"]["axle"]["servo"] = {"stiffness": 100.0, "damping": damping}
    return scene


def boom(least: float) -> dict[str, Any]:
    """A point mass of 1 kg, 1 m out on a turning rail, on which it may come in to ``least``.

    From 0.1 kg m² on the servo grows.
    """
    urdf = f"""<robot name="boom"><link name="base"/><link name="rail"/><link name="end">
      <inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>
      </inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="rail"/>
      <axis xyz="0 0 1"/></joint><joint name="reach" type="prismatic"><parent link="rail"/>
      <child link="end"/><axis xyz="1 0 0"/>
      <limit lower="{least}" upper="1" effort="99" velocity="9"/></joint></robot>"""
    return {
        "robot": {"urdf": urdf},
        "joints": {"turn": {"servo": {"stiffness": 1e3, "damping": 200.0}}},
        "initial": {"position": {"reach": 1.0}},
    }


def springy(damping: float) -> dict[str, Any]:
    """Behind transmissions, where servos move rotors alone: 0.1 kg m² bears 200 N m s/rad."""
    joint = {
        "servo": {"stiffness": 100.0, "damping": damping},
        "actuator": {"rotor_inertia": 0.1},
        "transmission": {"stiffness": 100.0, "damping": 0.1},
    }
    return models.scene("two_link").model_dump(exclude_unset=True) | {"joints": {"*": joint}}


@pytest.mark.parametrize(("scene", "stable"), [
    (wheel(1.5), True), (wheel(2.1), False), (boom(0.9), True), (boom(0.1), False),
    (springy(195.0), True), (springy(205.0), False),
])  # fmt: skip
def test_a_stiff_servo_that_grows_from_tick_to_tick_in_any_posture_is_told(
    scene: dict[str, Any], stable: bool, caplog: pytest.LogCaptureFixture
) -> None:
    sim = Simulator(scene, dt=1e-3)
    told = "is unstable at dt = 0.001 s, for which its torque is held"
    assert (told not in caplog.text) == stable
    if sim.n == 1:
        place = led(sim, 0.5, position=np.array([0.01]))[-1]
        assert (abs(place - 0.01) < 1e-3) == stable
    caplog.clear()
    Simulator(scene, dt=1e-4)
    assert not caplog.records


def test_a_far_place_is_reached_within_the_limits_of_speed_and_effort() -> None:
    """All joints accelerate less where one drive could not follow, so none is thrown about."""
    sim = models.simulator("panda")
    place = sim.state.q + 0.5
    recording = sim.run(1.0, JointCommand(position=place))
    assert (abs(recording.v) < 1.02 * sim.model.velocity_limit).all()
    assert (abs(recording.tau) <= sim.model.effort_limit).all()
    assert (recording.q - place).max() < 0.03
    np.testing.assert_allclose(recording.q[-1], place, atol=1e-9)


MOTOR = {"resistance": 2.0, "torque_constant": 0.05, "gear_ratio": 50, "voltage_limit": 8.0}
WEAK: dict[str, Any] = {
    "effort": {"joints": {"elbow": {"limits": {"effort": 8.0}}}},
    "voltage at rest": {"joints": {"elbow": {"actuator": MOTOR}}},
    "effort beside the weight": {
        "joints": {"elbow": {"limits": {"effort": 12.0}}},
        "commands": {"gravity_compensated": True},
    },
}


@pytest.mark.parametrize(
    ("weak", "way"), [*zip(WEAK.values(), (1.0, -1.0, 1.0), strict=True)], ids=str
)
def test_a_weak_drive_is_used_up_and_slows_all_joints_alike(
    weak: dict[str, Any], way: float
) -> None:
    """Towards a far place, both joints by their largest speeds: 6 and 8 rad/s."""
    scene = models.scene("two_link").model_dump(exclude_unset=True) | weak
    dyn, q, still = Dynamics(scene), np.array([0.3, 0.4]), np.zeros(2)
    plant = Plant(dyn.model)
    far = np.concatenate([np.ones(4), q + way * np.array([0.25, 0.5]), np.zeros(4)])
    state = np.concatenate([q, still])
    law = one_at_a_time(servo_law)(plant, 1e-3)
    tau = np.array(law(state, far, plant.parameters.nominal)).ravel()
    if "commands" in weak:
        tau += dyn.gravity(q)
    np.testing.assert_allclose(tau[1], way * dyn.model.effort_limit[1], rtol=1e-8)
    quickening = dyn.forward(q, still, tau)
    assert (way * quickening > 10.0).all()
    np.testing.assert_allclose(quickening[0] / quickening[1], 6 / 8, rtol=2e-3)


def test_effort_alone_is_the_torque_to_the_bit(rng: np.random.Generator) -> None:
    sim, tau = models.simulator("panda"), rng.normal(size=(200, 7))
    plain = sim.run(0.2, tau)
    sim.reset()
    command = sim.run(0.2, JointCommand(effort=tau))
    np.testing.assert_array_equal(command.q, plain.q)
    np.testing.assert_array_equal(command.tau, plain.tau)


def test_each_joint_may_be_commanded_otherwise() -> None:
    sim, nan = models.simulator("panda"), np.nan
    place = sim.state.q.copy()
    command = JointCommand(
        position=[*place[:5], nan, nan],
        velocity=[nan] * 5 + [0.2, nan],
        effort=[1.0] + [nan] * 5 + [0.05],
    )
    recording = sim.run(0.3, command)
    np.testing.assert_array_equal(recording.tau[:, 6], 0.05)
    assert abs(recording.v[-1, 5] - 0.2) < 1e-3
    np.testing.assert_allclose(recording.q[-1, 1:5], place[1:5], atol=1e-3)
    alone = models.dynamics("panda").gravity(place)[0]
    assert abs(recording.tau[-1, 0] - alone) < 1.0  # the servo works against what was added
    assert recording.q[-1, 0] != place[0]


def test_a_payload_that_is_changed_is_carried() -> None:
    load = {"frame": "panda_hand", "mass": 0.0}
    data = models.scene("panda").model_dump(exclude_unset=True, exclude_none=True)
    sim = Simulator({**data, "payloads": [load], "tunable": ["payload"]})
    place = sim.state.q.copy()
    sim.set_parameter("payload", [3.0, 0, 0, 0.1] + [0.0] * 6)
    assert abs(led(sim, 0.5, position=place)[-1] - place).max() == 0.0


def test_brakes_leave_places_and_bristles_and_take_speeds_and_currents() -> None:
    """Of a wheel on a soft shaft behind a motor with inductance and friction of bristles."""
    law = {"coulomb": 0.1, "lugre": {"sigma0": 100.0, "sigma1": 1.0}}
    scene = rotor(1.0, **law)  # type: ignore[arg-type]
    scene["joints"]["axle"] |= {
        "actuator": {"command": "voltage", "resistance": 1.0, "inductance": 0.01,
                     "torque_constant": 1.0, "rotor_inertia": 0.1},
        "transmission": {"stiffness": 100.0, "damping": 1.0},
    }  # fmt: skip
    sim = Simulator(scene)
    led(sim, 0.05, position=np.array([0.1]))
    moving = sim.state.z.copy()
    assert moving.all()
    sim.arm.lock()
    current, position, velocity, bristle = 0.0, 1.0, 0.0, 1.0  # what brakes leave of each
    left = np.array([current, position, velocity, bristle])
    np.testing.assert_array_equal(sim.state.z, left * moving)


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        ({}, "nothing is commanded"),
        ({"position": [1.0], "velocity": [1.0, 2.0]}, "one shape is expected"),
        ({"position": [np.inf, 0.0]}, "numbers, or NaN for none, are expected"),
        ({"position": np.zeros((7, 2))}, "commands of shape"),
    ],
)
def test_invalid_commands_are_refused(command: dict[str, Any], complaint: str) -> None:
    sim = models.simulator("two_link")
    with pytest.raises(InvalidInput, match=complaint):
        sim.run(0.01, JointCommand(**command))
    with pytest.raises(InvalidInput, match=complaint):
        sim.step(JointCommand(**command))


@pytest.mark.parametrize("way", [
    lambda sim, command: sim.run(0.01, command),
    lambda sim, command: sim.run(0.01, lambda _: JointCommand(command.position)),
    lambda sim, command: [sim.step(command) for _ in range(10)],
])  # fmt: skip
def test_positions_beyond_the_stops_are_clipped_and_told_once(
    way: Any, caplog: pytest.LogCaptureFixture
) -> None:
    sim, clipped = models.simulator("panda"), models.simulator("panda")
    asked = sim.state.q.copy()
    way(sim, JointCommand(asked))
    assert not caplog.text
    sim.reset()
    asked[3] = 45.0  # degrees
    way(sim, JointCommand(asked))
    (said,) = caplog.messages
    assert "position 45 rad of joint 'panda_joint4' is beyond its stops and is clipped" in said
    way(clipped, JointCommand(np.clip(asked, *clipped.model.stops.place)))
    np.testing.assert_array_equal(sim.state.q, clipped.state.q)


def test_an_arm_in_a_soft_stop_may_be_held_there(caplog: pytest.LogCaptureFixture) -> None:
    soft = {"lower": -2.5, "upper": 2.5, "stop": {"stiffness": 100.0, "damping": 1.0}}
    sim = Simulator(scene("two_link", limits=soft))
    sim.set_state([2.6, 0.0])
    led(sim, 1.0, position=sim.state.q)
    assert not caplog.text
    assert sim.state.q[0] > 2.59


K, T = 1.0, 4.0


def soft(**friction: Any) -> dict[str, Any]:
    """A wheel of 1 kg m² without weight, critically damped on a servo of 1 N m/rad."""
    scene = rotor(1.0, **friction)
    scene["joints"]["axle"]["servo"] = {"stiffness": K}
    return {**scene, "gravity": [0, 0, 0], "tunable": ["external"]}


def approach(t: float) -> float:
    """Share of a critically damped motion that is done after t."""
    return 1.0 - float(np.exp(-t) * (1.0 + t))


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_small_pushes_and_errors_move_a_soft_servo_to_its_balance(dt: float) -> None:
    """By 30 nanoradians: in a tick it gains 3e-11 rad/s, or 3e-10."""
    sim = Simulator(soft(), dt=dt)
    sim.reset([2e-8])
    sim.run(T, JointCommand(position=[0.0]))
    assert sim.state.q[0] == pytest.approx(2e-8 * (1.0 - approach(T)), abs=2e-10)
    sim.reset()
    sim.set_parameter("external", [3e-8])
    sim.run(T, JointCommand(position=[0.0]))
    assert sim.state.q[0] == pytest.approx(3e-8 / K * approach(T), rel=0.01)


def test_a_push_that_static_friction_bears_moves_nothing() -> None:
    sim = Simulator(soft(coulomb=1e-3), dt=1e-3)
    sim.set_parameter("external", [9e-4])
    run = sim.run(1.0, JointCommand(position=[0.0]))
    assert not run.q.any()


def test_at_rest_it_stays_to_the_bit_until_it_is_pushed() -> None:
    sim = Simulator(soft(), dt=1e-2)
    sim.reset([0.1])
    run = sim.run(40.0, JointCommand(position=[0.1 + 1e-12]))
    assert (run.q[-500:] == run.q[-1]).all() and not run.v[-500:].any()
    assert abs(run.q[-1, 0] - 0.1 - 1e-12) < 1e-13
    assert run.hold is not None and run.hold[0] == FREE and (run.hold[-500:-1] == SERVOS).all()
    sim.set_parameter("external", [1e-9])
    assert sim.run(T, JointCommand(position=[0.1 + 1e-12])).q[-1, 0] - 0.1 > 0.9e-9 * approach(T)


@pytest.mark.parametrize("go_on", [
    lambda sim: sim.run(0.01, [0.0]),
    lambda sim: sim.step([0.0]),
    lambda sim: sim.reset([0.0]),
])  # fmt: skip
def test_what_servos_hold_is_free_once_they_do_not(go_on: Any) -> None:
    sim = Simulator(soft(), dt=1e-3)
    sim.run(0.01, JointCommand(position=[0.0]))
    assert sim.arm.hold == SERVOS
    go_on(sim)
    assert sim.arm.hold == FREE


@pytest.mark.parametrize("placed", ["set_state", "reset"])
def test_what_was_commanded_before_an_arm_was_placed_is_no_stream(placed: str) -> None:
    """The place after it has no velocity, as the first one of all."""
    sims = [Simulator(soft(), dt=1e-3) for _ in range(2)]
    for k in (1, 2):
        sims[0].step(JointCommand(position=[1e-3 * k], stamp=1_000_000 * k))
    for sim in sims:
        getattr(sim, placed)(q=[3e-3], v=[0.0])
        sim.step(JointCommand(position=[3e-3], stamp=3_000_000))
    assert sims[0].state.v[0] == sims[1].state.v[0] == 0.0


def test_a_joint_that_no_servo_holds_moves_on() -> None:
    """Slower than anything that counts as rest, beside a joint that rests."""
    urdf = """<robot name="two"><link name="base"/>{}</robot>""".format("".join(
        f"""<link name="l{i}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1"
        iyz="0" izz="1"/></inertial></link><joint name="j{i}" type="continuous">
        <parent link="base"/><child link="l{i}"/><axis xyz="0 0 1"/></joint>""" for i in range(2)
    ))  # fmt: skip
    sim = Simulator({"robot": {"urdf": urdf}, "gravity": [0, 0, 0]}, dt=1e-3)
    sim.reset(v=[0.0, 5e-11])
    sim.run(1.0, JointCommand(position=[0.0, np.nan], effort=[np.nan, 0.0]))
    assert sim.state.q.tolist() == [0.0, pytest.approx(5e-11)]


@pytest.mark.parametrize("transmission", [None, {"stiffness": 200.0, "damping": 1.0}])
def test_behind_motors_too(transmission: dict[str, float] | None) -> None:
    """Under a weight: motors by voltage or on a soft shaft come to rest, and stay to the bit."""
    motor = {"command": "voltage", "resistance": 1.0, "inductance": 0.01, "torque_constant": 1.0,
             "rotor_inertia": 0.1}  # fmt: skip
    scene = rotor(0.5)
    scene["robot"]["urdf"] = scene["robot"]["urdf"].replace("0 0 1", "0 1 0").replace(
        "<mass", '<origin xyz="0.2 0 0"/><mass'
    )  # fmt: skip
    scene["joints"]["axle"] |= {"actuator": motor} | (
        {"transmission": transmission} if transmission else {}
    )
    sim = Simulator(scene)
    run = sim.run(7.0, JointCommand(position=[0.3]))
    assert abs(run.q[-1, 0] - 0.3) < 1e-3
    assert (run.q[-500:] == run.q[-1]).all()
