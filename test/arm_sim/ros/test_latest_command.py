# SPDX-License-Identifier: Apache-2.0
"""The torque slot: newest command, age in ticks, policies."""

from ctypes import byref
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import load_scene
from arm_sim.imperfections import command_line
from arm_sim.ros.commands.latest import LatestCommand
from arm_sim.ros.node_library import library

pytestmark = pytest.mark.ros

Q = np.array([0.3, -0.4])
TAU = np.array([1.0, 2.0])


def take(slot: LatestCommand, q: np.ndarray) -> Any:
    """What acts in the next tick at q."""
    return slot.command(library().choose(byref(slot), 1.0, False), q)


@pytest.fixture
def commands() -> LatestCommand:
    slot = LatestCommand(models.dynamics("two_link"))
    slot.configure(3, "zero")
    return slot


def test_gravity_is_what_springs_leave_of_it() -> None:
    dynamics = models.dynamics("spring_balanced_arm")
    slot = LatestCommand(dynamics)
    slot.configure(1, "gravity")
    assert abs(dynamics.gravity(Q)).max() > 1.0
    np.testing.assert_allclose(take(slot, Q), [0.0, 0.0], atol=1e-12)


def test_gravity_is_carried_by_commands_of_the_drives() -> None:
    """Volts on a motor: the current that gives the torque, times the resistance."""
    dynamics = models.dynamics("motor_pendulum")
    slot, q = LatestCommand(dynamics), np.array([0.7])
    slot.configure(1, "gravity")
    current = dynamics.gravity(q) / (50 * 0.05)
    assert abs(current[0]) > 0.1
    np.testing.assert_allclose(take(slot, q), 0.8 * current, rtol=1e-12)


@pytest.mark.parametrize("taken", [0, 3, 4])
def test_clear_forgets(commands: LatestCommand, taken: int) -> None:
    commands.configure(3, "hold")
    commands.put(TAU)
    for _ in range(taken):
        take(commands, Q)
    assert bool(commands.stale) == (taken == 4)
    commands.clear()
    for _ in range(2):
        assert (commands.any, commands.stale, commands.age) == (0, 0, 0)
        np.testing.assert_array_equal(take(commands, Q), [0.0, 0.0])


@pytest.mark.parametrize("policy", ["zero", "hold", "gravity"])
def test_policies(commands: LatestCommand, policy: str) -> None:
    gravity = models.dynamics("two_link").gravity(Q)
    before = {"zero": np.zeros(2), "hold": np.zeros(2), "gravity": gravity}
    after = {**before, "hold": TAU}
    commands.configure(1, policy)
    np.testing.assert_array_equal(take(commands, Q), before[policy])
    assert not commands.stale
    commands.put(TAU)
    take(commands, Q)
    np.testing.assert_array_equal(take(commands, Q), after[policy])


def test_a_delayed_command_that_is_sent_again_is_not_stale() -> None:
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    line = command_line(load_scene({**scene, "commands": {"delay": 0.002}}), 0.001)
    slot = LatestCommand(models.dynamics("two_link"), line)
    slot.configure(3, "zero")
    for tick in range(9):
        slot.put(TAU)
        slot.arrive(tick)
        acting = take(slot, Q)
    np.testing.assert_array_equal(acting, TAU)
