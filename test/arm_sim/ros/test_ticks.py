# SPDX-License-Identifier: Apache-2.0
"""Ticks of a node by the clock: how old commands are, when orders act, what energies are."""

import math
import time
from ctypes import addressof, byref

import numpy as np
import pytest
from harness import Ros
from sim_by_hand import NAMES, Waiting, by_hand, command, motion

from arm_sim.ros.node_library import library
from arm_sim.ros.timing.histogram import Histogram
from arm_sim.ros.timing.realtime_loop import Due

pytestmark = pytest.mark.ros

SECOND = 10**9


class Clocked:
    """A node by hand, whose ticks are made by the clock while messages wait."""

    def __init__(self, ros: Ros, **due: int) -> None:
        self.node = by_hand(ros, command_timeout=5e-3)
        self.lateness = Histogram()
        self.due = Due(lateness=addressof(self.lateness), **due)
        self.commands = Waiting(self.node).messages

    def ticks(self, count: int) -> None:
        """As many ticks, in one call."""
        engine, ended = self.node.engine, self.node.simulator.arm.step_count + count

        def end() -> None:
            self.due.ended = self.node.simulator.arm.step_count == ended

        engine.on_tick[:], self.due.ended = [end], 0
        engine.run(library().by_the_clock, byref(self.due))
        assert not engine.failure


def test_commands_age_in_part_while_ticks_are_made_up_for(ros: Ros) -> None:
    """Long behind, ticks of a second follow at once: they take next to no time."""
    clocked = Clocked(
        ros, deadline=time.monotonic_ns() - 1000 * SECOND, period=SECOND, give_up=10_000 * SECOND
    )
    engine = clocked.node.engine
    clocked.commands.append(command(name=NAMES, effort=[0.1, 0.1]))
    heard = engine.arbiter.now
    clocked.ticks(50)
    assert 1.0 <= engine.commands.age < 2.0, "the first one counts in full"
    assert 1.0 <= engine.arbiter.now - heard < 2.0


def test_an_order_waits_for_no_more_than_the_tick_under_way(ros: Ros) -> None:
    clocked, served = Clocked(ros), list[int]()
    queue, arm = clocked.node.engine.queue, clocked.node.simulator.arm
    queue.served = True
    clocked.ticks(3)
    queue.post(lambda: served.append(arm.step_count))
    clocked.ticks(3)
    assert served == [3] and arm.step_count == 6


def test_an_account_of_many_ticks_is_that_of_each(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.ros.energy_trail.ROWS", 3)
    clocked, each = Clocked(ros), by_hand(ros, command_timeout=5e-3)
    each.inputs.polled.close()
    for node in clocked.node, each:
        node.engine.energy.keep(True)
    for k in range(19):  # before it is closed, since nobody listens
        clocked.commands.append(raw := command(name=NAMES, effort=[math.sin(k), 1.0]))
        clocked.ticks(5)
        each.inputs.on_joint_commands(raw)
        for _ in range(5):
            each.tick()
            each.engine.energy.read()
        assert motion(each).tobytes() == motion(clocked.node).tobytes()
    one, other = clocked.node.engine.energy.read(), each.engine.energy.read()
    assert one is not None and other is not None and one.input != 0.0
    np.testing.assert_allclose(one, other, atol=1e-12)
