# SPDX-License-Identifier: Apache-2.0
"""A simulation controlled as by a page, without the page."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_sim import Simulator
from arm_sim.view.draw_loop import DrawLoop
from arm_sim.view.interactive import (
    MEMORY,
    NOTHING,
    SAMPLED,
    SLIDERS,
    WEIGHT,
    Interactive,
    InteractiveArm,
)
from arm_sim.view.live_account import LiveAccount
from arm_sim.view.server import close_server, open_server
from arm_sim.view.stage import DrawnArm


def test_a_push_accelerates_as_its_torque_does() -> None:
    sim = Simulator("two_link")
    rig, before = InteractiveArm(sim), sim.state
    rig.choose(NOTHING)
    rig.push("forearm", np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0]), ticks=2)
    free = sim.dynamics.forward(before.q, before.v, np.zeros(2))
    torque = rig.wrenches.torque(before.q, 0)
    pushed = sim.dynamics.forward(before.q, before.v, torque)
    assert abs(pushed - free).max() > 1.0
    rig.tick()
    np.testing.assert_allclose(sim.state.v / sim.dt, pushed, rtol=2e-2)
    for _ in range(5):
        rig.tick()
    assert rig.wrenches.active == ()
    np.testing.assert_array_equal(sim.arm.plant.parameters.of("external", sim.arm.parameters), 0.0)


def test_a_frame_that_never_moves_is_not_pushed() -> None:
    with pytest.raises(InvalidInput, match="base"):
        InteractiveArm(Simulator("two_link")).push("base", np.ones(6), 1)


def test_weight_is_carried_and_sliders_are_gone_to() -> None:
    sim = Simulator("panda")
    rig = InteractiveArm(sim)
    rig.choose(WEIGHT)
    for _ in range(200):
        rig.tick()
    np.testing.assert_allclose(sim.state.q, sim.model.q0, atol=1e-9)
    rig.choose(SLIDERS)
    rig.target[0] += 0.5
    fastest = 0.0
    for _ in range(4000):
        rig.tick()
        fastest = max(fastest, float(abs(sim.state.v).max()))
    np.testing.assert_allclose(sim.state.q, rig.target, atol=2e-3)
    assert fastest < 1.5  # without a jump
    rig.choose(NOTHING)
    np.testing.assert_array_equal(rig.error, 0.0)


def test_drives_get_commands_and_not_torques() -> None:
    sim = Simulator("motor_pendulum")
    rig = InteractiveArm(sim)
    rig.place(sim.state.q + 0.7)
    rig.choose(WEIGHT)
    start = sim.state.q
    for _ in range(1000):
        rig.tick()
    np.testing.assert_allclose(sim.state.q, start, atol=1e-2)


def test_the_energy_account_beside_it_is_that_of_a_recording() -> None:
    """With a drive that stores, loses and brings in energy; after a push and in another place."""
    sim = Simulator("motor_pendulum")
    rig = InteractiveArm(sim)
    rig.place(sim.state.q + 0.7)
    rig.account.prepare()
    rig.push("bob", np.zeros(6), ticks=1)  # which compiles the scene anew
    until_built(rig.account)
    rig.choose(WEIGHT)
    rig.tick()  # opens the account
    start = sim.state
    commands = []
    for _ in range(200):
        rig.tick()
        commands.append(sim.arm.acted.copy())
    account = dict(zip(rig.account.names, rig.account.now().tolist(), strict=True))
    other = Simulator("motor_pendulum")
    other.reset(start.q, start.v, start.z)
    recorded = other.run(0.2, np.array(commands))
    for name, expected in {
        "kinetic": recorded.kinetic, "potential": recorded.potential, "stored": recorded.stored,
        "supplied": recorded.supplied, "lost": recorded.lost, "balance": recorded.balance,
    }.items():  # fmt: skip
        assert account[name] == pytest.approx(expected[-1], abs=1e-9), name
    assert account["lost"] > 1e-3
    rig.place(sim.state.q)
    assert rig.account.now() is None


def test_an_account_starts_anew_when_somebody_else_has_moved_the_arm() -> None:
    sim = Simulator("motor_pendulum")
    rig = InteractiveArm(sim)
    rig.account.prepare()
    until_built(rig.account)
    for _ in range(50):
        rig.tick()
    theirs = sim.run(0.1, [5.0])
    for _ in range(2):
        rig.tick()
    account = rig.account.now()
    assert account is not None
    lost = account[rig.account.names.index("lost")]
    assert 0.0 < lost < 0.1 * theirs.lost[-1]  # that of a single tick


def until_built(account: LiveAccount) -> None:
    """Wait for its equations."""
    end = time.monotonic() + 60.0
    while account.in_preparation:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_requests_are_served_in_turn_by_one_thread_and_refusals_are_reported() -> None:
    told, served, done = list[str](), list[object](), threading.Event()
    loop = DrawLoop(lambda passed: None, told.append)

    def refuse() -> None:
        raise InvalidInput("not allowed")

    for order in (lambda: served.append(threading.current_thread()), refuse, done.set):
        loop.order(order)
    loop.start()
    assert done.wait(10.0)
    loop.stop()
    assert told == ["not allowed"]
    assert served != [threading.current_thread()]


def test_the_thread_may_end_itself() -> None:
    told, done = list[str](), threading.Event()
    loop = DrawLoop(lambda passed: None, told.append)
    loop.order(lambda: (loop.stop(), done.set()))
    loop.start()
    assert done.wait(10.0)
    loop.stop()
    assert not told and not loop._thread.is_alive()


@pytest.mark.group("view")
def test_curves_go_back_by_the_seconds_that_they_promise() -> None:
    """Of simulated time, however fast it goes."""
    server, sim = open_server("arm", port=0), Simulator("pendulum", dt=SAMPLED)
    actor = DrawnArm(server, sim.model, "arm")
    page = Interactive(server, [InteractiveArm(sim)], [actor])
    page.step(round(1.2 * MEMORY / SAMPLED))
    close_server(server)
    torque, *_ = page._curves()
    assert np.ptp(torque.time) == pytest.approx(MEMORY, rel=0.01)
    assert torque.time[-1] == pytest.approx(sim.state.time, abs=2 * SAMPLED)
