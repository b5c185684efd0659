# SPDX-License-Identifier: Apache-2.0
"""Contact of points with planes: touch, bounce, rest, slide and lift off, against closed forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ConstraintError
from arm_sim import SimulationDiverged, Simulator, State, contact_history
from arm_sim.recording.contents import BRAKES
from models.touching import beside, contact, rails
from tolerances import CLOSED_FORM, CONTACT_EVENTS, assert_close

G = 9.81
OPTIONS: dict[str, dict[str, Any]] = {
    "rk4": {"integrator": "rk4", "dt": 1e-2},
    "nystrom4": {"integrator": "nystrom4", "dt": 1e-2},
    "error control": {"tolerance": 1e-10, "dt": 1e-2},
}
ALL = pytest.mark.parametrize("options", [OPTIONS["rk4"], OPTIONS["error control"]], ids=str)


def touching(scene: dict[str, Any], *contacts: dict[str, Any], **options: Any) -> Simulator:
    return Simulator({**scene, "constraints": contacts}, **options)


def bouncing(time: np.ndarray, height: float, e: float) -> tuple[np.ndarray, float]:
    """Height of a point mass that bounces, and the time at which it has come to rest."""
    landing = np.sqrt(2 * height / G)
    z, start, v = height - 0.5 * G * time**2, landing, e * G * landing
    z[time > landing] = 0.0
    while v > 1e-14:
        t = time - start
        flying = (t > 0.0) & (t < 2 * v / G)
        z[flying] = v * t[flying] - 0.5 * G * t[flying] ** 2
        start, v = start + 2 * v / G, e * v
    return z, landing * (1 + e) / (1 - e)


@pytest.mark.parametrize(
    ("options", "e"), [*zip(OPTIONS.values(), (0.0, 0.5, 0.8), strict=True)], ids=str
)
def test_bounces_to_rest(options: dict[str, Any], e: float) -> None:
    """All bounces at their times and heights, and rest from t1 (1 + e)/(1 - e) on for ever."""
    sim = touching(rails("z", 2.0), contact("body", restitution=e), **options)
    sim.reset(q=[0.3])
    run = sim.run(2.5)
    z, rests = bouncing(run.time, 0.3, e)
    assert_close(run.q[:, 0], z, CONTACT_EVENTS)
    after = run.time > rests + 1e-9
    assert after.any() and (run.v[~after][1:, 0] != 0.0).all()
    np.testing.assert_array_equal(run.q[after], np.zeros((after.sum(), 1)))
    np.testing.assert_array_equal(run.v[after], np.zeros((after.sum(), 1)))


@ALL
def test_slides_to_a_stop_on_a_plane(options: dict[str, Any]) -> None:
    """From speed s straight on for s²/2µg, for s/µg seconds, in any direction of the plane."""
    mu, v0 = 0.4, np.array([1.0, 0.5, 0.0])
    sim = touching(rails("xyz", 2.0), contact("body", friction=mu), **options)
    sim.reset(v=v0)
    run = sim.run(0.5)
    speed = np.linalg.norm(v0)
    stopped = run.time > speed / (mu * G)
    assert (np.abs(run.v[~stopped, 0]) > 0.0).all()
    np.testing.assert_array_equal(run.v[stopped], np.zeros((stopped.sum(), 3)))
    assert_close(run.q[-1], v0 * speed / (2 * mu * G), CLOSED_FORM)


@ALL
def test_slope_at_the_angle_of_friction(options: dict[str, Any]) -> None:
    """Rests for ever below tan θ = µ, starts above it, and slides up and back again."""
    angle = 0.3
    normal, down = (np.sin(angle), 0.0, np.cos(angle)), np.array([np.cos(angle), -np.sin(angle)])
    for factor, rests in ((1.0001, True), (0.9999, False)):
        mu = float(np.tan(angle)) * factor
        plane = contact("body", friction=mu, plane={"normal": normal})
        sim = touching(rails("xz"), plane, **options)
        run = sim.run(0.3)
        a = 0.0 if rests else G * (np.sin(angle) - mu * np.cos(angle))
        assert_close(run.q, 0.5 * a * run.time[:, None] ** 2 * down, CLOSED_FORM)
        assert (run.q == 0.0).all() == rests
    sim = touching(rails("xz"), contact("body", friction=0.2, plane={"normal": normal}), **options)
    sim.reset(v=-down)
    run = sim.run(0.5)
    up, back = (G * (np.sin(angle) + sign * 0.2 * np.cos(angle)) for sign in (1, -1))
    way = -0.5 / up + 0.5 * back * (0.5 - 1 / up) ** 2
    assert_close(run.q[-1], way * down, CLOSED_FORM)


def test_arm_presses_on_a_table() -> None:
    """Two links stick to a table: its force is that of statics, and nothing moves, to the bit."""
    q = np.array([0.3, -1.1])
    upper, fore = 0.5 * np.exp(1j * q[0]), 0.4 * np.exp(1j * q.sum())  # x + i z of the links
    table = contact("tip", friction=0.6, plane={"point": [0, 0, (upper + fore).imag]})
    sim = touching({"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}, table, dt=1e-2)
    turned = 1j * np.array([upper + fore, fore])  # by the joints' angles
    tau = sim.dynamics.gravity(q) - 3.0 * turned.real - 20.0 * turned.imag
    sim.reset(q=q)
    run = sim.run(1.0, tau)
    (force,) = sim.contact_forces()
    assert force.state == "sticks"
    assert_close(force.force, [3.0, 0.0, 20.0], 1e-10)
    np.testing.assert_array_equal(run.q[1:], np.broadcast_to(run.q[1], run.q[1:].shape))
    np.testing.assert_array_equal(run.v, np.zeros_like(run.v))
    assert_close(run.q[-1], q, 1e-15)


def test_forces_are_in_the_worlds_axes() -> None:
    """A body pressed on a slope overhead: what holds it is what presses it."""
    across = np.array([0.36, -0.48, -0.8])
    plane = {"normal": across.tolist()}
    sim = touching(rails("xyz", 2.0), contact("body", friction=0.5, plane=plane))
    aside = np.cross(across, [0.3, -0.5, 0.81])
    aside /= np.linalg.norm(aside)
    weight = np.array([0.0, 0.0, -2.0 * G])
    for pull, state in ((9.0, "sticks"), (11.0, "slides")):
        sim.reset()
        sim.step(-20.0 * across + pull * aside - weight)
        (force,) = sim.contact_forces()
        held = min(pull, 10.0)
        assert force.state == state
        assert_close(force.normal, 20.0, 1e-10)
        assert_close(force.tangential, -held * aside, 1e-10)
        assert_close(force.force, 20.0 * across - held * aside, 1e-10)
        assert_close(force.gap, 0.0, 1e-14)
        move = sim.state.v / max(1e-300, np.abs(sim.state.v).max())
        assert state == "sticks" or np.abs(np.cross(move, aside)).max() < 1e-9
    sim.reset(q=across * 0.25)
    (force,) = sim.contact_forces()
    assert (force.state, force.normal, force.gap) == ("apart", 0.0, pytest.approx(0.25))
    assert not force.force.any()


def test_a_block_sticks_up_to_its_static_coefficient_and_then_slides_with_the_lower_one() -> None:
    """µs m g holds; a little more, and it leaves with F/m - µ g. Stopped, it sticks again."""
    foot = contact("body", friction=0.3, static_friction=0.5)
    sim = Simulator({**rails("xyz", 2.0), "constraints": [foot]})
    level = 2.0 * G * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    held = sim.run(0.2, 0.499 * level)
    assert (held.q == held.q[0]).all()
    gone = sim.run(0.2, 0.501 * level)
    assert_close(np.hypot(*gone.q[-1, :2]), 0.5 * (0.501 - 0.3) * G * 0.04, CLOSED_FORM)
    slows = sim.run(0.2, 0.31 * level)
    assert slows.v[-1, 0] > gone.v[-1, 0]  # between the two coefficients a sliding block goes on
    rests = sim.run(2.0, 0.0 * level)
    assert (rests.v[-1] == 0.0).all()
    again = sim.run(0.2, -0.499 * level)
    assert (again.q == rests.q[-1]).all()


def test_a_heavy_and_a_light_block_on_one_table_do_not_disturb_one_another() -> None:
    """Each falls, bounces, slides and stops as if it were alone, whatever their masses."""
    light = 1e-9
    scene = rails("xz", 1.0, branches=[beside(light)])
    feet = contact("body", friction=0.3), contact("other", friction=0.2, restitution=0.5)
    sim = touching(scene, *feet)
    sim.reset(v=[3.0, 0.0, 3.0, 0.0])
    run = sim.run(2.0)
    for x, mu in ((0, 0.3), (2, 0.2)):
        t = np.minimum(run.time, 3.0 / (mu * G))
        assert_close(run.q[:, x], 3.0 * t - 0.5 * mu * G * t**2, CLOSED_FORM)
        assert (run.v[run.time > 3.0 / (mu * G), x] == 0.0).all()
    heavy, other = sim.contact_forces()
    assert_close(np.array([heavy.normal, other.normal / light]), [G, G], CLOSED_FORM)
    sim.reset(q=[0.0, 0.1, 0.0, 0.1])
    fall = sim.run(1.5)
    landed = fall.time > np.sqrt(0.2 / G)
    assert (fall.q[landed, 1] == 0.0).all()
    assert_close(fall.q[:, 3], bouncing(fall.time, 0.1, 0.5)[0], CONTACT_EVENTS)


def test_derivatives_of_a_heavy_and_a_light_block_on_one_table_do_not_depend_on_masses() -> None:
    """The light one sticks, by a force whose square is far below the rounding of the other's."""
    slopes = []
    for light in (1.0, 1e-9):
        feet = contact("body", friction=0.3), contact("other", friction=0.2)
        sim = touching(rails("xz", 1.0, branches=[beside(light)]), *feet)
        sim.reset(v=[3.0, 0.0, 0.0, 0.0])
        slopes.append(sim.linearize(sim.state, [0.1, 0.0, 0.1 * light, 0.0])[0])
    assert_close(slopes[1], slopes[0], CLOSED_FORM)


# --- several contacts, what is refused, and their history ----------------------------------------


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


def test_a_rod_slips_on_its_end_however_often_it_was_turned() -> None:
    """The gap has the rounding of an angle of thousands of radians."""
    ends = []
    for whole in (0.0, -2000.0 * np.pi):
        sim = rod(0.3, np.pi - 1.1, whole)
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


def test_of_several_points_inside_their_planes_the_deepest_is_named() -> None:
    """A nanometre is rounding; what is refused changes nothing."""
    feet = [
        contact("body", name=f"foot{k}", plane={"point": [0, 0, height]})
        for k, height in enumerate((-1.0, 0.5, 0.2))
    ]
    sim = Simulator(rails("xz") | {"initial": {"position": {"z": 0.6}}, "constraints": feet})
    before = sim.reset(q=[5.0, 0.5 - 0.9e-9])
    for refused in (sim.reset, sim.set_state):
        with pytest.raises(ConstraintError, match="'foot1' is 0.5 m inside its plane") as told:
            refused(q=[5.0, 0.0])
        assert told.value.residuals == {"foot0": 1.0, "foot1": -0.5, "foot2": -0.2}
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
