# SPDX-License-Identifier: Apache-2.0
"""Some ticks of a motion are made again: a motion that lost its way within a tick is noticed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import models
from arm_dynamics.arrays import read_only
from arm_sim import Recording, Simulator
from arm_sim.integrators.selection import SECOND_LOOK
from arm_sim.recording.second_look import (
    FEWEST,
    Indices,
    SecondLook,
    Ticks,
    drawn,
    finer_tolerance,
    second_look,
)
from models.rotor import rotor

SCENE = rotor(0.1, coulomb=1.0)


@pytest.fixture(scope="module")
def motion() -> Recording:
    sim = Simulator(SCENE)
    sim.reset(v=[2.0])
    return sim.run(0.4, [0.3])


def test_a_right_motion_is_trusted(motion: Recording) -> None:
    look = motion.second_look
    assert motion.trusted and look.agrees
    assert len(look.ticks) == max(FEWEST, round(SECOND_LOOK * 400))
    stops = int(np.flatnonzero(motion.v[1:, 0] == 0.0)[0])
    assert stops in look.ticks  # the tick with the event is among them


def test_a_tick_that_ends_elsewhere_is_named(
    motion: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    stops = int(np.flatnonzero(motion.v[1:, 0] == 0.0)[0])
    q = motion.q.copy()
    q[stops + 1 :] += 1e-5
    wrong = replace(motion, q=read_only(q))
    assert not wrong.trusted
    assert f"tick at {motion.time[stops]:.9g} s" in caplog.text and "'axle'" in caplog.text
    assert wrong.trust(second_look=False) == (wrong.energy_error <= 1e-3)


def test_a_tick_may_be_off_by_its_own_error_only() -> None:
    """Not by the sum of those before it, which is far larger."""
    sim = models.simulator("double_pendulum", integrator="dopri5", tolerance=1e-9, dt=0.1)
    sim.reset(q=[0.5, 0.3])
    run = sim.run(4.0)
    look, own = run.second_look, np.diff(run.error)
    assert run.error[-1] > 10.0 * max(own.max(), 1e-9)
    np.testing.assert_array_equal(look.allowed, 10.0 * np.maximum(own, 1e-9)[look.ticks])


@pytest.mark.parametrize("coulomb", [0.5, 0.0], ids=["stops", "smooth"])
def test_the_error_of_fixed_steps_is_estimated(coulomb: float) -> None:
    """Of a wheel that friction stops, or only slows, by Heun; against error control."""
    scene = rotor(0.1, viscous=2.0, coulomb=coulomb)
    sim = Simulator(scene, integrator="heun", dt=2e-3)
    sim.reset(v=[3.0])
    run = sim.run(0.2, [0.0])
    sim = Simulator(scene, dt=2e-3, tolerance=1e-12)
    sim.reset(v=[3.0])
    error = abs(run.q - sim.run(0.2, [0.0]).q).max()
    assert error < run.second_look.error < 100.0 * error


def test_a_blow_in_one_step_is_noticed(caplog: pytest.LogCaptureFixture) -> None:
    """A mass of 1 kg leaves an undamped stop as fast as it came: half a period later.

    That is much less than a tick, so that half a tick contains all of it, too.
    """
    stop = {"limits": {"lower": -1.0, "upper": 0.5, "stop": {"stiffness": 1e6}}}
    scene = rotor(1.0) | {"joints": {"axle": stop}}
    sim = Simulator(scene, integrator="dop853", dt=1e-2)
    sim.reset(q=[0.4], v=[2.0])
    run = sim.run(0.2)
    assert abs(run.v[-1, 0] + 2.0) > 1e-3  # one step for half a period
    assert run.trust(second_look=False)
    assert not run.trusted and "tick at 0.05 s" in caplog.text


def test_a_step_from_an_event_to_the_end_of_its_tick_is_noticed() -> None:
    """A mass meets a stop in the second half of a tick, which half a tick leaves whole."""
    stop = {"limits": {"lower": -1.0, "upper": 0.012, "stop": {"stiffness": 22500.0}}}
    scene = rotor(1.0) | {"joints": {"axle": stop}}
    sim = Simulator(scene, integrator="rk4", dt=1e-2)
    sim.reset(v=[2.0])
    run = sim.run(1e-2)
    phase = 150.0 * 0.004
    assert abs(run.q[-1, 0] - 0.012 - 2.0 / 150.0 * np.sin(phase)) > 1e-6
    assert not run.second_look.agrees


def looked(tolerance: float | None, of_q: np.ndarray, of_v: np.ndarray) -> SecondLook:
    """At all of four ticks of 0.1 s of two joints that stay at 0 and 1 rad: differences given."""
    choice = replace(Simulator(SCENE).arm.compiled.choice, dt=0.1, tolerance=tolerance)
    after, differs = np.tile([0.0, 1.0, 0.0, 0.0], (4, 1)), np.hstack([of_q, of_v])

    def ticks(rows: Indices) -> Ticks:
        number = rows[:, None] + 0.0  # which the ticks carry as their command
        return Ticks(after[rows], after[rows], number, np.zeros((4, 0)), np.zeros(4))

    def finer(some: Ticks) -> np.ndarray:
        return some.after + differs[some.u[:, 0].astype(int)]

    return second_look(np.zeros((4, 2)), np.ones(4, dtype=bool), choice, ticks, finer)


def by_tick(look: SecondLook, values: np.ndarray) -> list[float]:
    return [float(x) for x in values[np.argsort(look.ticks)]]


def test_an_error_of_a_velocity_counts_for_as_long_as_it_lasts() -> None:
    """With fixed steps to the end of the motion; else within its tick. Relative to 1 + |q|."""
    of_q, of_v = np.zeros((2, 4, 2))
    of_q[1, 1], of_v[0, 0], of_v[3, 1] = -4e-6, 1e-6, 6e-6
    look = looked(None, of_q, of_v)
    assert by_tick(look, look.difference) == pytest.approx([4e-7, 2e-6, 0.0, 3e-7], rel=1e-9)
    assert by_tick(look, look.joint) == [0, 1, 0, 1]
    assert look.error == pytest.approx(4e-7 + 2e-6 + 3e-7, rel=1e-9)
    assert not look.agrees and look.ticks[look.worst] == 1
    look = looked(1e-7, of_q, of_v)
    assert by_tick(look, look.difference) == pytest.approx([1e-7, 2e-6, 0.0, 3e-7], rel=1e-9)
    assert not look.agrees and looked(3e-7, of_q, of_v).agrees


def test_a_tick_that_cannot_be_made_again_is_the_worst() -> None:
    of_q = np.zeros((4, 2))
    of_q[0, 0], of_q[2, 1] = 1.0, np.nan
    look = looked(1e-9, of_q, np.zeros((4, 2)))
    assert not look.agrees and look.ticks[look.worst] == 2


def test_the_second_look_is_finer_as_far_as_rounding_allows() -> None:
    finer = [finer_tolerance(x) for x in (1e-6, 1e-10, 1e-12, 1e-13, 1e-14)]
    assert finer == pytest.approx([1e-8, 1e-12, 1e-13, 1e-13, 1e-14], rel=1e-12, abs=0)


def test_what_is_drawn() -> None:
    """Half are the most abrupt ticks, none twice, and the same for the same motion."""
    change = np.zeros((5000, 2))
    change[[70, 4000], [0, 1]] = 1.0, -3.0
    usable = np.delete(np.arange(5000), 71)
    abrupt, random = drawn(usable, change)
    rows = np.concatenate([abrupt, random])
    assert len(rows) == len(set(rows)) == round(SECOND_LOOK * len(usable))
    assert {70, 4000, 4001} <= set(abrupt.tolist()) and 71 not in rows
    np.testing.assert_array_equal(random, drawn(usable, change)[1])
    assert sorted(np.concatenate(drawn(np.arange(3), change[:3])).tolist()) == [0, 1, 2]
