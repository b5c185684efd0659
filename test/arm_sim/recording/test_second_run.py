# SPDX-License-Identifier: Apache-2.0
"""The error of a motion, from a second run by other means, against closed forms and finer runs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.arrays import read_only
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import Recording, Simulator, State
from arm_sim.plant.actuation import computed_torque
from arm_sim.recording.second_run import CLOSED, WHOLE, WINDOWS
from models.rotor import rotor
from tolerances import assert_close

SCENE = rotor(0.1, coulomb=1.0)
MAGNIFYING = {"robot": models.scene("double_pendulum").robot.model_dump(), "joints": {}}


def run(scene: Any = SCENE, duration: float = 0.4, **how: Any) -> Recording:
    sim = Simulator(scene, **how)
    sim.reset(v=np.full(sim.n, 2.0))
    return sim.run(duration, np.full(sim.n, 0.3))


def test_a_right_motion_is_trusted() -> None:
    motion = run()
    stops = 0.2 / 0.7  # against 1 N m of friction, with 0.3 N m
    assert motion.trusted and motion.doubt == "" and motion.second_run.how == WHOLE
    assert_close(motion.q[-1], [2.0 * stops / 2], 1e-12)
    assert motion.error.shape == (401, 2) and motion.error.max() < 1e-9
    assert motion.verdict.startswith("accurate to ") and motion.verdict in repr(motion)
    held = Simulator(SCENE).run(0.2, [1.0 - 1e-9])
    assert held.verdict.startswith("accurate to rounding, by a second run ")
    assert not held.v.any()


@pytest.mark.parametrize("coulomb", [0.5, 0.0], ids=["stops", "smooth"])
def test_the_error_is_that_against_a_finer_run(coulomb: float) -> None:
    """Of a wheel that friction stops, or only slows, by Heun; to two digits, at every time."""
    scene = rotor(0.1, viscous=2.0, coulomb=coulomb)
    motion = run(scene, 0.2, integrator="heun", dt=2e-3)
    finer = run(scene, 0.2, dt=2e-3, tolerance=1e-12)
    truth = abs(np.hstack([motion.q - finer.q, motion.v - finer.v]))
    assert truth.max() > 1e-6 and not motion.trusted
    assert_close(motion.error / truth.max(axis=0), truth / truth.max(axis=0), 1e-2)
    assert "it adds up over the run" in motion.doubt


def test_a_tick_that_ends_elsewhere_is_named(caplog: pytest.LogCaptureFixture) -> None:
    motion = run()
    q = motion.q.copy()
    q[101:] += 1e-5
    wrong = replace(motion, q=read_only(q))
    assert not wrong.trusted and not wrong.trusted
    assert caplog.text.count("'axle' at 0.101 s") == 1
    assert "most of it arises in this time step" in wrong.doubt and wrong.verdict == wrong.doubt


def test_a_blow_in_one_step_is_noticed() -> None:
    """A mass of 1 kg leaves an undamped stop half a period later, which is less than a tick."""
    stop = {"limits": {"lower": -1.0, "upper": 0.5, "stop": {"stiffness": 1e6}}}
    sim = Simulator(rotor(1.0) | {"joints": {"axle": stop}}, integrator="rk4", dt=1e-2)
    sim.reset(q=[0.4], v=[2.0])
    assert not sim.run(0.2).trusted
    rebound = {"limits": {"lower": -1.0, "upper": 0.5, "stop": {"restitution": 0.5}}}
    sim = Simulator(rotor(1.0) | {"joints": {"axle": rebound}})
    sim.reset(q=[0.4], v=[1.0])
    assert sim.run(0.2).trusted  # though both runs meet the stop at the end of a tick


def test_a_controlled_instability_is_no_doubt() -> None:
    """Falling friction pushes a slow joint off by e every 1.5 ms, unless a controller holds it.

    The controller answers to the state a tick ago: it cannot be called again, and the torques
    alone would not do it, so that the motion is repeated in windows.
    """
    sim = Simulator(rotor(0.02, coulomb=1.0, static=2.0, stribeck_velocity=0.05))
    sim.reset([0.0], [0.021])
    speeds = [0.021]

    def control(state: State) -> list[float]:
        speeds.append(float(state.v[0]))
        return [1.852 + 40.0 * (0.02 - speeds[-2])]

    motion = sim.run(0.3, control)
    assert motion.second_run.how == WINDOWS and motion.trusted
    assert motion.second_run.carried[-1].max() > 0.0
    late = motion.v.copy()
    late[150:] += 1e-5
    assert not replace(motion, v=read_only(late)).trusted


@pytest.mark.parametrize(
    ("control", "how"), [(None, WHOLE), (lambda state: -1e-4 * state.v, CLOSED)]
)
def test_a_motion_that_magnifies_errors_is_told_as_that(control: Any, how: str) -> None:
    """A chaotic arm, also with a weak damper, which is called again: windows would be right."""
    sim = Simulator(MAGNIFYING)
    sim.reset(q=[3.0, 3.0], v=[0.0, 1.0])
    motion = sim.run(30.0, control)
    assert motion.second_run.how == how
    assert not motion.trusted and "magnifies errors" in motion.doubt
    beyond = (motion.error[:, :2] > 1e-4).any(axis=1)
    assert beyond[-1] and not beyond[:2000].any()


def test_a_compiled_controller_is_evaluated_again() -> None:
    sim = models.simulator("two_link", integrator="midpoint", dt=5e-3)
    way = quintic([Waypoint(0.0, sim.state.q), Waypoint(0.5, sim.state.q + [1.0, -1.0])])
    motion = sim.run(0.5, computed_torque(sim.model, way.sample, dt=5e-3))
    sim = models.simulator("two_link", dt=5e-3, tolerance=1e-12)
    finer = sim.run(0.5, computed_torque(sim.model, way.sample, dt=5e-3))
    assert finer.second_run.how == CLOSED and finer.trusted
    truth = abs(motion.q - finer.q)
    assert_close(motion.error[:, :2] / truth.max(), truth / truth.max(), 1e-2)


def test_changes_in_a_run_start_the_error_anew() -> None:
    """Each is the same in the second run; a function that makes them is not called again."""
    scene = models.scene("two_link").model_dump(exclude_unset=True) | {"tunable": ["friction"]}
    sim, calls = Simulator(scene), list[float]()

    def control(state: State) -> list[float]:
        calls.append(state.time)
        if state.step == 50:
            sim.set_parameter("friction", [2.0, 1.0])
        if state.step == 100:
            sim.set_state(q=[0.3, 0.2], v=[1.0, 0.0])
        return [0.5, 0.1]

    motion = sim.run(0.2, control)
    assert motion.trusted and motion.error[-1].max() < 1e-8
    assert motion.second_run.how == WINDOWS and len(calls) == 200
    p = motion.p.copy()
    p[60:] *= 1.01
    assert not replace(motion, p=read_only(p)).trusted


def test_the_scene_says_how_accurate_a_motion_is_to_be() -> None:
    scene = rotor(0.1, viscous=2.0)
    rough = {"integrator": "heun", "dt": 2e-3}
    error = run(scene, 0.2, **rough).error / 3.0
    for accuracy in (0.1, 10.0):
        motion = run(scene | {"sim": {"accuracy": accuracy * float(error.max())}}, 0.2, **rough)
        assert motion.trusted == (accuracy > 1.0)


def test_what_is_no_motion_of_ticks_is_refused() -> None:
    """A second run that cannot go on is a doubt."""
    motion = run(rotor(0.1, effort=1e300))
    with pytest.raises(InvalidInput, match="part of a recording"):
        motion.part(range(0, 400, 10)).error  # noqa: B018
    with pytest.raises(InvalidInput, match="measured"):
        replace(motion, of_robot=True).error  # noqa: B018
    command = motion.command.copy()
    command[200:] = 1e300
    broken = replace(motion, command=read_only(command))
    assert "cannot be computed from there" in broken.doubt and np.isinf(broken.error[-1]).all()
