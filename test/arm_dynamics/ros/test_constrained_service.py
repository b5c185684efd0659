# SPDX-License-Identifier: Apache-2.0
"""The service ``~/constrained_dynamics`` and the topic ``~/multipliers``, against the core."""

from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Multipliers
from arm_msgs.srv import ConstrainedDynamics as Service
from harness import Ros
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.interfaces import CONSTRAINED_DYNAMICS
from arm_sim.ros import SimNode
from tolerances import PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

SCENE = load_scene(models.SCENES / "four_bar.yaml")


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the four-bar."""
    return ros.add(DynamicsNode, SCENE)


def ask(node: DynamicsNode, **fields: Any) -> Any:
    return node.answer(CONSTRAINED_DYNAMICS, Service.Request(**fields), Service.Response())


def test_bad_numbers_are_refused(node: DynamicsNode) -> None:
    """Also those that it computes, which would have no effect."""
    q = node.dynamics.model.q0
    answer = ask(node, position=q, inverse=True, multipliers=[1.0])
    assert not answer.success
    assert "multipliers has 1 numbers; allowed: 3" in answer.message
    for field in ("effort", "acceleration", "multipliers"):
        inverse, given = field == "effort", {field: [1.0] * 3}
        assert ask(node, position=q, inverse=not inverse, **given).success
        answer = ask(node, position=q, inverse=inverse, **given)
        assert not answer.success
        assert f"{field} is given, which is computed where inverse is" in answer.message


def published(ros: Ros, sim: SimNode) -> Multipliers:
    """The forces after some ticks."""
    heard = ros.listen(Multipliers, "/sim/multipliers")

    def ticked() -> list[Multipliers]:
        sim.tick()
        return heard

    ros.spin_until(ticked)
    ros.spin_until(lambda: to_nanoseconds(heard[-1].header.stamp) == sim.engine.stamp)
    return heard[-1]


def test_forces_of_a_moving_loop_are_those_of_the_present_state(ros: Ros) -> None:
    sim = ros.add(SimNode, SCENE, realtime=False, energy_period=0.001)
    message = published(ros, sim)
    assert list(message.names) == ["loop"] * 3
    state = sim.simulator.state
    _, lam = Dynamics(SCENE).constrained_forward(state.q, state.v, np.zeros(3))
    assert np.abs(lam).max() > 1.0
    assert_close(message.values, lam, PINOCCHIO)


def test_a_pen_that_presses_down_bears_a_force_downward(ros: Ros) -> None:
    """What the arm exerts against the constraint has the sign of the push."""
    sim = ros.add(
        SimNode, load_scene("pen_arm"), realtime=False, energy_period=0.001,
        command_timeout=0.0,
    )  # fmt: skip
    dyn = sim.simulator.dynamics
    push = dyn.contact_torque(dyn.model.q0, [0.0, 0.0, -7.0])
    command = (dyn.gravity(dyn.model.q0) + push).tolist()
    sim.inputs.on_commands(Float64MultiArray(data=command))
    assert_close(published(ros, sim).values, [-7.0], 1e-6)
