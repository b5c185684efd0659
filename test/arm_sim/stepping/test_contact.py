# SPDX-License-Identifier: Apache-2.0
"""Contact of points with planes: touch, bounce, rest, slide and lift off, against closed forms."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import models
from arm_sim import Simulator
from models.touching import beside, contact, rails, unbalance
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


@pytest.mark.parametrize("normal", [(-1, 0, 0), (0.36, -0.48, -0.8)])
def test_forces_are_in_the_worlds_axes(normal: tuple[float, ...]) -> None:
    """A body pressed on walls, ceilings and slopes: what holds it is what presses it."""
    sim = touching(rails("xyz", 2.0), contact("body", friction=0.5, plane={"normal": normal}))
    across = np.array(normal, float)
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


def test_unbalanced_rotor_lifts_its_base_off() -> None:
    """Pressed down with F and without weight, a rotor jumps at sin ωt = F/(m r ω²)."""
    m, r, base, F, w = 0.5, 0.2, 1.0, 6.0, 10.0
    scene = rails("z", base, branches=[unbalance("0 -1 0", m, r)]) | {"gravity": [0, 0, 0]}
    for options in OPTIONS.values():
        sim = touching(scene, contact("body"), **options)
        sim.reset(v=[0.0, w])
        jump = np.arcsin(F / (m * r * w**2)) / w
        run = sim.run(0.2, [-F, 0.0])
        held = run.time <= jump
        np.testing.assert_array_equal(run.q[held, 0], np.zeros(held.sum()))
        assert (run.q[~held, 0] > 0.0).all()

        def slope(_: float, x: np.ndarray) -> list[float]:
            _, angle, v, spin = x
            M = [[base + m, m * r * np.cos(angle)], [m * r * np.cos(angle), m * r**2]]
            a = np.linalg.solve(M, [-F + m * r * spin**2 * np.sin(angle), 0.0])
            return [v, spin, *a]

        start = [0.0, w * jump, 0.0, w]
        exact = solve_ivp(slope, (jump, 0.2), start, "DOP853", rtol=3e-14, atol=1e-15).y[:, -1]
        end = np.hstack([run.q[-1], run.v[-1]])
        assert_close(end, exact, 1e-9 if "tolerance" in options else 1e-6)


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
