# SPDX-License-Identifier: Apache-2.0
"""The standard services by stand-ins of their messages: the package itself is not on PyPI."""

from __future__ import annotations

import importlib.util
from types import SimpleNamespace
from typing import Any

import pytest
from harness import Ros

import models
from arm_sim.ros.sim_node import SimNode

pytestmark = pytest.mark.ros

# As in SimulationState.msg and Result.msg of simulation_interfaces.
STOPPED, PLAYING, PAUSED = 0, 1, 2
UNSUPPORTED, OK, FAILED = 0, 1, 4


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm that ticks when told to."""
    return ros.add(SimNode, models.scene("two_link"), realtime=False)


def answer() -> Any:
    return SimpleNamespace(
        state=SimpleNamespace(state=0), result=SimpleNamespace(result=0, error_message="")
    )


def wanted(state: int) -> Any:
    return SimpleNamespace(state=SimpleNamespace(state=state))


def test_offered_only_where_the_package_is(node: SimNode) -> None:
    installed = importlib.util.find_spec("simulation_interfaces") is not None
    assert bool(node.standard.offered) is installed


def test_pauses_plays_and_stops(node: SimNode) -> None:
    standard = node.standard
    node.tick()
    assert standard.on_get_state(None, answer()).state.state == PLAYING
    assert standard.on_set_state(wanted(PAUSED), answer()).result.result == OK
    node.tick()
    assert node.simulator.step_count == 1
    assert standard.on_get_state(None, answer()).state.state == PAUSED
    assert standard.on_set_state(wanted(STOPPED), answer()).result.result == OK
    assert node.simulator.step_count == 0
    assert standard.on_get_state(None, answer()).state.state == STOPPED
    assert standard.on_set_state(wanted(PLAYING), answer()).result.result == OK
    node.tick()
    assert node.simulator.step_count == 1
    assert standard.on_set_state(wanted(3), answer()).result.result == UNSUPPORTED


def test_steps_and_resets(node: SimNode) -> None:
    standard = node.standard
    assert standard.on_step(SimpleNamespace(steps=5), answer()).result.result == OK
    assert node.simulator.step_count == 5
    refused = standard.on_step(SimpleNamespace(steps=0), answer()).result
    assert refused.result == FAILED
    assert "allowed are 1 to" in refused.error_message
    assert standard.on_reset(SimpleNamespace(scope=0), answer()).result.result == OK
    assert node.simulator.step_count == 0


def test_names_its_features(node: SimNode) -> None:
    known = SimpleNamespace(SIMULATION_RESET=10, STEP_SIMULATION_SINGLE=15, features=[])
    node.standard.on_features(None, SimpleNamespace(features=known))
    assert known.features == [10, 15]
