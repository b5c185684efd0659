# SPDX-License-Identifier: Apache-2.0
"""Friction by speed and springs by deflection, from tables: as functions of one state."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

import models
from arm_dynamics import Dynamics, InvalidInput
from complex_step import EPSILON, evaluated, seeded
from models.rotor import rotor
from tolerances import ALGEBRA, CLOSED_FORM, FINITE_DIFF, INVERSE_PAIR, assert_close

SPEED = [0.0, 0.05, 0.2, 1.0, 3.0]
TORQUE = [1.5, 1.1, 1.0, 1.3, 2.5]
ROWS = [TORQUE, [0.6, 0.6, 0.7, 0.7, 0.5], [2.0, 1.0, 3.0, 0.0, 1.0]]
BY_PLACE = {"speed": SPEED, "torque": ROWS, "position": [-1.0, 0.5, 2.0]}
TWO_ROWS = {"speed": [0.0, 1.0], "torque": [[0.0, 2.0], [0.0, 4.0]], "position": [0.0, 1.0]}
DRAG = {"speed": [0.0, 0.5, 1.0, 2.0], "torque": [0.0, 0.05, 0.2, 0.8]}


def wheel(table: dict[str, Any], **friction: Any) -> Dynamics:
    return Dynamics(rotor(0.1, table=table, **friction))


def friction(dyn: Dynamics, v: np.ndarray, q: float | np.ndarray = 0.0) -> np.ndarray:
    v = np.asarray(v, dtype=float)
    return dyn.friction(v[:, None], q=np.broadcast_to(q, v.shape)[:, None])[:, 0]


def test_friction_is_what_the_table_says_in_both_directions() -> None:
    dyn, v = wheel({"speed": SPEED, "torque": TORQUE}), np.array(SPEED[1:])
    assert_close(friction(dyn, v), TORQUE[1:], CLOSED_FORM)
    assert_close(friction(dyn, -v), -np.array(TORQUE[1:]), CLOSED_FORM)
    assert_close(dyn.friction([0.0], direction=[-1.0]), [-1.5], CLOSED_FORM)


def test_a_table_with_negative_speeds_says_both_directions() -> None:
    dyn = wheel({"speed": [-2.0, -1.0, 0.0, 1.0], "torque": [3.0, 1.0, 0.5, 0.7]})
    assert_close(friction(dyn, [-2.0, -1.0, 1.0]), [-3.0, -1.0, 0.7], CLOSED_FORM)
    assert_close(dyn.friction([0.0], direction=[-1.0]), [-0.5], CLOSED_FORM)


def test_beyond_the_last_speed_it_rises_on_or_stays() -> None:
    v = np.array([4.0, 9.0])
    rising = wheel({"speed": [0.0, 1.0, 2.0], "torque": [1.0, 2.0, 5.0]})
    assert_close(friction(rising, v), 5.0 + 3.0 * (v - 2.0), CLOSED_FORM)
    assert_close(friction(rising, -v), -5.0 - 3.0 * (v - 2.0), CLOSED_FORM)
    falling = wheel({"speed": [0.0, 1.0, 2.0], "torque": [1.0, 2.0, 0.5]})
    assert_close(friction(falling, v), [0.5, 0.5], CLOSED_FORM)


@pytest.mark.parametrize("seed", range(2))
def test_no_table_gives_out_energy(seed: int) -> None:
    """Whatever its sizes of friction, F v >= 0 at every speed and position."""
    rng = np.random.default_rng(seed)
    speed = np.sort(np.append(rng.uniform(-2.0, 2.0, 5), [0.0, 2.5])).tolist()
    torque = rng.exponential(1.0, (3, 7)) * rng.integers(0, 2, (3, 7))
    torque[:, speed.index(0.0)] += 1e-3
    place = {"position": [-1.0, 0.0, 2.0], "period": 4.0 if seed % 2 else None}
    dyn = wheel({"speed": speed, "torque": torque.tolist(), **place})
    v, q = rng.uniform(-4.0, 4.0, 2000), rng.uniform(-9.0, 9.0, 2000)
    power = friction(dyn, v, q) * v
    assert power.min() >= -CLOSED_FORM * power.max()


def test_rows_are_blended_between_positions() -> None:
    """At a position its row, halfway between two their mean, beyond the last that one."""
    dyn = wheel(BY_PLACE)
    one = [friction(wheel({"speed": SPEED, "torque": row}), [0.4])[0] for row in ROWS]
    places = np.array([-1.0, 0.5, 2.0, -0.25, 1.25, 7.0])
    wanted = [*one, (one[0] + one[1]) / 2, (one[1] + one[2]) / 2, one[2]]
    assert_close(friction(dyn, np.full(6, 0.4), places), wanted, CLOSED_FORM)
    around = wheel({**BY_PLACE, "period": 4.0})
    q = np.linspace(-3.0, 3.0, 50)
    v = np.full(50, 0.4)
    assert_close(friction(around, v, q + 4.0), friction(around, v, q), ALGEBRA)
    assert_close(friction(around, v[:1], np.array([2.5])), [(one[0] + one[2]) / 2], CLOSED_FORM)


def test_without_dry_friction_rows_still_differ_in_motion() -> None:
    """So friction cannot be told without the position."""
    dyn = wheel(TWO_ROWS)
    assert_close(friction(dyn, [1.0] * 3, np.array([0.0, 0.5, 1.0])), [2.0, 3.0, 4.0], CLOSED_FORM)
    for v in (np.ones(1), np.ones((99, 1))):
        with pytest.raises(InvalidInput, match="q is expected"):
            dyn.friction(v)


@pytest.mark.parametrize("v", [0.0, 0.13, -0.2, 3.5])
@pytest.mark.parametrize("q", [-1.0, 0.1])
def test_derivatives_of_friction(q: float, v: float) -> None:
    """By complex numbers between the points; at a point the same from both sides, and there."""
    table = wheel(BY_PLACE).model.friction.tables[0]
    assert table is not None
    x = ca.SX.sym("x", 2)
    value = table.without_dry(x[1], x[0])
    by_code = ca.Function("slopes", [x], [ca.jacobian(value, x)])
    law, near = ca.Function("law", [x], [value]), 1e-9
    for aside in (near, -near):
        at = np.array([q + aside, v + aside])
        exact = evaluated(law, seeded([at]))[0].imag / EPSILON
        assert_close(np.array(by_code(at)), exact, CLOSED_FORM)
        assert_close(np.array(by_code([q, v])), exact, FINITE_DIFF)


def test_inverse_and_forward_dynamics_agree_under_tables(rng: np.random.Generator) -> None:
    urdf = models.scene("two_link").robot.urdf
    joints = {
        "shoulder": {"friction": {"table": BY_PLACE}, "spring": {"table": HARDENING}},
        "elbow": {"friction": {"table": DRAG, "viscous": 0.1}},
    }
    dyn = Dynamics({"robot": {"urdf": urdf}, "joints": joints})
    q, v, a = rng.uniform(-3.0, 3.0, (3, 300, 2))
    tau = dyn.inverse(q, v, a)
    assert_close(dyn.forward(q, v, tau), a, INVERSE_PAIR)
    one_by_one = [dyn.inverse(*state) for state in zip(q, v, a, strict=True)]
    assert_close(tau, one_by_one, ALGEBRA)
    assert_close(dyn.friction(v, q=q)[:, 0], friction(wheel(BY_PLACE), v[:, 0], q[:, 0]), ALGEBRA)


# --- springs -----------------------------------------------------------------------------------

HARDENING = {"deflection": [-1.0, -0.4, 0.0, 0.5, 1.0], "torque": [-6.0, -1.0, 0.2, 2.0, 7.0]}


def spring(**about: Any) -> Dynamics:
    scene = rotor(0.1)
    scene["joints"]["axle"]["spring"] = about
    return Dynamics(scene)


def test_a_spring_is_what_its_table_says() -> None:
    dyn, rest = spring(table=HARDENING, rest=0.3, damping=0.5), 0.3
    at = np.array(HARDENING["deflection"])[:, None]
    assert_close(dyn.spring(at + rest)[:, 0], HARDENING["torque"], CLOSED_FORM)
    assert_close(dyn.spring([rest + 3.0]), [7.0 + 10.0 * 2.0], CLOSED_FORM)
    assert_close(dyn.spring([rest - 2.0]), [-6.0 - 5.0 / 0.6], CLOSED_FORM)
    assert_close(dyn.spring([rest], [2.0]), [0.2 + 0.5 * 2.0], CLOSED_FORM)


def test_the_energy_of_a_spring_is_its_work() -> None:
    dyn = spring(table=HARDENING, rest=0.3)
    for q in (-2.5, -0.7, 0.3, 0.31, 0.9, 2.2):
        breaks = [
            q0 + 0.3 for q0 in HARDENING["deflection"] if min(q, 0.3) < q0 + 0.3 < max(q, 0.3)
        ]
        work = quad(
            lambda x: float(dyn.spring([x])[0]), 0.3, q, points=breaks or None, epsabs=1e-12
        )[0]
        assert_close(dyn.energy([q], [0.0])[1], work, ALGEBRA)
