# SPDX-License-Identifier: Apache-2.0
"""Which contacts carry, stick, slide or open; several at once, impacts, and what is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged, Simulator, State, contact_history
from arm_sim.recording.contents import BRAKES
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81


def block(mu: float, half: float = 0.3, height: float = 0.4, **options: Any) -> Simulator:
    """A block of 2 kg in the x-z plane on two feet; its centre is ``height`` above them."""
    feet = [contact("body", point=[side, 0, -height], friction=mu) for side in (-half, half)]
    start = {"initial": {"position": {"z": height}}}
    scene = {**rails("xz", 2.0, turns=True, iyy=0.1), **start, "constraints": feet}
    return Simulator(scene, **options)


def test_block_on_two_feet_shares_its_weight() -> None:
    """Pushed by F at its centre: N = mg/2 -+ F h/(2 half); it stays where it is, to the bit."""
    sim = block(0.5)
    run = sim.run(0.5, [4.0, 0.0, 0.0])
    left, right = sim.contact_forces()
    lean = 4.0 * 0.4 / 0.6
    assert_close([left.normal, right.normal], [G - lean, G + lean], 1e-9)
    assert_close(left.force[0] + right.force[0], -4.0, 1e-9)
    np.testing.assert_array_equal(run.q[1:], np.broadcast_to(run.q[1], run.q[1:].shape))
    np.testing.assert_array_equal(run.v, np.zeros_like(run.v))


def test_block_slides_on_two_feet_or_tips_over() -> None:
    """It slides with F/m - µg if µ is small; else it tips about its front foot."""
    sim = block(0.2)
    run = sim.run(0.3, [6.0, 0.0, 0.0])
    assert_close(run.q[:, 0], 0.5 * (3.0 - 0.2 * G) * run.time**2, CLOSED_FORM)
    assert_close(run.q[1:, 2], np.zeros(len(run) - 1), CLOSED_FORM)
    tips = block(1.0)
    run = tips.run(0.1, [1.2 * G * 2 * 0.3 / 0.4, 0.0, 0.0])
    left, right = tips.contact_forces()
    assert left.state == "apart" and left.gap > 1e-4 and right.state == "sticks"
    assert abs(right.gap) < 1e-15
    inertia, arm = 0.1 + 2.0 * (0.3**2 + 0.4**2), 0.2 * 2.0 * G * 0.3
    assert_close(run.q[2, 2] - run.q[1, 2], 1.5 * arm / inertia * 1e-6, 1e-9)


def rod(mu: float, tilt: float, turn: float = 0.0) -> Simulator:
    """A rod of 1 kg and 1 m in the x-z plane that stands on one end, turned on by ``turn``."""
    scene = rails("xz", 1.0, turns=True, iyy=1.0 / 12.0)
    start = {"z": 0.5 * np.sin(tilt), "turn": turn - tilt}
    end = contact("body", point=[-0.5, 0, 0], friction=mu)
    return Simulator({**scene, "initial": {"position": start}, "constraints": [end]})


@pytest.mark.parametrize(
    ("lift", "state"), [(0.0, "slides"), (2.0 * G, "apart")], ids=["no motion", "two motions"]
)
def test_a_steep_rod_that_slides_with_much_friction_is_refused_one_way(
    lift: float, state: str
) -> None:
    """Painlevé: no motion obeys all laws. Pulled up while friction presses it down, it may lift
    off or jam.
    """
    sim = rod(mu=3.0, tilt=1.1)
    assert abs(sim.contact_forces()[0].gap) < 1e-12
    outcomes = []
    for speed in (1.0, -1.0):
        before = sim.reset(v=[speed, 0.0, 0.0])
        try:
            sim.step([0.0, lift, 0.0])
            outcomes.append(sim.contact_forces()[0].state)
        except SimulationDiverged as error:
            assert "Painlevé" in str(error)
            assert sim.state is before
            outcomes.append("refused")
    assert sorted(outcomes) == sorted(["refused", state])


@pytest.mark.parametrize(("tilt", "turns"), [(1.1, 1000), (np.pi - 1.1, -1000)])
def test_a_rod_slips_on_its_end_however_often_it_was_turned(tilt: float, turns: int) -> None:
    """To either side; the gap has the rounding of an angle of thousands of radians."""
    ends = []
    for whole in (0.0, 2.0 * np.pi * turns):
        sim = rod(0.3, tilt, whole)
        run = sim.run(0.05)
        assert sim.contact_forces()[0].state == "slides"
        ends.append(run.q[-1] - [0.0, 0.0, whole])
    assert abs(ends[0][0]) > 1e-3
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-10)


def test_history_closes_the_balance_of_energy() -> None:
    """What is missing after a run is what impacts and friction took, and the account knows it."""
    feet = [
        contact("body", point=[x, 0, -0.4], friction=0.3, restitution=0.4) for x in (-0.3, 0.3)
    ]
    start = {"initial": {"position": {"z": 0.4}}}
    data = {**rails("xz", 2.0, turns=True, iyy=0.1), **start, "constraints": feet}
    sim = Simulator(data)
    sim.reset(q=[0.0, 0.6, 0.2], v=[1.0, 0.0, 0.0])
    run = sim.run(1.5, [1.0, 0.0, 0.1])
    history = contact_history(sim, run)
    lost = history.impact_loss + history.friction_loss
    assert lost[-1] > 3.0 and (np.diff(lost) >= -1e-12).all()
    assert_close(run.lost, lost, 1e-12)
    assert_close(run.balance, np.zeros(len(run)), 1e-8)
    assert history.gap.min() > -1e-12
    assert (history.force[:, :, 2] >= 0.0).all()


def test_states_inside_a_plane_are_refused_and_nothing_is_lost() -> None:
    sim = block(0.3)
    before = sim.state
    for refused in (sim.reset, sim.set_state):
        with pytest.raises(InvalidInput, match=r"0\.01 m inside its plane"):
            refused(q=[0.0, 0.39, 0.0])
        assert sim.state is before


LOAD, ADDED = 0.5, 1.5


def test_forces_are_those_of_the_load_at_each_time() -> None:
    load = {"frame": "body", "mass": LOAD, "inertia": [0.0] * 6}
    scene = rails("z", 2.0) | {"payloads": [load], "tunable": ["payload"]}
    sim = Simulator(scene | {"constraints": [contact("body")]})

    def control(state: State) -> list[float]:
        if state.step == 5:
            sim.set_parameter("payload", [LOAD + ADDED, *[0.0] * 9])
        return [0.0]

    force = contact_history(sim, sim.run(0.01, control)).force[:, 0, 2]
    assert_close(force[:5], np.full(5, (2.0 + LOAD) * G), CLOSED_FORM)
    assert_close(force[5:], np.full(6, (2.0 + LOAD + ADDED) * G), CLOSED_FORM)


def test_nothing_is_lost_where_brakes_hold() -> None:
    sim = Simulator(rails("xz", 2.0) | {"constraints": [contact("body", friction=0.4)]})
    sim.reset(v=[1.0, 0.0])
    run = sim.run(0.01)
    slid = contact_history(sim, run).friction_loss
    held = replace(run, hold=np.array([0] * 5 + [BRAKES] * 6, np.uint8))
    loss = contact_history(sim, held).friction_loss
    assert_close(loss[:6], slid[:6], CLOSED_FORM)
    assert slid[-1] > slid[5] and (loss[6:] == loss[5]).all()
