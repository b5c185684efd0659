# SPDX-License-Identifier: Apache-2.0
"""A simulation controlled as by a page, without the page."""

from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator
from arm_sim.view.drawn_arm import DrawnArm
from arm_sim.view.interactive import Interactive
from arm_sim.view.interactive_arm import ENERGIES, InteractiveArm, Mode
from arm_sim.view.marks import Marker


def test_a_push_accelerates_as_its_torque_does() -> None:
    sim = Simulator("two_link")
    rig, before = InteractiveArm(sim), sim.state
    rig.choose(Mode.NOTHING)
    rig.push("forearm", np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0]), ticks=2)
    free = sim.dynamics.forward(before.q, before.v, np.zeros(2))
    torque = rig.wrenches.advance(before.q, 0)
    pushed = sim.dynamics.forward(before.q, before.v, torque)
    assert abs(pushed - free).max() > 1.0
    rig.tick()
    np.testing.assert_allclose(sim.state.v / sim.dt, pushed, rtol=2e-2)
    for _ in range(5):
        rig.tick()
    assert rig.wrenches.active == ()
    np.testing.assert_array_equal(sim.arm.plant.parameters.of("external", sim.arm.parameters), 0.0)


def test_weight_is_carried_and_sliders_are_gone_to() -> None:
    sim = Simulator("panda")
    rig = InteractiveArm(sim)
    rig.choose(Mode.GRAVITY)
    for _ in range(200):
        rig.tick()
    np.testing.assert_allclose(sim.state.q, sim.model.q0, atol=1e-9)
    rig.choose(Mode.SLIDERS)
    rig.target[0] += 0.5
    fastest = 0.0
    for _ in range(4000):
        rig.tick()
        fastest = max(fastest, float(abs(sim.state.v).max()))
    np.testing.assert_allclose(sim.state.q, rig.target, atol=2e-3)
    assert fastest < 1.5  # without a jump


def test_its_energies_are_those_of_a_recording() -> None:
    """With a drive that stores, loses and brings in energy; in another place, after a push."""
    sim = Simulator("motor_pendulum")
    rig = InteractiveArm(sim)
    rig.place(sim.state.q + 0.7)
    start, commands = sim.state, []
    for _ in range(200):
        rig.tick()
        commands.append(sim.arm.acted.copy())
    other = Simulator("motor_pendulum")
    other.reset(start.q, start.v, start.z)
    recorded = other.run(0.2, np.array(commands))
    names = "kinetic", "potential", "supplied", "lost", "balance", "energy"
    expected = [getattr(recorded, name)[-1] for name in names]
    np.testing.assert_allclose(rig.sample().energies, expected, atol=1e-9)
    assert recorded.lost[-1] > 1e-3
    theirs = sim.run(0.1, [5.0])  # somebody else moves it: the account begins again
    rig.tick()
    lost = rig.sample().energies[ENERGIES.index("lost")]
    assert 0.0 < lost < 0.1 * theirs.lost[-1]  # that of a single tick


@pytest.fixture
def bench(server: Any) -> Interactive:
    """A page of two arms with ticks of different lengths, whose thread does not run."""
    sims = Simulator("two_link", dt=2e-3), Simulator("pendulum", dt=1e-3)
    pairs = zip(sims, ("left", "right"), strict=True)
    actors = [DrawnArm(server, sim.model, name) for sim, name in pairs]
    return Interactive(server, actors, [InteractiveArm(sim) for sim in sims])


@pytest.mark.group("view")
def test_two_arms_share_a_clock_and_have_their_own_curves(bench: Interactive) -> None:
    left, right = (rig.simulation for rig in bench.rigs)
    bench.step(50)
    assert (left.state.step, right.state.step) == (50, 100)
    kinds = "energy [J]", "error [rad]", "torque [N m]"
    curves = bench._charts._panel.charts
    assert list(curves) == [f"{name}: {kind}" for name in ("left", "right") for kind in kinds]
    _, error, torque = (curves[f"left: {kind}"].values for kind in kinds)
    np.testing.assert_allclose(torque[-1], left.dynamics.gravity(left.state.q), rtol=1e-6)
    assert not error.any()  # nothing is to be followed
    bench.choose(Mode.SLIDERS)
    for rig in bench.rigs:
        rig.target += 0.1
    bench.step(31)
    np.testing.assert_array_equal(curves["left: error [rad]"].values[-1], bench.rigs[0].error)
    assert bench.rigs[0].error.all()
    bench.reset()
    assert left.state.step == right.state.step == 0 and not len(curves["left: torque [N m]"].time)
    bench.run(True)
    bench._try(lambda: bench.rigs[0].push("base", np.ones(6), 1))  # is refused, and pauses it
    assert not bench.running and "base" in bench._status.content


@pytest.mark.group("view")
def test_sliders_place_the_arm_while_it_is_paused(bench: Interactive) -> None:
    rig, (first, second) = bench.rigs[0], bench._sliders[0]
    sim = rig.simulation
    assert [slider.value for slider in (first, second)] == pytest.approx(sim.state.q)
    before = sim.state.q
    bench.slide(rig, 1, 0.3)
    np.testing.assert_array_equal(sim.state.q, [before[0], 0.3])
    assert second.value == 0.3 and first.value == pytest.approx(before[0])
    bench.running = True
    bench.slide(rig, 0, 0.2)
    np.testing.assert_array_equal(sim.state.q, [before[0], 0.3])  # it moves by itself
    rig.choose(Mode.SLIDERS)
    bench.slide(rig, 0, 0.2)
    np.testing.assert_array_equal(rig.target, [0.2, 0.3])


@pytest.mark.parametrize("scene", ["double_pendulum", "four_bar"])
def test_after_a_drag_the_motion_decays_alike_in_light_and_heavy_arms(scene: str) -> None:
    """M(q) v̇ + C v + M(q) v/T = 0 and M' - 2 C skew-symmetric give E = E(0) exp(-2 t/T)."""
    sim = Simulator(scene)
    rig = InteractiveArm(sim)
    rig.place(sim.state.q)
    frame = Marker(sim.model).hand
    held = sim.dynamics.pose(sim.state.q, frame)[:3, 3]
    rig.pull(frame, held, held + [0.0, 0.0, 0.3 * sim.model.reach])
    energies, speeds = [], []
    for tick in range(1200):
        if tick == 200:
            rig.mouse.release()
        rig.tick()
        q, v = sim.state.q, sim.state.v
        energies.append(v @ sim.dynamics.mass_matrix(q) @ v / 2)
        speeds.append(abs(v).max())
    released, period = 199, round(1.0 / rig.damping / sim.dt)
    assert speeds[released] > 0.3  # it was moved
    assert max(speeds[released:]) < 1.05 * speeds[released]
    after = np.array(energies[released:])
    assert (np.diff(after) < 0.0).all()
    assert after[period] / after[0] == pytest.approx(np.exp(-2.0), rel=0.05)
    assert speeds[-1] < 0.02 * speeds[released]
