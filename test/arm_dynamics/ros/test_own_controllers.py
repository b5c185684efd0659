# SPDX-License-Identifier: Apache-2.0
"""The controller node runs user-defined controllers, and brakes the arm when one fails."""

import sys
from typing import Any

import numpy as np
import own_controllers
import pytest
from harness import Ros, change
from two_link_control import MS, effort, point, state, trajectory

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import Measured, PDGravity
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.diagnostics import ERROR, OK
from arm_sim.ros import SimNode
from tolerances import assert_close

pytestmark = pytest.mark.ros

SCENE = models.scene("two_link")
HOME = models.dynamics("two_link").model.q0
SPRINGS, FAILS = "own_controllers:Springs", "own_controllers:Fails"


@pytest.fixture(autouse=True)
def well_behaved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_controllers.Fails, "how", "")


def node_of(ros: Ros, **parameters: Any) -> ControllerNode:
    return ros.add(ControllerNode, SCENE, **parameters)


def level(node: ControllerNode) -> tuple[bytes, str]:
    status = node.diagnostics()[0].message(node)
    return status.level, status.message


def test_hand_over_is_without_a_jump_both_ways(ros: Ros) -> None:
    node = node_of(ros, controllers=[SPRINGS], controller="pd_gravity", switch_time=0.02)
    q = HOME + 0.05
    node.on_joint_states(state(0, HOME))
    ours = effort(node, MS, q)
    expected = PDGravity(models.dynamics("two_link"), 400.0, 40.0)
    assert change(node, controller=SPRINGS).successful
    np.testing.assert_array_equal(effort(node, 2 * MS, q), ours)
    for k in range(3, 30):
        tau = effort(node, k * MS, q)
    reference = node.goals.follower.reference(29 * MS)
    assert_close(tau, expected.torque(Measured(q, np.zeros(2)), reference), 1e-12)
    assert change(node, controller="pd_gravity").successful
    np.testing.assert_array_equal(effort(node, 30 * MS, q), tau)


@pytest.mark.parametrize("how", ["raise", "nan"])
def test_a_failed_one_stops_commanding_and_reports_it(
    ros: Ros, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = node_of(ros, controller=FAILS, controllers=[SPRINGS])
    sent: list[bytes] = []
    node.send = sent.append
    node.on_joint_states(state(0, HOME))
    monkeypatch.setattr(own_controllers.Fails, "how", how)
    assert node.on_joint_states(state(MS, HOME)) is None
    monkeypatch.setattr(own_controllers.Fails, "how", "")
    assert node.on_joint_states(state(2 * MS, HOME)) is None  # it has had its chance
    assert len(sent) == 1
    status, said = level(node)
    assert status == ERROR and "controller Fails " in said and "no commands until" in said
    # another one holds the arm where the brakes left it, from its own first torque on
    left = HOME + 0.3
    assert change(node, controller=SPRINGS).successful
    tau = effort(node, 3 * MS, left)
    assert_close(tau, models.dynamics("two_link").gravity(left), 1e-9)
    assert level(node)[0] == OK


def test_the_arm_of_one_that_fails_is_braked(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stops within its effort limits and then rests, to the bit."""
    sim = ros.add(SimNode, SCENE, realtime=False)
    node = node_of(ros, controller=FAILS)
    q = []
    for k in range(1500):
        if k == 400:
            assert abs(sim.simulator.state.v).max() > 0.3
            monkeypatch.setattr(own_controllers.Fails, "how", "raise")
        now = sim.simulator.state
        if command := node.on_joint_states(state(k * MS, now.q, now.v)):
            sim.inputs.on_joint_commands(command)
        sim.tick()
        if k == 0:
            node.on_joint_trajectory(trajectory(point(0.8, *(HOME + 0.5))))
        q.append(sim.simulator.state.q)
    np.testing.assert_array_equal(q[-500:], np.tile(q[-1], (500, 1)))
    assert abs(q[-1] - q[400]).max() < 0.3


def test_one_that_failed_begins_again_after_a_reset_and_with_other_gains(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = node_of(ros, controller=FAILS)
    for again in (lambda: None, lambda: change(node, bandwidth=9.0)):
        stamp = 50 * MS
        node.on_joint_states(state(stamp, HOME))
        monkeypatch.setattr(own_controllers.Fails, "how", "raise")
        assert node.on_joint_states(state(stamp + MS, HOME)) is None
        monkeypatch.setattr(own_controllers.Fails, "how", "")
        again()
        next_stamp = stamp + 2 * MS if node.params.settings.bandwidth == 9.0 else 0
        assert node.on_joint_states(state(next_stamp, HOME)) is not None


def test_what_cannot_be_used_is_refused_at_the_start(ros: Ros) -> None:
    for given, said in (
        (["own_controllers:Broken"], "no calibration file"),
        ([1, 2], "'controllers' is \\[1, 2\\]; texts .* are expected"),
    ):
        with pytest.raises(InvalidInput, match=said):
            node_of(ros, controllers=given)


def test_nothing_is_imported_after_the_start(ros: Ros) -> None:
    """Not by a parameter, and the list of what may be selected cannot be changed."""
    node = node_of(ros, controllers=[SPRINGS])
    for name in ("this:Class", "own_controllers:Fails", "os:system", "a:b:c"):
        answer = change(node, controller=name)
        assert not answer.successful and "when the node is started" in answer.reason
    assert "this" not in sys.modules
    assert not change(node, controllers=["this:Class"]).successful
    assert node.params.controller == "computed_torque"
    assert node.on_joint_states(state(0, HOME)) is not None
