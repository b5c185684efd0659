# SPDX-License-Identifier: Apache-2.0
"""The service ``~/constrained_dynamics`` and the topic ``~/multipliers``, against the core."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Multipliers
from arm_msgs.srv import ConstrainedDynamics as Service
from harness import Ros

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.ros.dynamics_node import DynamicsNode
from arm_sim.ros.sim_node import SimNode
from tolerances import INVERSE_PAIR, PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

SCENE = load_scene(models.SCENES / "four_bar.yaml")


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the four-bar."""
    return ros.add(DynamicsNode, SCENE)


def ask(node: DynamicsNode, **fields: Any) -> Any:
    return node.on_constrained_dynamics(Service.Request(**fields), Service.Response())


def test_there_and_back_over_the_wire(ros: Ros, node: DynamicsNode) -> None:
    """Forward, and inverse of what came out, with joints in another order."""
    dyn = Dynamics(SCENE)
    q, v = np.tile(dyn.model.q0, (2, 1)), np.array([dyn.model.v0, 0.0 * dyn.model.v0])
    tau = np.array([[0.1, 0.2, 0.3], [0.0, -0.1, 0.4]])
    order = [2, 0, 1]
    names = [dyn.joint_names[i] for i in order]
    there = {"joint_names": names, "position": q[:, order].ravel(),
             "velocity": v[:, order].ravel()}  # fmt: skip
    request = Service.Request(**there, effort=tau[:, order].ravel())
    answer = ros.call(Service, "/dynamics/constrained_dynamics", request)
    assert answer.success, answer.message
    a, lam = dyn.constrained_forward(q, v, tau)
    assert_close(answer.acceleration, a[:, order].ravel(), PINOCCHIO)
    assert_close(answer.multipliers, lam.ravel(), PINOCCHIO)
    assert list(answer.constraint_names) == ["loop"] * 3
    back = ask(node, **there, inverse=True, acceleration=answer.acceleration,
               multipliers=answer.multipliers)  # fmt: skip
    assert_close(back.effort, tau[:, order].ravel(), INVERSE_PAIR)


def test_bad_multipliers_are_refused(node: DynamicsNode) -> None:
    answer = ask(node, position=node.dynamics.model.q0, inverse=True, multipliers=[1.0])
    assert not answer.success
    assert "multipliers has 1 numbers; allowed is 3" in answer.message


def test_forces_are_published_to_listeners(ros: Ros) -> None:
    sim = ros.add(SimNode, SCENE, realtime=False)
    heard = ros.listen(Multipliers, "/sim/multipliers")

    def ticked() -> list[Any]:
        for _ in range(20):
            sim.tick()
        return heard

    ros.spin_until(ticked)
    assert list(heard[0].names) == ["loop"] * 3
    assert np.isfinite(heard[0].values).all()
    assert np.abs(heard[0].values).max() > 0.0
