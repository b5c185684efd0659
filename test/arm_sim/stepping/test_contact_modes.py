# SPDX-License-Identifier: Apache-2.0
"""Which contacts carry, stick, slide or open; several at once, impacts, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput, SceneError, load_scene
from arm_sim import SimulationDiverged, Simulator, contact_history
from models.engine import (
    APART,
    SLIDES,
    STICKS,
    UNSOLVABLE,
    Impacts,
    locate,
    solve_cone,
    solve_cones,
)
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
PENDULUM = str(models.SCENES / "pendulum.urdf")


def block(mu: float, half: float = 0.3, height: float = 0.4, **options: Any) -> Simulator:
    """A block of 2 kg in the x-z plane on two feet; its centre is ``height`` above them."""
    feet = [contact("body", point=[side, 0, -height], friction=mu) for side in (-half, half)]
    start = {"initial": {"position": {"z": height}}}
    scene = {**rails("xz", 2.0, turns=True, iyy=0.1), **start, "constraints": feet}
    return Simulator(scene, **options)


def random_problem(rng: np.random.Generator, nc: int) -> tuple[np.ndarray, np.ndarray]:
    A = rng.normal(size=(3 * nc, 3 * nc + 1))
    return A @ A.T / 3, rng.normal(size=3 * nc)


@pytest.mark.parametrize("nc", [1, 2, 3])
def test_forces_obey_the_law_of_coulomb(nc: int, rng: np.random.Generator) -> None:
    """Either open, or at rest inside the cone, or on its edge against the motion, in space."""
    seen, answered = set(), 0
    for _ in range(200):
        W, c = random_problem(rng, nc)
        mu = rng.uniform(0.0, 0.5, nc)
        answer = solve_cones(W, c, mu)
        if not answer.found or UNSOLVABLE in answer.state:
            continue
        answered += 1
        motion = (W @ answer.force.ravel() + c).reshape(nc, 3)
        rows = zip(answer.state, answer.force, motion, mu, strict=True)
        for state, (r_n, *r_t), (w_n, *w_t), m in rows:
            seen.add(int(state))
            assert r_n >= 0.0 and w_n >= -1e-9 and abs(r_n * w_n) < 1e-9
            assert np.linalg.norm(r_t) <= m * r_n * (1 + 1e-12) + 1e-12
            if state == SLIDES:
                friction = np.array(r_t) * np.linalg.norm(w_t)
                assert_close(friction, -m * r_n * np.array(w_t), 1e-8)
            elif state == STICKS:
                assert np.abs(w_t).max() < 1e-8
    assert seen == {APART, SLIDES, STICKS} and answered > 150


def test_contacts_that_may_not_carry_do_not(rng: np.random.Generator) -> None:
    W, _ = random_problem(rng, 2)
    c = np.array([-1.0, 0.2, 0.0, -1.0, 0.0, 0.2])
    answer = solve_cones(W, c, np.array([0.3, 0.3]), allowed=np.array([1, 0]))
    alone, force = solve_cone(W[:3, :3], c[:3], 0.3)
    assert answer.found and answer.state.tolist() == [alone, APART]
    assert_close(answer.force[0], force, 1e-12)
    assert not answer.force[1].any()


def test_a_sliding_contact_that_jams_has_no_answer() -> None:
    """Friction that presses together faster than the normal force opens (Painlevé)."""
    W = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    c, ahead = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0])
    assert solve_cone(W, c, 0.5, ahead)[0] == SLIDES
    assert solve_cone(W, c, 0.5, -ahead)[0] == SLIDES
    assert solve_cone(W, c, 1.5, -ahead)[0] == UNSOLVABLE


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


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_impacts_of_an_arm_lose_energy_and_obey_their_law(
    e: float, rng: np.random.Generator
) -> None:
    """Two points of a Panda's hand at random: no gain, no pull, Newton's rebound where it hits."""
    hand = [contact("panda_hand", point=[0, y, 0.1], friction=0.6, restitution=e) for y in (-1, 1)]
    scene = models.scene("panda").model_copy(
        update={"constraints": load_scene({"robot": {"urdf": PENDULUM}}).constraints}
    )
    data = scene.model_dump(exclude_unset=True, exclude_none=True)
    data["constraints"] = [{**c, "plane": {"point": [0, 0, -5]}} for c in hand]
    sim = Simulator(data)
    impacts, n, answered = Impacts(sim), sim.n, 0
    for _ in range(15):
        x = np.concatenate([rng.uniform(-2, 2, n), rng.normal(0, 1, n)])
        rebound = np.maximum(-e * impacts(x, np.zeros(2)).before[::3], 0.0)
        hit = impacts(x, rebound)
        if not np.isfinite(hit.gain):
            continue
        answered += 1
        after = hit.before + hit.W @ hit.impulse
        kinetic = [sim.dynamics.energy(x[:n], v)[0] for v in (x[n:], x[n:] + hit.B @ hit.impulse)]
        assert_close(kinetic[1] - kinetic[0], hit.gain, 1e-10)
        assert (hit.impulse[::3] >= 0.0).all() and (after[::3] >= rebound - 1e-10).all()
        assert e > 0.0 or hit.gain <= 1e-12
    assert answered > 10


@pytest.mark.parametrize("root", [0.3, 1e-9, 0.999999999])
def test_the_instant_of_an_event_is_found_to_rounding(root: float) -> None:
    """Positive at the answer, not just before it; a steep wall beyond it does not mislead."""
    for f in (lambda t: t - root, lambda t: (t - root) ** 3, lambda t: np.expm1(40 * (t - root))):
        found = locate(f, 1.0)
        assert f(found) > 0.0 and f(found - 1e-15) <= 0.0
    assert_close(locate(lambda t: np.inf if t > 0.5 else -1.0, 1.0), 0.5, 1e-14)


def test_painleve_is_said() -> None:
    """A steep rod that slides on its end with much friction: no motion obeys all laws."""
    rod = contact("body", point=[-0.5, 0, 0], friction=3.0)
    data = rails("xz", 1.0, turns=True, iyy=1.0 / 12.0)
    tilt = 1.1
    start = {"z": 0.5 * np.sin(tilt), "turn": -tilt}
    sim = Simulator({**data, "initial": {"position": start}, "constraints": [rod]})
    assert abs(sim.contact_forces()[0].gap) < 1e-12
    with_friction = []
    for speed in (1.0, -1.0):
        sim.reset(v=[speed, 0.0, 0.0])
        before = sim.state
        try:
            sim.step(np.zeros(3))
            with_friction.append(True)
        except SimulationDiverged as error:
            assert "Painlevé" in str(error)
            assert sim.state is before
            with_friction.append(False)
    assert sorted(with_friction) == [False, True]


def test_dry_joints_and_contacts_together() -> None:
    """A body on a rail with dry friction Fc that also slides on the table: both brake it."""
    rail = {**rails("xz", 2.0), "joints": {"x": {"friction": {"coulomb": 1.0}}}}
    data = {**rail, "constraints": [contact("body", friction=0.3)]}
    sim = Simulator(data, dt=5e-3)
    sim.reset(v=[1.0, 0.0])
    run = sim.run(0.5)
    brake = (1.0 + 0.3 * 2.0 * G) / 2.0
    assert_close(run.q[-1, 0], 0.5 / brake, CLOSED_FORM)
    still = run.time > 1.0 / brake
    np.testing.assert_array_equal(run.v[still], np.zeros((still.sum(), 2)))
    assert (np.diff(run.q[still], axis=0) == 0.0).all()
    holds = sim.run(0.2, [1.0 + 0.29 * 2.0 * G, 0.0])
    assert (holds.q == run.q[-1]).all()
    assert sim.run(0.02, [1.0 + 0.31 * 2.0 * G, 0.0]).v[-1, 0] > 0.0


def test_same_input_same_bits_by_run_step_and_rollout() -> None:
    sim = block(0.3)
    push = [7.0, 0.0, 0.5]
    run = sim.run(0.2, push)
    sim.reset()
    for _ in range(200):
        sim.step(push)
    np.testing.assert_array_equal(sim.state.q, run.q[-1])
    rolled = sim.rollout([run.q[0]] * 2, [run.v[0]] * 2, push, 200)
    np.testing.assert_array_equal(rolled[1], np.hstack([run.q, run.v]))


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
        ({"plane": {"nrml": [0, 0, 1]}}, "allowed here: point, normal"),
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


def test_plan_says_so() -> None:
    assert "computed    contact" in str(block(0.1).plan)
    assert "skipped     contact" in str(models.simulator("pendulum").plan)
