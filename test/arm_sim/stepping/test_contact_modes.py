# SPDX-License-Identifier: Apache-2.0
"""Which contacts carry, stick, slide or open; several at once, impacts, and what is refused."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput, SceneError
from arm_sim import SimulationDiverged, Simulator, contact_history
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


def test_equal_contacts_carry_equally() -> None:
    """One point twice: forces of least norm, the same motion."""
    foot = contact("body", friction=0.3)
    sim = Simulator({**rails("xyz", 2.0), "constraints": [foot, {**foot, "name": "again"}]})
    run = sim.run(0.2, [8.0, 0.0, 0.0])
    first, second = sim.contact_forces()
    assert_close(first.force, second.force, 1e-7)
    assert_close(first.normal + second.normal, 2.0 * G, 1e-12)
    assert_close(run.q[-1, 0], 0.5 * (4.0 - 0.3 * G) * 0.04, CLOSED_FORM)


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


@pytest.mark.parametrize("tilt", [1.1, np.pi - 1.1])
@pytest.mark.parametrize("turns", [1000, -1000])
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


@pytest.mark.parametrize("axes", ["xz", "zx", "yzx"])
def test_dry_joints_and_contacts_together(axes: str) -> None:
    """A body on a rail with dry friction Fc that also slides on the table: both brake it."""
    rail = {**rails(axes, 2.0), "joints": {"x": {"friction": {"coulomb": 1.0}}}}
    data, x = {**rail, "constraints": [contact("body", friction=0.3)]}, axes.index("x")
    sim, way = Simulator(data, dt=5e-3), np.eye(len(axes))[x]
    sim.reset(v=way)
    run = sim.run(0.5)
    brake = (1.0 + 0.3 * 2.0 * G) / 2.0
    assert_close(run.q[-1, x], 0.5 / brake, CLOSED_FORM)
    still = run.time > 1.0 / brake
    np.testing.assert_array_equal(run.v[still], np.zeros((still.sum(), len(axes))))
    assert (np.diff(run.q[still], axis=0) == 0.0).all()
    holds = sim.run(0.2, (1.0 + 0.29 * 2.0 * G) * way)
    assert (holds.q == run.q[-1]).all()
    assert sim.run(0.02, (1.0 + 0.31 * 2.0 * G) * way).v[-1, x] > 0.0


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


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frame": "nowhere"}, "'nowhere' does not exist"),
        ({"plane": {"normal": [0, 0, 0]}}, "direction must not be zero"),
        ({"plane": {"nrml": [0, 0, 1]}}, "allowed here: frame, point, normal"),
        ({"restitution": 1.5}, "restitution"),
        ({"friction": -0.1}, "friction"),
        ({"frame": "base"}, "no joint moves"),
        ({"plane": {"point": [0, 0, 0.5]}}, "0.5 m inside its plane"),
    ],
)
def test_impossible_contacts(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Simulator({**rails("xz"), "constraints": [{**contact("body"), **change}]})


def test_states_inside_a_plane_are_refused_and_nothing_is_lost() -> None:
    sim = block(0.3)
    before = sim.state
    for refused in (sim.reset, sim.set_state):
        with pytest.raises(InvalidInput, match=r"0\.01 m inside its plane"):
            refused(q=[0.0, 0.39, 0.0])
        assert sim.state is before
    with pytest.raises(InvalidInput, match="no contact"):
        Simulator(models.scene("pendulum")).contact_forces()
